"""Initial guesses: splines through a course of the redundant joints, a smooth s(t), a long enough t_E.

The end time is stretched until all limits hold, which gives the solver a feasible start wherever gravity leaves one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from brachis.bspline import basis_matrix
from brachis.errors import UnreachableError
from brachis.nlp.motion import Motion
from brachis.nlp.numeric_course import numeric_courses
from brachis.nlp.transcription import Transcription

_STRETCH = 1.1
_SHRINKAGE = 0.8
_SHORTEST_TIME, _LONGEST_TIME = 0.01, 200.0
_FIT_DENSITY = 4


def guesses(problem: Transcription) -> Iterator[np.ndarray]:
    """Yield starting points x whose every collocation point is reachable, the most natural first.

    Parameters
    ----------
    problem : Transcription

    Yields
    ------
    (v,) ndarray
    """
    for course in numeric_courses(problem.decomposition):
        x = starting_point(problem, course)
        if x is not None:
            yield x


def starting_point(problem: Transcription, course: np.ndarray) -> np.ndarray | None:
    """Fit splines to a course, and stretch the time until the limits hold.

    Control points taken from the course itself smooth it; where that leaves the branch, least squares follow it closer.

    Parameters
    ----------
    problem : Transcription
    course : (S, 1 + r) ndarray
        Successive values of s and the redundant joints.

    Returns
    -------
    (v,) ndarray or None
        None where the fit is out of reach at a collocation point.
    """
    tau = problem.splines[0].greville
    smooth = Motion(1.0, problem.knots, problem.degree, _timed(course, tau).T)
    dense = np.linspace(0.0, 1.0, _FIT_DENSITY * len(problem.knots))
    for x in (problem.variables_from(smooth), fitted(problem, 1.0, dense, _timed(course, dense))):
        with contextlib.suppress(UnreachableError):
            return stretched(problem, x)
    return None


def _timed(course: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Follow a course, (S, 1 + r), with a smooth motion from rest to rest: the places at `tau`, (K, 1 + r)."""
    u = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    grid = np.linspace(0.0, 1.0, len(course))
    return np.column_stack([np.interp(u, grid, column) for column in course.T])


def fitted(problem: Transcription, t_end: float, tau: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Point x whose curves come nearest to given values, by least squares; exact where the splines contain them.

    Parameters
    ----------
    problem : Transcription
    t_end : float
        s.
    tau : (K,) ndarray
        Normalised times.
    wanted : (K, 1 + r) ndarray
        Path coordinate and redundant joints there.

    Returns
    -------
    (v,) ndarray
    """
    basis = basis_matrix(problem.knots, problem.degree, tau).toarray()
    parts = [np.array([t_end])]
    for spline, values in zip(problem.splines, wanted.T, strict=True):
        tied = np.zeros((len(spline.variable), spline.free))
        kept = np.flatnonzero(spline.variable >= 0)
        tied[kept, spline.variable[kept]] = 1.0
        parts.append(np.linalg.lstsq(basis @ tied, values - basis @ spline.fixed, rcond=None)[0])
    parts.append(problem.grid.lengths_of(problem.knots))
    return np.clip(np.concatenate(parts), problem.x_lower, problem.x_upper)


def stretched(problem: Transcription, x: np.ndarray) -> np.ndarray:
    """Return x with t_E just so long that velocity, acceleration and torque limits hold, where any time does.

    Far above the least time no limit is active, and a solver that has seen no curvature creeps towards it.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    x = x.copy()
    while x[0] < _LONGEST_TIME:
        excess = worst_time_scaling_ratio(problem, x)
        if excess <= 1.0:
            break
        # Without gravity and friction, torque falls with the square of the time.
        x[0] *= _STRETCH * min(np.sqrt(excess), 8.0)
    shorter = x.copy()
    while shorter[0] > _SHORTEST_TIME:
        shorter[0] *= _SHRINKAGE
        if worst_time_scaling_ratio(problem, shorter) > 1.0:
            break
        x[0] = shorter[0]
    return x


def worst_time_scaling_ratio(problem: Transcription, x: np.ndarray) -> float:
    """Largest ratio to a limit that a longer time relieves, such as those of velocity, acceleration and torque."""
    return float(np.abs(problem.time_scaling_ratios(x)).max())
