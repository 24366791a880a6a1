"""Joint paths on the lattice: on the path, continuous, within limits, different; reasons where there is none."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brachis
from brachis.common.deadline import NEVER
from brachis.errors import PathError, PlanningError
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot import dynamics
from brachis.robot.from_task import robot_from_settings
from brachis.search.closed_form_lattice import ClosedFormLattice
from brachis.search.failure import explain_no_motion
from brachis.search.guesses import SEARCH_LEVELS, lattice_guesses
from brachis.search.joint_path import DeadEnd
from support.pose_arms import panda

ROOT = Path(__file__).parents[2]
START = [math.pi / 6, -2 * math.pi / 3, 2 * math.pi / 3]


def scara(limits: dict[str, Any] | None = None, **options: Any) -> brachis.Robot:
    spec = brachis.LimitSpec(**({"torque": 10.0, "velocity": None} | (limits or {})))
    return brachis.Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf",
        limits=spec,
        **({"gravity": [0, 0, 0]} | options),
    )


def problem(robot: brachis.Robot, **changes: Any) -> Problem:
    task = {
        "brachis": 1,
        "start": {"joints": START},
        "task_space": ["x", "y"],
        "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
    }
    return Problem.of(robot, brachis.load_task(task | changes))


def example(name: str, **changes: Any) -> Problem:
    task = brachis.load_task(
        brachis.load_task(ROOT / "examples" / name).to_dict() | changes
    )
    return Problem.of(robot_from_settings(task.robot), task)


CASES = {
    "planar": lambda: problem(scara()),
    "ranges": lambda: problem(
        scara({"position": {"j1": [-0.5, 1.5], "j2": [-3.0, 0.0], "j3": [0.0, 3.5]}})
    ),
    "free start": lambda: problem(
        scara(), start="free", path_start=[math.sqrt(3.0), 0.0]
    ),
    "rail": lambda: example("03_tx90l_rail_line.yaml", redundant_joints="auto"),
    "two redundant": lambda: example("06_free_roll.yaml"),
    "none redundant": lambda: problem(
        scara(locked_joints={"j3": 0.4}), start={"joints": START[:2]}
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_courses_are_motions_of_the_robot(case):
    given = CASES[case]()
    robot, limits = given.robot, given.robot.limits
    found = 0
    for decomposition in decompositions_of(given):
        joint_paths = ClosedFormLattice(decomposition).joint_paths(4)
        if isinstance(joint_paths, DeadEnd):
            continue
        found += len(joint_paths)
        for joint_path in joint_paths:
            targets = given.path.sample(joint_path.s).target
            miss = given.task_map.difference(
                given.task_map.values(joint_path.q), targets
            )
            assert np.abs(miss).max() < 1e-6
            assert np.abs(np.diff(joint_path.q, axis=0)).max() < 0.9
            assert np.all(joint_path.q >= limits.position_lower - 1e-9)
            assert np.all(joint_path.q <= limits.position_upper + 1e-9)
            still = np.zeros_like(joint_path.q)
            assert np.all(
                np.abs(dynamics.torque(robot, joint_path.q, still, still))
                <= limits.torque
            )
            margins = decomposition.match.solver.branch_margins(
                joint_path.q, joint_path.branch
            )
            assert margins.min(initial=1.0) > 0.0
            if given.start is not None:
                np.testing.assert_allclose(joint_path.q[0], given.start, atol=1e-12)
        stations = [joint_path.q for joint_path in joint_paths]
        assert all(
            np.abs(a - b).max() > 0.05
            for i, a in enumerate(stations)
            for b in stations[:i]
        )
    assert found >= 3 or case == "none redundant"
    assert found


def test_the_shortest_course_comes_first_and_is_shorter_than_any_detour():
    (decomposition, *_) = decompositions_of(problem(scara(), redundant_joints=["j1"]))
    first, *others = ClosedFormLattice(decomposition).joint_paths(6)
    assert others
    assert all(other.length >= first.length for other in others)


def test_an_end_posture_is_reached():
    free = ClosedFormLattice(
        decompositions_of(problem(scara(), redundant_joints=["j1"]))[0]
    ).joint_paths(3)
    end = free[-1].q[-1]
    given = problem(scara(), redundant_joints=["j1"], end={"joints": end})
    joint_paths = ClosedFormLattice(decompositions_of(given)[0]).joint_paths(3)
    assert all(np.abs(joint_path.q[-1] - end).max() < 0.2 for joint_path in joint_paths)


def test_lifts_follow_the_course():
    """Three turns about the base: the joint leaves (-pi, pi]."""
    arm = scara(locked_joints={"j3": 0.4})
    given = problem(
        arm,
        start={"joints": [0.3, 0.9]},
        path=[{"circle": {"center": [0.0, 0.0], "turns": 3}}],
    )
    (joint_path,) = ClosedFormLattice(decompositions_of(given)[0]).joint_paths(1)
    assert joint_path.q[-1, 0] - joint_path.q[0, 0] == pytest.approx(
        6 * math.pi, abs=1e-6
    )


REASONS = {
    "out of reach": (
        {},
        {"path": [{"line": {"to": [4.0, 0.0]}}]},
        "it is out of reach",
        "out of reach from",
    ),
    "joint range": (
        {"limits": {"position": {"j1": [0.3, 0.8], "j2": [-2.2, -1.9]}}},
        {"redundant_joints": ["j1"]},
        "the range of joint 'j2' ends",
        r"within the joint ranges .*joint 'j2' 0.\d+ rad beyond its range, -2.2 to -1.9 rad",
    ),
    "gravity": (
        {"gravity": [0, -9.81, 0], "limits": {"torque": [280.0, 200.0, 100.0]}},
        {"path": [{"line": {"to": [2.8, 0.0]}}]},
        "the torque limit of j1 cannot hold",
        "the torque limit cannot hold",
    ),
}


@pytest.mark.parametrize("case", REASONS)
def test_why_there_is_no_course(case):
    options, changes, reason, message = REASONS[case]
    given = problem(scara(**options), **changes)
    ends = [
        lattice_guesses(decomposition, SEARCH_LEVELS["fast"][0])
        for decomposition in decompositions_of(given)
    ]
    assert all(isinstance(end, DeadEnd) for end in ends)
    furthest = max(ends, key=lambda end: end.s)
    assert 0.0 < furthest.s <= 1.0
    assert reason in str(furthest)
    with pytest.raises(PathError, match=message) as caught:
        brachis.plan(given.robot, given.task, check_advice=False)
    assert caught.value.s_interval is not None


def test_a_narrow_range_of_the_redundant_joint_is_not_called_out_of_reach():
    """Half the path lies beyond what the arm reaches from the stretch of rail that is left to it."""
    task = brachis.load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict()
    task["robot"]["limits"]["position"] = {"rail": [-0.01, 0.01]}
    task["path"] = [{"line": {"by": [0.0, 1.9, 0.0]}}]
    with pytest.raises(
        PathError,
        match=r"within the joint ranges .*joint 'rail' .* beyond its range, -0.01 to 0.01 m",
    ):
        brachis.plan(task)


def test_advice_names_what_was_kept_low():
    given = problem(
        scara(),
        solver={"max_iterations": 1, "name": "uno"},
        redundant_joints=["j1"],
        spline={"intervals": 20},
    )
    with pytest.raises(
        PlanningError, match=r"Raise solver.max_iterations, which is 1$"
    ) as caught:
        brachis.plan(given.robot, given.task)
    assert "effort" not in str(caught.value)


def test_what_eaik_might_add_is_said_where_it_is_missing(monkeypatch):
    """With another redundant joint the motion might go on."""
    monkeypatch.setattr("brachis.ik.eaik.is_installed", lambda: False)
    task = {
        "start": {"joints": [0.3, -0.5, 0.2, -2.2, 0.3, 1.9, 0.8]},
        "task_space": "pose",
    }
    given = problem(panda(), path=[{"line": {"by": [0.0, 0.05, 0.0]}}], **task)
    dead_ends = {"panda_joint4": DeadEnd(0.4, "the branch ends")}
    reason = explain_no_motion(given, decompositions_of(given), [], dead_ends, NEVER)
    assert isinstance(reason, PathError)
    assert "EAIK is not installed" in str(reason)
    assert "[panda_joint5], [panda_joint6]" in str(reason)
