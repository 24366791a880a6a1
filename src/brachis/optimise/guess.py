"""Initial guesses: splines through a joint path, a smooth s(t), a long enough time.

The end time is scaled until all limits hold, which gives the solver a feasible start wherever gravity leaves one.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.bspline import basis_matrix, spread
from brachis.optimise.phase import Motion, Phase
from brachis.optimise.program import Program

_STRETCH = 1.1
_SHRINKAGE = 0.8
_SHORTEST_TIME = 0.01
_LONGEST_TIME = 200.0
_FIT_DENSITY = 4
_MISSED = 0.1
"""Part of a least speed that a fit may miss."""

TimeLaw = Callable[[np.ndarray], np.ndarray]
"""Which part of a joint path is passed at normalised times."""


def starting_point(
    program: Program,
    joint_paths: Sequence[np.ndarray],
    duration: float | None = None,
    *,
    keep: bool = False,
) -> np.ndarray | None:
    """Fit splines to a joint path of every phase, and scale the time until the limits hold.

    Control points taken from the joint path itself smooth it; where that leaves the branch, least squares follow it
    closer.

    Parameters
    ----------
    program : Program
    joint_paths : sequence of (S, c) ndarray
        For each phase, successive values of its curves: along a path of s and the redundant joints.
    duration : float, optional
        Of the motions whose values at even times these are, s; otherwise they get smooth ones from end to end.
    keep : bool, optional
        Whether the duration stays, whatever other limits say, where the fit is fast enough for least speeds: a longer
        one would miss them. Splines of few intervals may be too slow anyway.

    Returns
    -------
    (v,) ndarray or None
        None where the fit is out of reach at a collocation point.
    """
    pairs = list(zip(program.phases, joint_paths, strict=True))
    for paced, fit in itertools.product(
        (True, False) if keep else (False,), (_smoothed, _followed)
    ):
        with contextlib.suppress(UnreachableError):
            parts = [
                fit(phase, _closed(phase, joint_path), duration)
                for phase, joint_path in pairs
            ]
            x = np.concatenate(parts)
            if not paced:
                return shortest_time(program, x)
            if _fast_enough(program, x):
                return x
    return None


def _fast_enough(program: Program, x: np.ndarray) -> bool:
    """Tell whether no least speed is missed by much."""
    missed = [
        phase.evaluate(part).violation(lambda limit: limit.longer_time == "violates")
        for phase, part in program.split(x)
    ]
    return bool(max(own.max(initial=0.0) for own in missed) <= _MISSED)


def _smoothed(
    phase: Phase, joint_path: np.ndarray, duration: float | None
) -> np.ndarray:
    points = _values(joint_path, _law(phase, duration)(phase.splines[0].greville))
    return phase.variables_from(
        Motion(_first_duration(phase, duration), phase.knots, phase.degree, points.T)
    )


def _followed(
    phase: Phase, joint_path: np.ndarray, duration: float | None
) -> np.ndarray:
    t_norm = spread(phase.breaks, _FIT_DENSITY)
    return fit_curves(
        phase,
        _first_duration(phase, duration),
        t_norm,
        _values(joint_path, _law(phase, duration)(t_norm)),
    )


def _rates(phase: Phase) -> tuple[float, float]:
    """Rates of the first curve at both ends, 1/s."""
    ends = phase.boundary.start_rates, phase.boundary.end_rates
    first, last = (0.0 if rates is None else float(rates[0]) for rates in ends)
    return first, last


def _first_duration(phase: Phase, duration: float | None) -> float:
    """Duration of a fit, s: as given, or that of a constant acceleration between moving ends; 1 from rest to rest."""
    total = sum(_rates(phase))
    return duration or (2.0 / total if total else 1.0)


def _law(phase: Phase, duration: float | None) -> TimeLaw:
    """Tell which part of a joint path is passed when: even parts of a motion's own, otherwise a smooth motion.

    From rest to rest that is smooth; between other speeds the acceleration is constant.
    """
    first, last = _rates(phase)
    if duration is not None:
        return lambda t_norm: t_norm
    if first == last == 0.0:
        return lambda t_norm: t_norm**3 * (10.0 - 15.0 * t_norm + 6.0 * t_norm**2)
    return lambda t_norm: (
        t_norm * (2.0 * first + (last - first) * t_norm) / (first + last)
    )


def _closed(phase: Phase, joint_path: np.ndarray) -> np.ndarray:
    """Let the joint path of a periodic motion end as far ahead of its start as it has to, by an even drift."""
    if not phase.boundary.periodic:
        return joint_path
    ahead = np.nan_to_num(phase.boundary.end - phase.boundary.start)
    part = np.linspace(0.0, 1.0, len(joint_path))[:, None]
    return joint_path + part * (ahead - (joint_path[-1] - joint_path[0]))


def _values(joint_path: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Values (K, c) of a joint path, (S, c), at places from 0 to 1, (K,)."""
    grid = np.linspace(0.0, 1.0, len(joint_path))
    return np.column_stack([np.interp(places, grid, column) for column in joint_path.T])


def fit_curves(
    phase: Phase, duration: float, t_norm: np.ndarray, wanted: np.ndarray
) -> np.ndarray:
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
        parts.append(
            np.linalg.lstsq(basis @ spline.matrix, values - given, rcond=None)[0]
        )
    parts.append(phase.grid.lengths_of(phase.knots))
    return np.clip(np.concatenate(parts), phase.x_lower, phase.x_upper)


def shortest_time(program: Program, x: np.ndarray) -> np.ndarray:
    """Scale the time until velocity, acceleration and torque limits just hold, or are exceeded least if they cannot.

    Far above the least time no limit is active, and a solver that has seen no curvature creeps towards it. Where an arm
    passes postures that it cannot hold, long times do not hold the limits either, and between ends in motion they are
    slower on the way alone.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    best = x
    least = np.inf
    while program.end_time(x) < _LONGEST_TIME:
        worst = worst_time_scaling_ratio(program, x)
        if worst <= 1.0:
            break
        if worst >= least:
            return best
        best = x
        least = worst
        # Without gravity and friction, torque falls with the square of the time.
        x = program.with_time_scaled(x, _STRETCH * min(np.sqrt(worst), 8.0))
    else:
        return best
    shorter = x
    while program.end_time(shorter) > _SHORTEST_TIME:
        shorter = program.with_time_scaled(shorter, _SHRINKAGE)
        if worst_time_scaling_ratio(program, shorter) > 1.0:
            break
        x = shorter
    return x


def worst_time_scaling_ratio(program: Program, x: np.ndarray) -> float:
    """Largest ratio to a limit that a longer time relieves, such as those of velocity, acceleration and torque."""
    return float(
        max(
            np.abs(phase.time_scaling_ratios(part)).max()
            for phase, part in program.split(x)
        )
    )
