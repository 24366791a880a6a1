"""Random joint paths: on the path, from the given ends, within the ranges, and of use where the lattice has few."""

import numpy as np
import pytest

import brachis
from brachis.common.deadline import Deadline
from brachis.problem.problem import Problem
from brachis.search.guesses import (
    SEARCH_LEVELS,
    chart_guesses,
    random_joint_paths,
)
from brachis.task import task_with

START = [0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.1]


def problem_of(**keys):
    line = {
        "start": START,
        "task_space": "position",
        "path": brachis.Line(by=[-0.1, 0.35, 0.2]),
    }
    return Problem.of(brachis.robots.iiwa14, task_with(**(line | keys)))


@pytest.mark.parametrize("end", ["start", "end", "none"])
def test_they_are_on_the_path_from_given_ends_within_the_ranges(end):
    place = brachis.robots.iiwa14.tool_placement(START).translation
    free = {"start": "free", "path_start": [0.5, 0.1, 0.6]}
    by = np.array([0.0, 0.3, 0.0])
    back = {"path_start": place - by, "path": brachis.Line(by=by), "end": START}
    problem = problem_of(**{"start": {}, "end": free | back, "none": free}[end])
    joint_paths = random_joint_paths(problem, 12)
    assert 6 <= len(joint_paths) <= 12
    limits = problem.robot.limits
    for joint_path in joint_paths:
        q = joint_path.q
        assert (q >= limits.position_lower).all()
        assert (q <= limits.position_upper).all()
        targets = problem.path.sample(joint_path.s).target
        np.testing.assert_allclose(problem.task_map.values(q), targets, atol=1e-8)
        assert np.abs(np.diff(q, axis=0)).max() < 0.8
    for name, row in (("start", 0), ("end", -1)):
        postures = np.array([joint_path.q[row] for joint_path in joint_paths])
        assert (np.ptp(postures, axis=0).max() < 1e-6) == (name == end)


class LateLattice(Deadline):
    """A deadline of which every part is over at once."""

    def part(self, _share):
        return Deadline(0.0)


def test_they_are_tried_alone_where_the_lattice_has_no_time():
    level = SEARCH_LEVELS["fast"][0]
    problem = problem_of()
    guesses = chart_guesses(problem, [], level, LateLattice())
    assert guesses
    assert all(guess.origin.startswith("random") for guess in guesses)
