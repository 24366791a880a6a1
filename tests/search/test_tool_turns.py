"""Quick turns of the tool: stations follow them, so that lattices do; out of reach is only what is."""

import numpy as np
import pytest

import brachis
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot.from_task import robot_for
from brachis.search.closed_form_lattice import ClosedFormLattice
from brachis.search.joint_path import NO_ANSWER, DeadEnd, reaches
from brachis.search.posture_lattice import PostureLattice
from brachis.task import task_with
from support.effort import QUICK

TURNS = [
    ("tx90l_rail", [0.6, -0.2, 0.5], [180, 0, 0], [0, 0.4, 0], [0, 0, 1], 120.0, 0.01),
    ("tx90l_rail", [0.6, -0.2, 0.5], [180, 0, 0], [0, 0.4, 0], [0, 0, 1], -178.0, 0.01),
    ("ur10_rail", [0.5, -0.1, 0.6], [180, 0, 0], [0, 0.2, 0], [0.3, 0, 1], 90.0, 0.005),
    ("iiwa14", [0.5, -0.1, 0.4], [180, 0, 0], [0.1, 0.2, 0], [0, 0, 1], 100.0, 0.02),
]
"""Robot, beginning, direction of the line with its length, axis and angle of the turn, and the length it takes, m."""


def task(robot, position, turned, line, axis, angle, length):
    line = np.array(line)
    share = length / np.linalg.norm(line)
    parts = ((0.5 - 0.5 * share, 10.0), (share, angle), (0.5 - 0.5 * share, 10.0))
    segments = [
        {
            "line": {"by": part * line},
            "orientation": {"rotate": {"axis": axis, "angle_deg": turn}},
            "blend": 0.2 * length,
        }
        for part, turn in parts
    ]
    del segments[-1]["blend"]
    return task_with(
        robot={"urdf": robot},
        start="free",
        path_start={"position": position, "rpy_deg": turned},
        task_space="pose",
        path=segments,
        **QUICK,
    )


def problem(case):
    asked = task(*case)
    return Problem.of(robot_for(None, asked.robot), asked)


@pytest.mark.parametrize("case", TURNS)
def test_lattices_follow_quick_turns(case):
    given = problem(case)
    (first, *_) = decompositions_of(given)
    lattices = [ClosedFormLattice(first)]
    if case is TURNS[0]:
        lattices.append(PostureLattice(given, [first]))
    for lattice in lattices:
        found = lattice.joint_paths(1)
        assert not isinstance(found, DeadEnd), str(found)
        limits = given.robot.limits
        assert np.all(found[0].q >= limits.position_lower - 1e-6)
        assert np.all(found[0].q <= limits.position_upper + 1e-6)
        assert np.abs(np.diff(found[0].q, axis=0)).max() <= 0.8


def test_a_quick_turn_has_a_plan():
    assert brachis.plan(task(*TURNS[0]), intervals=12).verified


def test_a_lattice_that_is_too_coarse_does_not_say_out_of_reach():
    given = problem(TURNS[1])
    (first, *_) = decompositions_of(given)
    found = PostureLattice(given, [first], density=0.02).joint_paths(1)
    assert isinstance(found, DeadEnd)
    assert found.cause != NO_ANSWER
    assert reaches(given, found.s)
