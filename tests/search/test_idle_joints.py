"""Joints that move no row of the task space stand still, unless moving them pays or a given posture asks for it."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import brachis
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.search.given_motion import lock_idle, narrow_motion
from brachis.task import task_with
from brachis.trajectory import Trajectory
from support.effort import QUICK

START = [0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.7]
HELD = "with idle joints held"
LINE = brachis.Line(by=[-0.1, 0.2, 0.1])


def plan(**keywords):
    line = {"start": START, "task_space": "position", "path": LINE, "intervals": 10}
    return brachis.plan("iiwa14", **{**line, **QUICK, **keywords})


@pytest.fixture(scope="module")
def result():
    return plan()


def test_the_last_joint_of_an_arm_stands_still_along_positions(result):
    assert result.verified
    q = result.trajectory.position(np.linspace(0.0, result.t_end, 101))
    assert_array_equal(q[:, 6], START[6])
    assert np.ptp(q[:, :6], axis=0).max() > 0.05
    assert result.candidate.origin == HELD


def test_moving_it_would_not_pay(result):
    moving = [each for each in result.candidates if each.origin != HELD]
    assert moving
    assert min(each.t_end for each in moving) > (1.0 - 2e-3) * result.t_end


def test_it_is_saved_and_judged_as_a_motion_of_all_joints(result, tmp_path):
    result.trajectory.save(tmp_path / "motion.npz")
    again = Trajectory.load(tmp_path / "motion.npz")
    assert brachis.verify_trajectory(again).passed
    assert len(again.joint_names) == 7
    narrow = narrow_motion(again)
    assert len(narrow.joint_names) == 6
    known = brachis.bottleneck.report(result).sensitivities.limits
    assert {entry.label.subject for entry in known} <= set(narrow.joint_names)


def test_a_given_end_moves_it(result):
    end = result.trajectory.q[-1].copy()
    end[6] += 0.4
    moved = plan(end=end.tolist())
    assert moved.verified
    assert moved.trajectory.q[-1, 6] == pytest.approx(end[6])


def test_it_stands_still_in_named_postures_too():
    """On the way only the place of the tool counts, not the idle joint of the posture."""
    turned = [0.3, 0.7, 0.2, -1.2, 0.4, 0.9, -0.7]
    away = brachis.Line(to_posture="turned", stop=True)
    back = brachis.Line(to_posture="home")
    postures = {"home": START, "turned": turned}
    result = plan(start="home", postures=postures, path=away + back)
    assert result.verified
    np.testing.assert_array_equal(result.trajectory.q[:, 6], START[6])
    assert result.candidate.origin == HELD


def test_limits_and_friction_by_joint_hold_for_the_others():
    """An axis of the gantry stands still; the other one needs 2 sqrt(L / a)."""
    lists = {"acceleration": [3.0, 2.0], "torque": None, "velocity": None}
    result = brachis.plan(
        "gantry2",
        limits=lists,
        friction={"viscous": [0.0, 0.1], "coulomb": [0.0, 0.2]},
        start=[0.1, 0.2],
        task_space=["x"],
        path=brachis.Line(by=[0.3]),
        intervals="auto",
        **QUICK,
    )
    assert result.verified
    assert_array_equal(result.trajectory.q[:, 1], 0.2)
    assert result.t_end == pytest.approx(2.0 * np.sqrt(0.3 / 3.0), rel=1e-3)


@pytest.mark.parametrize(
    "robot, rows, idle",
    [
        ("gantry2", ["x"], 1),
        ("ur10_rail", ["x", "y", "z"], 1),
        ("scara3", ["x", "y"], 0),
    ],
)
def test_which_joints_are_idle(robot, rows, idle):
    count = len(rows)
    task = task_with(
        robot={"urdf": robot},
        limits={"acceleration": 3.0},
        friction={"viscous": 0.5},
        start="free",
        path_start=[0.5, 0.1, 0.4][:count],
        task_space=rows,
        path=brachis.Line(by=[0.1] * count),
    )
    arm = robot_for(None, task.robot)
    problem = Problem.of(arm, task)
    locked = lock_idle(arm, task, problem.task_map, problem.given_postures)
    assert (arm.n - locked[0].n if locked else 0) == idle
