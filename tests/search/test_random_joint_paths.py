"""Random joint paths: on the path, from the given ends, within the ranges, and of use where the lattice has few."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brachis.common.deadline import Deadline
from brachis.problem.problem import Problem
from brachis.robot import Robot
from brachis.search.guesses import (
    SEARCH_LEVELS,
    chart_guesses,
    random_joint_paths,
)
from brachis.task import load_task

URDF = Path(__file__).parents[2] / "robots/iiwa14/robot.urdf"
START = [0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.1]


def problem_of(**keys) -> Problem:
    task = load_task(
        {
            "brachis": 1,
            "robot": {"urdf": str(URDF)},
            "start": {"joints": START},
            "task_space": "position",
            "path": [{"line": {"by": [-0.1, 0.35, 0.2]}}],
            **keys,
        }
    )
    return Problem.of(Robot.from_urdf(URDF), task)


@pytest.mark.parametrize("given", ["start", "end", "none"])
def test_they_are_on_the_path_from_given_ends_within_the_ranges(given):
    robot = Robot.from_urdf(URDF)
    place = robot.tool_placement(np.array(START)).translation
    free = {"start": "free", "path_start": [0.5, 0.1, 0.6]}
    back = {
        "path_start": (place - [0.0, 0.3, 0.0]).tolist(),
        "path": [{"line": {"by": [0.0, 0.3, 0.0]}}],
        "end": {"joints": START},
    }
    problem = problem_of(**{"start": {}, "end": free | back, "none": free}[given])
    found = random_joint_paths(problem, 12)
    assert 6 <= len(found) <= 12
    for each in found:
        assert (each.q >= problem.robot.limits.position_lower).all()
        assert (each.q <= problem.robot.limits.position_upper).all()
        targets = problem.path.sample(each.s).target
        np.testing.assert_allclose(problem.task_map.values(each.q), targets, atol=1e-8)
        assert np.abs(np.diff(each.q, axis=0)).max() < 0.8
    ends = {"start": 0, "end": -1}
    for name, place in ends.items():
        postures = np.array([each.q[place] for each in found])
        is_same = np.ptp(postures, axis=0).max() < 1e-6
        assert is_same == (name == given)


class LateLattice(Deadline):
    """A deadline of which every part is over at once."""

    def part(self, _share: float) -> Deadline:
        return Deadline(0.0)


def test_they_are_tried_alone_where_the_lattice_has_no_time():
    level = SEARCH_LEVELS["fast"][0]
    problem = problem_of()
    guesses = chart_guesses(problem, [], level, LateLattice())
    assert guesses
    assert all(guess.origin.startswith("random") for guess in guesses)
