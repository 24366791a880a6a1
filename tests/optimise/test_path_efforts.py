"""How closely joint paths are looked for, and how closely they are timed."""

from dataclasses import replace

import pytest

import brachis
from brachis.common.deadline import NEVER
from brachis.optimise.backends import solvers_for
from brachis.optimise.improve import SolverSession
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import Program
from brachis.optimise.retiming import FINE, improve_joint_paths
from brachis.search.differential_ik import differential_ik_paths


@pytest.fixture(scope="module")
def phase():
    """Of the planar arm's line, and a joint path along it."""
    program, _ = brachis.transcribe(
        brachis.examples.scara_line, redundant_joints=["j1"], intervals=20
    )
    (own,) = program.phases
    return own, next(differential_ik_paths(own.joint_map))


@pytest.mark.parametrize("places", [200, 800])
def test_a_rough_timing_is_right_within_a_hundredth(phase, places):
    fine = PhaseTiming.through(*phase)
    rough = PhaseTiming.through(*phase, places, is_rough=True)
    assert rough.t_end == pytest.approx(fine.t_end, rel=1e-2)


@pytest.mark.parametrize("known, solves", [(0, 1), (12, 0), (11, 0), (13, 1)], ids=str)
def test_a_mesh_that_is_no_finer_is_not_solved_again(phase, known, solves):
    own, curves = phase
    effort = replace(FINE, intervals=(12,), known=known)
    (backend,) = solvers_for("uno")
    session = SolverSession(backend, FINE.options, NEVER)
    better = improve_joint_paths(Program([own]), [curves], session, 1e-3, effort)
    assert len(better.reports) == solves


def test_a_joint_path_that_no_timing_meets_is_left_as_it_is(phase, monkeypatch):
    own, curves = phase
    monkeypatch.setattr(
        "brachis.timing.TimedCourse.solve", lambda *_args, **_keys: None
    )
    (backend,) = solvers_for("uno")
    session = SolverSession(backend, FINE.options, NEVER)
    left = improve_joint_paths(Program([own]), [curves], session, 1e-3, FINE)
    assert left.t_end == float("inf")
    assert not left.reports
