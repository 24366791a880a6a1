"""The pipeline as a whole: what is kept, what is refused, how it is interrupted."""

import sys

import numpy as np
import pytest

import brachis
from brachis.errors import NotInstalledError, StartError
from brachis.optimise.refine import RefinementOptions, refine
from support.effort import QUICK
from support.scara import START, scara
from support.solvers import solve
from support.starts import starting_points


def plan(robot=None, **changes):
    line = {
        "start": START,
        "task_space": ["x", "y"],
        "path": brachis.Line(length=1.0, angle_deg=90),
        "redundant_joints": ["j3"],
        "intervals": 20,
    }
    return brachis.plan(robot or scara(), **{**line, **QUICK, **changes})


def test_task_of_the_result_repeats_the_plan():
    result = plan(scara({"torque": 12.0}))
    assert brachis.plan(result.task).t_end == pytest.approx(result.t_end, rel=1e-6)


def test_unrefined_motion_exceeds_a_limit_between_collocation_points_and_the_refined_one_does_not():
    program, _ = brachis.transcribe(
        brachis.examples.scara_line, redundant_joints=["j1"]
    )
    first = solve(program, next(starting_points(program)))
    (phase,) = program.phases
    dense = phase.with_points(np.linspace(0.0, 1.0, 2001))
    assert phase.violation(first.x).max() < 1e-6
    assert dense.violation(first.x).max() > 0.01
    refined = refine(program, first, solve, RefinementOptions())
    assert dense.violation(refined.x).max() <= 1e-4
    assert refined.t_end > first.objective


def test_without_refinement_the_answer_is_left_as_it_is():
    result = plan(redundant_joints=["j1"], refinement={"max_rounds": 0})
    assert not result.verified
    assert result.verification.worst_ratio > 1.01
    assert result.candidate.time_scaled == 1.0
    assert sum(np.isfinite(candidate.t_end) for candidate in result.candidates) == 1


@pytest.mark.parametrize("name", ["auto", "uno_interior"])
def test_without_ipopt_plans_are_made_by_what_uno_brings(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "ipyopt", None)
    assert plan(intervals=8, solver=name).verified


def test_a_solver_that_is_not_installed_is_an_error_that_names_the_others(monkeypatch):
    monkeypatch.setitem(sys.modules, "ipyopt", None)
    others = r"Linux on x86_64.*auto, uno or uno_interior, or .*\.\[ipopt\]"
    with pytest.raises(NotInstalledError, match=f"solver.name: ipopt.*{others}"):
        plan(solver={"name": "ipopt"})


def test_path_start_has_to_be_that_of_the_posture():
    assert plan(path_start=[np.sqrt(3.0), 0.0]).verified
    with pytest.raises(
        StartError, match=r"the start posture is off the path; found 0.01 m off in y"
    ):
        plan(path_start=[np.sqrt(3.0), 0.01])
    with pytest.raises(
        brachis.InputError, match="path_start: this is the wrong number of coordinates"
    ):
        plan(path_start=[1.0, 0.0, 0.0])


def test_end_posture_on_another_branch_is_an_error():
    free = plan()
    end = free.trajectory.position(free.t_end)
    assert plan(end=end).verified
    # The mirror image of the first two links about the line to the third joint reaches the same point.
    turns = np.cumsum(end[:2])
    wrist = np.array([np.cos(turns).sum(), np.sin(turns).sum()])
    bearing = np.arctan2(wrist[1], wrist[0])
    mirrored = [2 * bearing - end[0], -end[1], end[2] + 2 * (turns[1] - bearing)]
    with pytest.raises(StartError, match="the end posture is on a different branch"):
        plan(end=mirrored)


@pytest.mark.parametrize("size", [0.01, 0.004])
def test_a_blend_of_millimetres_is_not_stepped_over(size):
    """The torque peak inside a blend lies between the points of any even grid."""
    line = {
        "path": brachis.Line(by=[-0.3, 0.3], blend=size)
        + brachis.Line(by=[-0.3, -0.2]),
        "start": [0.3, 0.8, -0.9],
        "redundant_joints": ["j1"],
    }
    result = plan(brachis.robots.scara3, **line)
    assert result.verified
    program, _ = brachis.transcribe(result.trajectory.robot, result.task)
    breaks = program.phases[0].joint_map.path.breaks
    assert np.diff(breaks).min() < size / 0.3
