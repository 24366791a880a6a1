"""Joint paths that are improved over time, where the arm waits between its phases."""

import yaml

import brachis
from brachis.search import pipeline


def test_dwells_do_not_keep_a_motion_from_being_improved_over_time(monkeypatch):
    solved = []
    refine = pipeline.refine_and_verify

    def look(*given):
        done = refine(*given)
        solved.append(done.t_end)
        return done

    monkeypatch.setattr(pipeline, "refine_and_verify", look)
    waiting = yaml.safe_load("""
    - {line: {by: [0.0, 0.4]}, stop: true, dwell: 1.0}
    - line: {by: [0.3, 0.0]}
    """)
    result = brachis.plan(
        brachis.examples.scara_line,
        path=waiting,
        redundant_joints="auto",
        intervals="auto",
        rest="velocity",
        effort="single",
    )
    assert result.verified
    assert result.t_end in solved
    assert result.t_end > 1.0
