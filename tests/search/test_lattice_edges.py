"""Lattices where ranges, lifts, limits or paths are out of the ordinary."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.robot.from_task import robot_from_settings
from brachis.search.course import TOO_HEAVY, DeadEnd
from brachis.search.lattice import Lattice
from brachis.search.layer import all_lifts
from brachis.search.stations import stations
from brachis.setting import Setting, choices

ROOT = Path(__file__).parents[2]
SCARA = ROOT / "robots/scara3/robot.urdf"


def scara(locked: dict[str, float] | None = None, **limits: object) -> brachis.Robot:
    spec = brachis.LimitSpec(**({"torque": 10.0, "velocity": None} | limits))
    return brachis.Robot.from_urdf(SCARA, gravity=[0, 0, 0], limits=spec, locked_joints=locked)


def setting(robot: brachis.Robot, **task: object) -> Setting:
    return Setting.of(robot, brachis.load_task({"brachis": 1, "task_space": ["x", "y"]} | task))


def rail_task(**changes: object) -> dict[str, object]:
    return brachis.load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict() | changes


def test_a_free_start_may_be_in_any_turn_of_a_range():
    """A circle and a half about the base fits into the range only from its lower end on."""
    robot = scara({"j3": 0.4}, position={"j1": [-2 * math.pi, 2 * math.pi]})
    start = np.array([-2 * math.pi + 0.2, 0.9])
    here = robot.tool_placement(start).translation[:2]
    turns = [{"circle": {"center": [0.0, 0.0], "turns": 1.5}}]
    (choice,) = choices(setting(robot, start="free", path_start=list(here), path=turns))
    courses = Lattice(choice).courses(4)
    assert not isinstance(courses, DeadEnd)
    assert min(abs(course.q[0, 0] - start[0]) for course in courses) < 1e-6


def test_all_lifts():
    q = np.array([[0.5, 0.1], [3.0, 0.2]])
    which, lifted = all_lifts(q, np.array([0]), np.array([-7.0, -1.0]), np.array([7.0, 1.0]))
    assert which.tolist() == [0, 0, 0, 1, 1]
    np.testing.assert_allclose(np.sin(lifted[:, 0]), np.sin(q[which, 0]), atol=1e-12)
    assert np.all(np.abs(lifted[:, 0]) <= 7.0)
    which, _ = all_lifts(q, np.array([0]), np.array([1.0, -1.0]), np.array([2.0, 1.0]))
    assert which.tolist() == []
    which, lifted = all_lifts(q, np.array([0]), np.array([10.0, -1.0]), np.array([np.inf, 1.0]))
    assert which.tolist() == [0, 1]
    assert np.all((lifted[:, 0] >= 10.0) & (lifted[:, 0] < 10.0 + 2 * math.pi))


@pytest.mark.parametrize("reach", [None, [-30.0, 30.0], [8.0, None]])
def test_a_free_start_on_a_long_rail(reach):
    """The path begins 20 m along it."""
    robot = robot_from_settings(brachis.load_task(rail_task()).robot)
    task = rail_task(start="free", redundant_joints=["rail"])
    placement = robot.tool_placement(robot.posture([0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1], "start"))
    x, y, z = placement.translation
    task["path_start"] = [x, y + 20.0, z, *_quaternion(placement.rotation)]
    task["path"] = [{"line": {"by": [0.0, 0.8, 0.0]}}]
    task["robot"]["limits"]["position"] = {"rail": reach}
    given = Setting.of(robot_from_settings(brachis.load_task(task).robot), brachis.load_task(task))
    courses = Lattice(choices(given)[0]).courses(2)
    assert not isinstance(courses, DeadEnd)
    assert all(abs(course.q[0, 0] - 20.0) < 3.0 for course in courses)


def _quaternion(rotation: np.ndarray) -> list[float]:
    from scipy.spatial.transform import Rotation  # noqa: PLC0415

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return [w, x, y, z]


def test_both_branches_of_a_free_start():
    line = [{"line": {"length": 0.6, "angle_deg": 90}}]
    given = setting(scara(), start="free", path_start=[math.sqrt(3.0), 0.0], path=line, redundant_joints=["j1"])
    courses = Lattice(choices(given)[0]).courses(4)
    assert {course.branch for course in courses} == {0, 1}


def test_a_free_start_that_no_torque_holds_says_so():
    limits = brachis.LimitSpec(torque=1.0, velocity=None)
    robot = brachis.Robot.from_urdf(SCARA, gravity=[0, -9.81, 0], limits=limits)
    line = [{"line": {"length": 0.6, "angle_deg": 90}}]
    given = setting(robot, start="free", path_start=[math.sqrt(3.0), 0.0], path=line, redundant_joints=["j1"])
    end = Lattice(choices(given)[0]).courses(1)
    assert isinstance(end, DeadEnd)
    assert end.s == 0.0
    assert TOO_HEAVY in end.causes


def test_acceleration_limits_alone_have_shortest_courses():
    robot = scara(torque=None, acceleration=3.0)
    line = [{"line": {"length": 1.0, "angle_deg": 90}}]
    given = setting(robot, start={"joints": [0.5, -2.0, 2.0]}, path=line, redundant_joints=["j1"])
    courses = Lattice(choices(given)[0]).courses(3)
    assert len(courses) == 3
    assert courses[0].length > 0.0
    steps = np.abs(np.diff(courses[0].q[:, 0], n=2))
    assert steps.max() < 0.2, "the shortest course does not zigzag"


@pytest.mark.parametrize("turns", [4, 30])
def test_small_circles_have_stations_enough(turns):
    given = setting(
        scara(), start={"joints": [0.5, -2.0, 1.7]}, path=[{"circle": {"center": [0.0, 0.0], "turns": turns}}]
    )
    assert len(stations(given.path, given.task_space)) > 24 * turns / 2
    for choice in choices(given):
        assert not isinstance(Lattice(choice).courses(1), DeadEnd)


def test_an_end_posture_without_redundancy_may_be_rounded():
    robot = scara({"j3": 0.4})
    line = [{"line": {"by": [-0.3, 0.2]}}]
    free = brachis.plan(robot, setting(robot, start={"joints": [0.3, 0.9]}, path=line).task)
    end = [round(float(value), 7) for value in free.trajectory.position(free.t_end)]
    given = setting(robot, start={"joints": [0.3, 0.9]}, path=line, end={"joints": end})
    assert not isinstance(Lattice(choices(given)[0]).courses(1), DeadEnd)
