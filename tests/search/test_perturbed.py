"""Joint paths around others: from the given ends, within the ranges, and of use where the lattice has few."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brachis.problem.problem import Problem, decompositions_of
from brachis.robot import Robot
from brachis.search import starts as module
from brachis.search.joint_path import JointPath
from brachis.search.starts import SEARCH_LEVELS, perturb
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


def straight(problem: Problem) -> JointPath:
    s = np.linspace(0.0, 1.0, 9)
    return JointPath(problem, s, np.array(START) + s[:, None] * 0.2, 1.0)


@pytest.mark.parametrize("given", ["start", "none"])
def test_given_ends_stay_and_ranges_are_kept(given):
    place = {} if given == "start" else {"start": "free", "path_start": [0.5, 0.1, 0.6]}
    problem = problem_of(**place)
    one = straight(problem)
    found = perturb([one], 12, 0)
    moved = np.array([each.q - one.q for each in found])
    assert len(found) == 12
    assert (np.abs(moved[:, 0]).max() == 0.0) == (given == "start")
    assert np.abs(moved[:, -1]).max() > 0.01
    for each in found:
        assert (each.q >= problem.robot.limits.position_lower).all()
        assert (each.q <= problem.robot.limits.position_upper).all()
    sizes = np.abs(moved[:, 4]).max(axis=1)
    assert 0.0 < sizes.min() < 0.3 * sizes.max()


def test_they_are_the_same_for_the_same_seed():
    one = straight(problem_of())
    first, again, other = (
        np.array([each.q for each in perturb([one], 3, seed)]) for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.01


def test_they_are_looked_at_where_both_ends_are_given(monkeypatch):
    """The lattice ends in one node there, and has few joint paths."""
    monkeypatch.setattr(module, "screen", lambda starts, *_others: starts)
    end = [0.62, 0.62, 0.35, -1.1, 0.3, 0.8, 0.1]
    robot = Robot.from_urdf(URDF)
    places = [
        robot.tool_placement(np.array(posture)).translation for posture in (START, end)
    ]
    problem = problem_of(
        end={"joints": end}, path=[{"line": {"by": (places[1] - places[0]).tolist()}}]
    )
    (level,) = SEARCH_LEVELS["fast"]
    starts = module.chart_starts(problem, decompositions_of(problem), level)
    assert isinstance(starts, list)
    assert any(start.origin.startswith("perturbed") for start in starts)
    for start in starts:
        q = start.joint_map.postures(start.joint_path)
        np.testing.assert_allclose(q[[0, -1]], [START, end], atol=1e-8)
