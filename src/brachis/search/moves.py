"""Joint paths of moves, which prescribe only the postures at both ends."""

from __future__ import annotations

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import TaskError
from brachis.kinematics import CHART, ChartRows, chart_around
from brachis.problem.problem import Problem
from brachis.search.guesses import SCREENED, SearchLevel
from brachis.search.holding import explain_postures
from brachis.search.phase_plane import least_time
from brachis.search.sampled_paths import FreeSpace, sample_joint_path
from brachis.search.screening import screen_coarsely
from brachis.search.stages import InitialGuess

_ITERATIONS = 3000
"""Number of samples after which OMPL gives up."""
_STATIONS = 97
"""Number of postures along the joint path of a guess."""


def check_ends(problem: Problem) -> None:
    """Raise TaskError if the start or end posture of a move is missing."""
    for end in ("start", "end"):
        if end not in problem.given_postures:
            raise TaskError(
                "a move needs a start posture and an end posture",
                where=end,
                found="free",
                allowed="a posture",
            )


def move_guesses(
    problem: Problem, level: SearchLevel, deadline: Deadline, listener: Listener
) -> list[InitialGuess]:
    """Find joint paths of a move: the straight one, or if something is in its way, the most promising ones round it.

    Parameters
    ----------
    problem : Problem
        Problem with both postures.
    level : SearchLevel
    deadline : Deadline
    listener : callable

    Raises
    ------
    PathError
        No joint path is free.
    """
    straight = guess_along(problem, np.array([problem.start, problem.end]), "line")
    space = FreeSpace.of(problem)
    if space.joins(problem.start, problem.end):
        return [straight]
    guesses = []
    for seed in range(1, 1 + SCREENED * level.in_charts):
        listener(f"looking for a joint path round what is in the way ({seed})")
        q = sample_joint_path(problem, space, seed, _ITERATIONS, deadline)
        if q is not None:
            guesses.append(guess_along(problem, q, f"RRT-Connect {seed}"))
        elif not guesses:
            raise explain_postures([straight])
    count = max(1, level.in_charts // 2)
    return screen_coarsely(guesses, count, deadline, listener)


def guess_along(problem: Problem, q: np.ndarray, origin: str) -> InitialGuess:
    """Return the guess of a move along the joint path through postures, (S, n)."""
    steps = np.abs(np.diff(q, axis=0) / problem.robot.scales).max(axis=1)
    length = np.append(0.0, np.cumsum(steps))
    # A move between two equal postures has no length.
    s = length / length[-1] if length[-1] else np.linspace(0.0, 1.0, len(q))
    stations = np.union1d(s, np.linspace(0.0, 1.0, _STATIONS))
    postures = interpolate_columns(stations, s, q)
    rows = ChartRows.constant(np.eye(problem.robot.n))
    chart = chart_around(problem.task_map, problem.path, stations, postures, rows)
    estimate = least_time(problem, stations, postures)
    curves = chart.curves(stations, postures)
    return InitialGuess(problem, chart, curves, estimate, origin, CHART)
