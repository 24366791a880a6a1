"""Peaks that are narrower than the refinement's grid: the verification sees them, and the motion is refined again."""

import brachis
from brachis.search import verified
from brachis.task import load_task

ROBOT, SEED, NUMBER = "ur10_rail", 3, 4
"""Passes a singular posture, where the rail's force peaks for 0.3 ms; the grid's step is 1.9 ms."""
CHANGES = {"spline.intervals": 10, "search.least_motion": False}


def test_a_peak_that_only_the_verification_sees(bench, tmp_path, monkeypatch):
    case = bench("mixed_cases").case(ROBOT, SEED, NUMBER, tmp_path)
    start = {"joints": case.joint_path[0].tolist()}
    task = load_task(case.task, changes={**CHANGES, "start": start})
    densities = []
    refine = verified.refine

    def record(program, first, solve, options):
        refined = refine(program, first, solve, options)
        densities.append(options.density)
        assert refined.violation <= options.tolerance
        return refined

    monkeypatch.setattr(verified, "refine", record)
    result = brachis.plan(task, strict=False)
    assert result.verified
    assert densities == [10, 40]
