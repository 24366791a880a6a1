"""Random joint paths: on the path, from the given ends, within the ranges, and of use where the lattice has few."""

import numpy as np
import pytest

import brachis
from brachis.common.deadline import Deadline
from brachis.problem.problem import Problem
from brachis.search import guesses
from brachis.search.guesses import (
    SEARCH_LEVELS,
    chart_guesses,
    random_joint_paths,
)
from brachis.task import task_with

START = [0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.1]
END = [0.62, 0.62, 0.35, -1.1, 0.3, 0.8, 0.1]


def problem_of(**keys):
    line = {
        "start": START,
        "task_space": "position",
        "path": brachis.Line(by=[-0.1, 0.35, 0.2]),
    }
    return Problem.of(brachis.robots.iiwa14, task_with(**(line | keys)))


@pytest.mark.parametrize("given", ["start", "end", "start and end", "none"])
def test_they_are_on_the_path_from_given_ends_within_the_ranges(given):
    place, last = (
        brachis.robots.iiwa14.tool_placement(q).translation for q in (START, END)
    )
    free = {"start": "free", "path_start": [0.5, 0.1, 0.6]}
    by = np.array([0.0, 0.3, 0.0])
    back = {"path_start": place - by, "path": brachis.Line(by=by), "end": START}
    both = {"path": brachis.Line(by=last - place), "end": END}
    cases = {"start": {}, "end": free | back, "start and end": both, "none": free}
    problem = problem_of(**cases[given])
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
        assert (np.ptp(postures, axis=0).max() < 1e-3) == (name in given)


class LateLattice(Deadline):
    """A deadline of which every part is over at once."""

    def part(self, _share):
        return Deadline(0.0)


def test_they_are_tried_alone_where_the_lattice_has_no_time():
    level = SEARCH_LEVELS["fast"][0]
    problem = problem_of()
    found = chart_guesses(problem, [], level, LateLattice())
    assert found
    assert all(guess.origin.startswith("random") for guess in found)


def test_they_stand_beside_the_lattices_where_several_joints_are_redundant(
    monkeypatch,
):
    monkeypatch.setattr(guesses, "screen", lambda found, *_others: found)
    robot = brachis.robots.scara3
    ends = [[0.5, -2.1, 2.1], [0.3, -1.6, 2.0]]
    x, x_end = (robot.tool_placement(q).translation[0] for q in ends)
    task = task_with(
        start=ends[0],
        end=ends[1],
        task_space=["x"],
        path=brachis.Line(by=[x_end - x]),
    )
    found = chart_guesses(Problem.of(robot, task), [], SEARCH_LEVELS["fast"][0])
    assert {guess.origin.split()[0] for guess in found} == {"lattice", "random"}
    for guess in found:
        q = guess.joint_map.postures(guess.joint_path)
        np.testing.assert_allclose(q[[0, -1]], ends, atol=1e-8)
