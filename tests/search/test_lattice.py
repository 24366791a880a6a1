"""Joint paths on the lattice: on the path, continuous, within limits, different; reasons where there is none.

And lattices where ranges, turns, limits or paths are out of the ordinary.
"""

import itertools
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

import brachis
from brachis.errors import PathError, PlanningError
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot.from_task import robot_from_settings
from brachis.search.closed_form_lattice import ClosedFormLattice
from brachis.search.guesses import SEARCH_LEVELS, lattice_guesses
from brachis.search.joint_path import DeadEnd
from brachis.search.lattice import stations
from brachis.search.posture_lattice import PostureLattice
from support.joint_paths import check_joint_path
from support.scara import RANGES, START, scara
from support.scara import problem as scara_problem

ROOT = Path(__file__).parents[2]
RAIL = "03_tx90l_rail_line.yaml"


FREE = {
    "start": "free",
    "path_start": [math.sqrt(3.0), 0.0],
    "path": [{"line": {"length": 0.6, "angle_deg": 90}}],
    "redundant_joints": ["j1"],
}
LINE = {
    "start": {"joints": START},
    "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
}


def problem(robot, **changes):
    return scara_problem(robot, **(LINE | changes))


def content_of(name):
    return brachis.load_task(ROOT / "examples" / name).to_dict()


def problem_of(content):
    task = brachis.load_task(content)
    return Problem.of(robot_from_settings(task.robot), task)


CASES = {
    "planar": lambda: problem(scara()),
    "ranges": lambda: problem(scara(RANGES)),
    "free start": lambda: problem(
        scara(), start="free", path_start=[math.sqrt(3.0), 0.0]
    ),
    "rail": lambda: problem_of(content_of(RAIL) | {"redundant_joints": "auto"}),
    "two redundant": lambda: problem_of(content_of("06_free_roll.yaml")),
    "none redundant": lambda: problem(
        scara(locked_joints={"j3": 0.4}), start={"joints": START[:2]}
    ),
}


def courses_of(line_problem, count):
    """Joint paths of the first closed form."""
    return ClosedFormLattice(decompositions_of(line_problem)[0]).joint_paths(count)


@pytest.mark.parametrize("case", CASES)
def test_courses_are_motions_of_the_robot(case):
    line_problem = CASES[case]()
    count = 0
    for decomposition in decompositions_of(line_problem):
        joint_paths = ClosedFormLattice(decomposition).joint_paths(4)
        if isinstance(joint_paths, DeadEnd):
            continue
        count += len(joint_paths)
        solver = decomposition.match.solver
        for joint_path in joint_paths:
            check_joint_path(line_problem, joint_path, miss=1e-6, step=0.9)
            margins = solver.branch_margins(joint_path.q, joint_path.branch)
            assert margins.min(initial=1.0) > 0.0
            if line_problem.start is not None:
                np.testing.assert_allclose(
                    joint_path.q[0], line_problem.start, atol=1e-12
                )
        for first, second in itertools.combinations(joint_paths, 2):
            assert np.abs(first.q - second.q).max() > 0.05
    assert count >= (1 if case == "none redundant" else 3)


def test_the_shortest_course_comes_first_and_is_shorter_than_any_detour():
    (decomposition, *_) = decompositions_of(problem(scara(), redundant_joints=["j1"]))
    first, *others = ClosedFormLattice(decomposition).joint_paths(6)
    assert others
    assert all(other.length >= first.length for other in others)


REASONS = {
    "out of reach": (
        "{}",
        "path: [{line: {to: [4.0, 0.0]}}]",
        "it is out of reach",
        "out of reach from",
    ),
    "joint range": (
        "limits: {position: {j1: [0.3, 0.8], j2: [-2.2, -1.9]}}",
        "redundant_joints: [j1]",
        "the range of joint 'j",
        r"within the joint ranges .*joint 'j2' is 0.\d+ rad beyond its range, -2.2 to -1.9 rad",
    ),
    "gravity": (
        "{gravity: [0, -9.81, 0], limits: {torque: [280.0, 200.0, 100.0]}}",
        "path: [{line: {to: [2.8, 0.0]}}]",
        "the torque limit of j1 cannot hold",
        "the torque limit cannot hold",
    ),
}


@pytest.mark.parametrize("case", REASONS)
def test_why_there_is_no_course(case):
    options, changes, reason, message = REASONS[case]
    robot = scara(**yaml.safe_load(options))
    line_problem = problem(robot, **yaml.safe_load(changes))
    ends = [
        lattice_guesses(decomposition, SEARCH_LEVELS["fast"][0])
        for decomposition in decompositions_of(line_problem)
    ]
    assert all(isinstance(end, DeadEnd) for end in ends)
    of_all_postures = PostureLattice(line_problem, []).joint_paths(4)
    assert isinstance(of_all_postures, DeadEnd)
    for furthest in (max(ends, key=lambda end: end.s), of_all_postures):
        assert 0.0 < furthest.s <= 1.0
        assert reason in str(furthest)
    with pytest.raises(PathError, match=message) as caught:
        brachis.plan(line_problem.robot, line_problem.task, check_advice=False)
    assert caught.value.s_interval is not None


def test_a_narrow_range_of_the_redundant_joint_is_not_called_out_of_reach():
    """Half the path lies beyond what the arm reaches from the stretch of rail that is left to it."""
    task = content_of(RAIL)
    task["robot"]["limits"]["position"] = {"rail": [-0.01, 0.01]}
    task["path"] = [{"line": {"by": [0.0, 1.9, 0.0]}}]
    told = (
        r"within the joint ranges .*joint 'rail' .* beyond its range, -0.01 to 0.01 m"
    )
    with pytest.raises(PathError, match=told):
        brachis.plan(task)


def test_advice_names_what_was_kept_low():
    line_problem = problem(
        scara(),
        solver={"max_iterations": 1, "name": "uno"},
        redundant_joints=["j1"],
        spline={"intervals": 20},
    )
    with pytest.raises(
        PlanningError, match=r"Raise solver.max_iterations, which is 1$"
    ) as caught:
        brachis.plan(line_problem.robot, line_problem.task)
    assert "effort" not in str(caught.value)


@pytest.mark.parametrize("reach", [None, [-30.0, 30.0], [8.0, None]])
def test_a_free_start_on_a_long_rail(reach):
    """The path begins 20 m along it."""
    task = content_of(RAIL)
    robot = problem_of(task).robot
    end = robot.posture([0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1], "start")
    task |= back_from(end, robot, [0.0, -20.0, 0.0])
    task |= {"path": [{"line": {"by": [0.0, 0.8, 0.0]}}], "redundant_joints": ["rail"]}
    del task["end"]
    task["robot"]["limits"]["position"] = {"rail": reach}
    joint_paths = courses_of(problem_of(task), 2)
    assert not isinstance(joint_paths, DeadEnd)
    assert all(abs(joint_path.q[0, 0] - 20.0) < 3.0 for joint_path in joint_paths)


def test_both_branches_of_a_free_start():
    joint_paths = courses_of(problem(scara(), **FREE), 4)
    assert {joint_path.branch for joint_path in joint_paths} == {0, 1}


def test_a_free_start_that_no_torque_holds_says_so():
    weak = scara({"torque": 1.0}, gravity=[0, -9.81, 0])
    end = courses_of(problem(weak, **FREE), 1)
    assert isinstance(end, DeadEnd)
    assert end.s == 0.0
    assert "the torque limit of j1 cannot hold the arm against gravity" in end.cause


@pytest.mark.parametrize("turns, joints", [(4, ["j1"]), (30, ["j2"]), (30, ["j3"])])
def test_small_circles_have_stations_enough(turns, joints):
    path = [{"circle": {"center": [0.0, 0.0], "turns": turns}}]
    line_problem = problem(
        scara(), start={"joints": [0.5, -2.0, 1.7]}, path=path, redundant_joints=joints
    )
    assert len(stations(line_problem.path, line_problem.task_map)) > 24 * turns / 2
    assert not isinstance(courses_of(line_problem, 1), DeadEnd)


def test_an_end_posture_without_redundancy_may_have_few_digits():
    robot = scara(locked_joints={"j3": 0.4})
    path = [{"line": {"by": [-0.3, 0.2]}}]
    line = {"start": {"joints": [0.3, 0.9]}, "path": path}
    free = brachis.plan(robot, problem(robot, **line).task)
    end = free.trajectory.position(free.t_end).round(7).tolist()
    line_problem = problem(robot, **line, end={"joints": end})
    assert not isinstance(courses_of(line_problem, 1), DeadEnd)


def back_from(end, robot, by):
    """A task of a line that ends in a posture and may begin in any."""
    placement = robot.tool_placement(end)
    return {
        "start": "free",
        "path_start": {
            "position": (placement.translation - by).tolist(),
            "quaternion_xyzw": pin.Quaternion(placement.rotation).coeffs(),
        },
        "end": {"joints": end.tolist()},
        "path": [{"line": {"by": by}}],
        "redundant_joints": "auto",
        "branch": "auto",
    }


@pytest.mark.parametrize(
    "turned",
    [
        "{}",
        "shoulder_pan_joint: -1",
        "wrist_1_joint: 1",
        "wrist_3_joint: -1",
        "{shoulder_lift_joint: 1, wrist_2_joint: 1}",
        "{wrist_1_joint: 1, wrist_3_joint: -1}",
    ],
)
def test_a_free_start_is_in_the_turn_that_leads_to_the_end_posture(turned):
    """Ranges of two turns: whichever turns the end is in, every choice of redundant joints finds its way back."""
    task = content_of("04_ur10_rail_weld.yaml")
    robot = problem_of(task).robot
    end = np.array(task["start"]["joints"])
    for joint, turns in yaml.safe_load(turned).items():
        end[robot.joint_names.index(joint)] += 2.0 * math.pi * turns
    task |= back_from(end, robot, [0.0, 0.4, 0.0])
    decompositions = decompositions_of(problem_of(task))
    assert len(decompositions) == 4
    for decomposition in decompositions:
        joint_paths = ClosedFormLattice(decomposition).joint_paths(2)
        assert not isinstance(joint_paths, DeadEnd)
        for joint_path in joint_paths:
            assert np.abs(joint_path.q[-1] - end).max() < 1e-9


def test_a_motion_planned_one_way_is_found_the_other_way_round():
    task = content_of("04_ur10_rail_weld.yaml")
    robot = problem_of(task).robot
    begin = np.array(task["start"]["joints"])
    begin[robot.joint_names.index("wrist_1_joint")] += 2.0 * math.pi
    task |= yaml.safe_load("""
    redundant_joints: [rail]
    path: [{line: {by: [0.0, -0.4, 0.0]}}]
    search: {effort: single}
    """)
    forwards = brachis.plan(task | {"start": {"joints": begin.tolist()}})
    back = brachis.plan(
        task | back_from(begin, robot, [0.0, 0.4, 0.0]) | {"redundant_joints": ["rail"]}
    )
    assert forwards.verified
    assert back.verified
    assert back.t_end == pytest.approx(forwards.t_end, rel=2e-3)


def test_a_dead_end_back_from_the_end_says_so():
    robot = scara()
    end = np.array([0.5, -2.0, 2.0])
    x, y, _ = robot.tool_placement(end).translation
    path = [{"line": {"by": [-4.0, 0.0]}}]
    line_problem = problem(
        robot,
        start="free",
        path_start=[x + 4.0, y],
        end={"joints": end.tolist()},
        path=path,
    )
    dead = courses_of(line_problem, 1)
    assert isinstance(dead, DeadEnd)
    assert dead.interval[0] == 0.0
    assert 0.0 < dead.interval[1] < 1.0
    assert str(dead).startswith("back from the end posture")
