"""Margins from singular postures and from the ends of ranges: kept on request, reported in any case."""

import numpy as np
import pytest

import brachis
from brachis.errors import PlanningError, StartError, TaskError
from brachis.task import load_task

TASK = {
    "path": [brachis.Line(by=[0.1, -0.3, 0.05])],
    "start": [0.5, 0.4, 1.3, 0.0, np.pi / 2 - 0.13, 0.3],
    "locked_joints": {"rail": 0.0},
    "task_space": "pose",
    "intervals": 12,
    "least_motion": False,
}


def plan(**margins):
    return brachis.plan("tx90l_rail", margins=margins, **TASK)


@pytest.fixture(scope="module")
def result():
    return plan()


def test_margins_are_those_of_the_arm(result):
    """By Pinocchio's own Jacobian, at many instants."""
    singular, range_end = result.verification.margins
    robot = result.trajectory.robot
    q = result.trajectory.position(np.linspace(0.0, result.t_end, 2000))
    task_map = brachis.task_map_of(robot, "pose")
    jacobian = task_map.jacobian(task_map.twists(q))
    least = np.linalg.svd(jacobian, compute_uv=False)[:, -1].min()
    assert singular.value == pytest.approx(least, rel=1e-4)
    limits = robot.limits
    ends = np.minimum(q - limits.position_lower, limits.position_upper - q)
    parts = 100.0 * ends / (limits.position_upper - limits.position_lower)
    assert range_end.value == pytest.approx(parts.min(), rel=1e-4)
    assert range_end.subject == robot.joint_names[int(parts.min(axis=0).argmin())]
    assert result.to_dict()["margins"][0]["name"] == "smallest singular value"


def test_a_margin_that_is_kept_changes_nothing(result):
    singular, range_end = result.verification.margins
    same = plan(singularity=0.9 * singular.value, joint_ends=0.009 * range_end.value)
    assert same.verified
    assert same.t_end == pytest.approx(result.t_end, rel=1e-6)
    names = [check.name for check in same.verification.checks]
    assert {"singularity ratio", "joint ends ratio"} <= set(names)


def test_what_cannot_be_kept_is_refused_with_the_key(result):
    singular, range_end = result.verification.margins
    with pytest.raises((StartError, PlanningError), match="singularity"):
        plan(singularity=1.1 * singular.value)
    with pytest.raises((StartError, PlanningError), match="range"):
        plan(joint_ends=0.011 * range_end.value)


@pytest.mark.parametrize("given", [{"singularity": -1.0}, {"joint_ends": 0.5}])
def test_margins_that_make_no_sense_are_errors(given):
    with pytest.raises(TaskError, match="margins"):
        brachis.plan("tx90l_rail", margins=given, **TASK)


def test_a_path_of_joints_has_no_singular_postures():
    task = {
        "brachis": 1,
        "robot": {"urdf": "unread.urdf"},
        "task_space": "joints",
        "path": [[0.0, 0.0], [1.0, 0.5]],
        "margins": {"singularity": 0.1},
    }
    with pytest.raises(TaskError, match="leaves no choice"):
        load_task(task)
