"""Joint paths of moves, which prescribe only the postures at both ends."""

from __future__ import annotations

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.errors import TaskError
from brachis.kinematics import CHART, ChartRows, chart_around
from brachis.problem.problem import Problem
from brachis.search.phase_plane import least_time
from brachis.search.stages import InitialGuess

_STATIONS = 97
"""Number of postures along the joint path of a guess."""


def move_guesses(problem: Problem) -> list[InitialGuess]:
    """Find joint paths of a move between two given postures.

    Raises
    ------
    TaskError
        The start or end posture is missing.
    """
    for end in ("start", "end"):
        if end not in problem.given_postures:
            raise TaskError(
                "a move needs a start posture and an end posture",
                where=end,
                found="free",
                allowed="a posture",
            )
    return [guess_along(problem, np.array([problem.start, problem.end]), "line")]


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
