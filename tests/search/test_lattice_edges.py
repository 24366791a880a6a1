"""Lattices where ranges, lifts, limits or paths are out of the ordinary."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot.from_task import robot_from_settings
from brachis.search.closed_form_lattice import ClosedFormLattice
from brachis.search.joint_path import DeadEnd
from brachis.search.lattice import stations

ROOT = Path(__file__).parents[2]
SCARA = ROOT / "robots/scara3/robot.urdf"


def scara(locked: dict[str, float] | None = None, **limits: object) -> brachis.Robot:
    spec = brachis.LimitSpec(**({"torque": 10.0, "velocity": None} | limits))
    return brachis.Robot.from_urdf(
        SCARA, gravity=[0, 0, 0], limits=spec, locked_joints=locked
    )


def problem(robot: brachis.Robot, **task: object) -> Problem:
    return Problem.of(
        robot, brachis.load_task({"brachis": 1, "task_space": ["x", "y"]} | task)
    )


def rail_task(**changes: object) -> dict[str, object]:
    return (
        brachis.load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict() | changes
    )


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_free_start_may_be_in_any_turn_of_a_range(way):
    """A circle and a half about the base fits into the range only from one of its ends on."""
    robot = scara({"j3": 0.4}, position={"j1": [-2 * math.pi, 2 * math.pi]})
    start = np.array([way * (-2 * math.pi + 0.2), 0.9])
    here = robot.tool_placement(start).translation[:2]
    turns = [{"circle": {"center": [0.0, 0.0], "turns": 1.5 * way}}]
    (decomposition,) = decompositions_of(
        problem(robot, start="free", path_start=list(here), path=turns)
    )
    joint_paths = ClosedFormLattice(decomposition).joint_paths(4)
    assert not isinstance(joint_paths, DeadEnd)
    assert all(
        -2 * math.pi <= q <= 2 * math.pi
        for joint_path in joint_paths
        for q in joint_path.q[:, 0]
    )
    assert min(abs(joint_path.q[0, 0] - start[0]) for joint_path in joint_paths) < 1e-6


def test_a_circle_too_many_for_the_range_is_a_dead_end_at_its_joint():
    robot = scara({"j3": 0.4}, position={"j1": [-2 * math.pi, 2 * math.pi]})
    here = robot.tool_placement(np.array([0.2, 0.9])).translation[:2]
    turns = [{"circle": {"center": [0.0, 0.0], "turns": 2.1}}]
    (decomposition,) = decompositions_of(
        problem(robot, start="free", path_start=list(here), path=turns)
    )
    end = ClosedFormLattice(decomposition).joint_paths(4)
    assert isinstance(end, DeadEnd)
    assert 1.8 / 2.1 < end.s < 1.0
    assert "the range of joint 'j1' ends" in end.cause


@pytest.mark.parametrize("reach", [None, [-30.0, 30.0], [8.0, None]])
def test_a_free_start_on_a_long_rail(reach):
    """The path begins 20 m along it."""
    robot = robot_from_settings(brachis.load_task(rail_task()).robot)
    task = rail_task(start="free", redundant_joints=["rail"])
    placement = robot.tool_placement(
        robot.posture([0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1], "start")
    )
    x, y, z = placement.translation
    task["path_start"] = {
        "position": [x, y + 20.0, z],
        "quaternion_wxyz": _quaternion(placement.rotation),
    }
    task["path"] = [{"line": {"by": [0.0, 0.8, 0.0]}}]
    task["robot"]["limits"]["position"] = {"rail": reach}
    given = Problem.of(
        robot_from_settings(brachis.load_task(task).robot), brachis.load_task(task)
    )
    joint_paths = ClosedFormLattice(decompositions_of(given)[0]).joint_paths(2)
    assert not isinstance(joint_paths, DeadEnd)
    assert all(abs(joint_path.q[0, 0] - 20.0) < 3.0 for joint_path in joint_paths)


def _quaternion(rotation: np.ndarray) -> list[float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return [w, x, y, z]


def test_both_branches_of_a_free_start():
    line = [{"line": {"length": 0.6, "angle_deg": 90}}]
    given = problem(
        scara(),
        start="free",
        path_start=[math.sqrt(3.0), 0.0],
        path=line,
        redundant_joints=["j1"],
    )
    joint_paths = ClosedFormLattice(decompositions_of(given)[0]).joint_paths(4)
    assert {joint_path.branch for joint_path in joint_paths} == {0, 1}


def test_a_free_start_that_no_torque_holds_says_so():
    limits = brachis.LimitSpec(torque=1.0, velocity=None)
    robot = brachis.Robot.from_urdf(SCARA, gravity=[0, -9.81, 0], limits=limits)
    line = [{"line": {"length": 0.6, "angle_deg": 90}}]
    given = problem(
        robot,
        start="free",
        path_start=[math.sqrt(3.0), 0.0],
        path=line,
        redundant_joints=["j1"],
    )
    end = ClosedFormLattice(decompositions_of(given)[0]).joint_paths(1)
    assert isinstance(end, DeadEnd)
    assert end.s == 0.0
    assert "the torque limit of j1 cannot hold the arm against gravity" in end.cause


def test_acceleration_limits_alone_have_shortest_courses():
    robot = scara(torque=None, acceleration=3.0)
    line = [{"line": {"length": 1.0, "angle_deg": 90}}]
    given = problem(
        robot, start={"joints": [0.5, -2.0, 2.0]}, path=line, redundant_joints=["j1"]
    )
    joint_paths = ClosedFormLattice(decompositions_of(given)[0]).joint_paths(3)
    assert len(joint_paths) == 3
    assert joint_paths[0].length > 0.0
    steps = np.abs(np.diff(joint_paths[0].q[:, 0], n=2))
    assert steps.max() < 0.2, "the shortest joint path does not zigzag"


@pytest.mark.parametrize(("turns", "joints"), [(4, ["j1"]), (30, ["j2"]), (30, ["j3"])])
def test_small_circles_have_stations_enough(turns, joints):
    path = [{"circle": {"center": [0.0, 0.0], "turns": turns}}]
    given = problem(
        scara(), start={"joints": [0.5, -2.0, 1.7]}, path=path, redundant_joints=joints
    )
    assert len(stations(given.path, given.task_map)) > 24 * turns / 2
    (decomposition,) = decompositions_of(given)
    assert not isinstance(ClosedFormLattice(decomposition).joint_paths(1), DeadEnd)


def test_an_end_posture_without_redundancy_may_be_rounded():
    robot = scara({"j3": 0.4})
    line = [{"line": {"by": [-0.3, 0.2]}}]
    free = brachis.plan(
        robot, problem(robot, start={"joints": [0.3, 0.9]}, path=line).task
    )
    end = [round(float(value), 7) for value in free.trajectory.position(free.t_end)]
    given = problem(robot, start={"joints": [0.3, 0.9]}, path=line, end={"joints": end})
    assert not isinstance(
        ClosedFormLattice(decompositions_of(given)[0]).joint_paths(1), DeadEnd
    )


def back_from(
    end: np.ndarray, robot: brachis.Robot, by: list[float]
) -> dict[str, object]:
    """A task of a line that ends in a posture and may begin in any."""
    placement = robot.tool_placement(end)
    return {
        "start": "free",
        "path_start": {
            "position": (placement.translation - by).tolist(),
            "quaternion_wxyz": _quaternion(placement.rotation),
        },
        "end": {"joints": end.tolist()},
        "path": [{"line": {"by": by}}],
        "redundant_joints": "auto",
        "branch": "auto",
    }


@pytest.mark.parametrize(
    "turned",
    [
        {},
        {"shoulder_pan_joint": -1},
        {"wrist_1_joint": 1},
        {"wrist_3_joint": -1},
        {"shoulder_lift_joint": 1, "wrist_2_joint": 1},
        {"wrist_1_joint": 1, "wrist_3_joint": -1},
    ],
)
def test_a_free_start_is_in_the_turn_from_which_the_given_end_is_reached(turned):
    """Ranges of two turns: whichever turns the end is in, every choice of redundant joints finds its way back."""
    task = brachis.load_task(ROOT / "examples/04_ur10_rail_weld.yaml").to_dict()
    robot = robot_from_settings(brachis.load_task(task).robot)
    end = np.array(task["start"]["joints"])
    for joint, turns in turned.items():
        end[robot.joint_names.index(joint)] += 2.0 * math.pi * turns
    task |= back_from(end, robot, [0.0, 0.4, 0.0])
    found = 0
    for decomposition in decompositions_of(Problem.of(robot, brachis.load_task(task))):
        joint_paths = ClosedFormLattice(decomposition).joint_paths(2)
        assert not isinstance(joint_paths, DeadEnd)
        assert all(
            np.abs(joint_path.q[-1] - end).max() < 1e-9 for joint_path in joint_paths
        )
        found += 1
    assert found == 4


def test_a_motion_planned_one_way_is_found_the_other_way_round():
    task = brachis.load_task(ROOT / "examples/04_ur10_rail_weld.yaml").to_dict()
    robot = robot_from_settings(brachis.load_task(task).robot)
    begin = np.array(task["start"]["joints"])
    begin[robot.joint_names.index("wrist_1_joint")] += 2.0 * math.pi
    task |= {
        "redundant_joints": ["rail"],
        "path": [{"line": {"by": [0.0, -0.4, 0.0]}}],
        "search": {"effort": "single"},
    }
    there = brachis.plan(task | {"start": {"joints": begin.tolist()}})
    back = brachis.plan(
        task | back_from(begin, robot, [0.0, 0.4, 0.0]) | {"redundant_joints": ["rail"]}
    )
    assert there.verified
    assert back.verified
    assert back.t_end == pytest.approx(there.t_end, rel=2e-3)


def test_a_dead_end_back_from_the_end_says_so():
    robot = scara()
    end = np.array([0.5, -2.0, 2.0])
    x, y, _ = robot.tool_placement(end).translation
    path = [{"line": {"by": [-4.0, 0.0]}}]
    given = problem(
        robot,
        start="free",
        path_start=[x + 4.0, y],
        end={"joints": end.tolist()},
        path=path,
    )
    dead = ClosedFormLattice(decompositions_of(given)[0]).joint_paths(1)
    assert isinstance(dead, DeadEnd)
    assert dead.interval[0] == 0.0
    assert 0.0 < dead.interval[1] < 1.0
    assert str(dead).startswith("back from the end posture")
