"""Initial guesses: splines through a joint path, a smooth s(t), a long enough time.

The end time is scaled until all limits hold, which gives the solver a feasible start wherever gravity leaves one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np

from brachis.bspline import basis_matrix
from brachis.errors import UnreachableError
from brachis.nlp.motion import Motion
from brachis.nlp.phase import Phase
from brachis.nlp.program import Program

_STRETCH = 1.1
_SHRINKAGE = 0.8
_SHORTEST_TIME, _LONGEST_TIME = 0.01, 200.0
_FIT_DENSITY = 4


def starting_point(program: Program, joint_paths: Sequence[np.ndarray]) -> np.ndarray | None:
    """Fit splines to a joint path of every phase, and scale the time until the limits hold.

    Control points taken from the joint path itself smooth it; where that leaves the branch, least squares follow it
    closer.

    Parameters
    ----------
    program : Program
    joint_paths : sequence of (S, c) ndarray
        For each phase, successive values of its curves: along a path of s and the redundant joints.

    Returns
    -------
    (v,) ndarray or None
        None where the fit is out of reach at a collocation point.
    """
    pairs = list(zip(program.phases, joint_paths, strict=True))
    for fit in (_smoothed, _followed):
        with contextlib.suppress(UnreachableError):
            return shortest_time(program, np.concatenate([fit(phase, joint_path) for phase, joint_path in pairs]))
    return None


def _smoothed(phase: Phase, joint_path: np.ndarray) -> np.ndarray:
    timed = _timed(phase, joint_path, phase.splines[0].greville)
    return phase.variables_from(Motion(_duration(phase), phase.knots, phase.degree, timed.T))


def _followed(phase: Phase, joint_path: np.ndarray) -> np.ndarray:
    t_norm = np.linspace(0.0, 1.0, _FIT_DENSITY * len(phase.knots))
    return fitted(phase, _duration(phase), t_norm, _timed(phase, joint_path, t_norm))


def _rates(phase: Phase) -> tuple[float, float]:
    """Rates of the first curve at both ends, 1/s."""
    ends = phase.boundary.start_rates, phase.boundary.end_rates
    first, last = (0.0 if rates is None else float(rates[0]) for rates in ends)
    return first, last


def _duration(phase: Phase) -> float:
    """Duration of a first guess, s: that of a constant acceleration from one end's speed to the other's."""
    total = sum(_rates(phase))
    return 2.0 / total if total else 1.0


def _closed(phase: Phase, joint_path: np.ndarray) -> np.ndarray:
    """Let the joint path of a periodic motion end as far ahead of its start as it has to, by an even drift."""
    if not phase.boundary.periodic:
        return joint_path
    ahead = np.nan_to_num(phase.boundary.end - phase.boundary.start)
    part = np.linspace(0.0, 1.0, len(joint_path))[:, None]
    return joint_path + part * (ahead - (joint_path[-1] - joint_path[0]))


def _timed(phase: Phase, joint_path: np.ndarray, t_norm: np.ndarray) -> np.ndarray:
    """Follow a joint path, (S, c), smoothly: the places at `t_norm`, (K, c)."""
    grid = np.linspace(0.0, 1.0, len(joint_path))
    u = guessed_progress(t_norm, *_rates(phase))
    return np.column_stack([np.interp(u, grid, column) for column in _closed(phase, joint_path).T])


def guessed_progress(t_norm: np.ndarray, first: float, last: float) -> np.ndarray:
    """Return how far along a joint path, from 0 to 1, a first guess is at normalised times.

    From rest to rest it is smooth; between other speeds, in whatever unit, the acceleration is constant.
    """
    if first == last == 0.0:
        return t_norm**3 * (10.0 - 15.0 * t_norm + 6.0 * t_norm**2)
    return t_norm * (2.0 * first + (last - first) * t_norm) / (first + last)


def fitted(phase: Phase, duration: float, t_norm: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Point x whose curves come nearest to given values, by least squares; exact where the splines contain them.

    Parameters
    ----------
    phase : Phase
    duration : float
        s.
    t_norm : (K,) ndarray
        Normalised times.
    wanted : (K, c) ndarray
        Values of the curves there.

    Returns
    -------
    (v,) ndarray
    """
    basis = basis_matrix(phase.knots, phase.degree, t_norm)
    parts = [np.array([duration])]
    for spline, values in zip(phase.splines, wanted.T, strict=True):
        given = basis @ (spline.fixed + duration * spline.rate)
        parts.append(np.linalg.lstsq(basis @ spline.matrix, values - given, rcond=None)[0])
    parts.append(phase.grid.lengths_of(phase.knots))
    return np.clip(np.concatenate(parts), phase.x_lower, phase.x_upper)


def shortest_time(program: Program, x: np.ndarray) -> np.ndarray:
    """Scale the time until velocity, acceleration and torque limits just hold, where any time does.

    Far above the least time no limit is active, and a solver that has seen no curvature creeps towards it.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    while program.end_time(x) < _LONGEST_TIME:
        worst = worst_time_scaling_ratio(program, x)
        if worst <= 1.0:
            break
        # Without gravity and friction, torque falls with the square of the time.
        x = program.time_scaled(x, _STRETCH * min(np.sqrt(worst), 8.0))
    shorter = x
    while program.end_time(shorter) > _SHORTEST_TIME:
        shorter = program.time_scaled(shorter, _SHRINKAGE)
        if worst_time_scaling_ratio(program, shorter) > 1.0:
            break
        x = shorter
    return x


def worst_time_scaling_ratio(program: Program, x: np.ndarray) -> float:
    """Largest ratio to a limit that a longer time relieves, such as those of velocity, acceleration and torque."""
    return float(max(np.abs(phase.time_scaling_ratios(part)).max() for phase, part in program.split(x)))
