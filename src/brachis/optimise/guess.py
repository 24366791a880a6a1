"""Initial guesses: splines through a joint path, a smooth s(t), a long enough time.

The end time is scaled until all limits hold, which gives the solver a feasible start wherever gravity leaves one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.bspline import basis_matrix, spread
from brachis.optimise.phase import Motion, Phase
from brachis.optimise.program import Program


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
    for is_timed in (True, False) if keep else (False,):
        for fit in (_smooth, _follow):
            with contextlib.suppress(UnreachableError):
                x = np.concatenate([fit(*pair, duration) for pair in pairs])
                if not is_timed:
                    return shortest_time(program, x)
                if _is_fast_enough(program, x):
                    return x
    return None


def _is_fast_enough(program: Program, x: np.ndarray) -> bool:
    """Tell whether no least speed is missed by more than a tenth."""
    missed = [
        phase.evaluate(part).violation(lambda limit: limit.longer_time == "violates")
        for phase, part in program.split(x)
    ]
    return bool(max(own.max(initial=0.0) for own in missed) <= 0.1)


def _smooth(phase: Phase, joint_path: np.ndarray, duration: float | None) -> np.ndarray:
    """Take control points from the joint path."""
    t_norm = phase.splines[0].greville
    t_end, points = _motion_along(phase, joint_path, duration, t_norm)
    return phase.variables_from(Motion(t_end, phase.knots, phase.degree, points.T))


def _follow(phase: Phase, joint_path: np.ndarray, duration: float | None) -> np.ndarray:
    """Fit curves to the joint path."""
    t_norm = spread(phase.breaks, 4)
    t_end, wanted = _motion_along(phase, joint_path, duration, t_norm)
    return fit_curves(phase, t_end, t_norm, wanted)


def _motion_along(
    phase: Phase, joint_path: np.ndarray, duration: float | None, t_norm: np.ndarray
) -> tuple[float, np.ndarray]:
    """Duration, s, and values (K, c) at normalised times, (K,), of a motion along a joint path, (S, c).

    A path with a duration has its values at even times. Else the motion is smooth from rest to rest, and takes 1 s; or
    its first curve has a constant acceleration between the rates at the ends.
    """
    grid = np.linspace(0.0, 1.0, len(joint_path))
    boundary = phase.boundary
    if boundary.periodic:
        # An even drift lets the path end as far ahead of its start as it has to.
        ahead = np.nan_to_num(boundary.end - boundary.start)
        missing = ahead - (joint_path[-1] - joint_path[0])
        joint_path = joint_path + grid[:, None] * missing
    ends = (boundary.start_rates, boundary.end_rates)
    first, last = (0.0 if rates is None else float(rates[0]) for rates in ends)
    total = first + last
    part = t_norm
    if duration is None and total == 0.0:
        part = t_norm**3 * (10.0 - 15.0 * t_norm + 6.0 * t_norm**2)
    elif duration is None:
        part = t_norm * (2.0 * first + (last - first) * t_norm) / total
    values = [np.interp(part, grid, column) for column in joint_path.T]
    return duration or (2.0 / total if total else 1.0), np.column_stack(values)


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
        missing = values - basis @ (spline.fixed + duration * spline.rate)
        parts.append(np.linalg.lstsq(basis @ spline.matrix, missing, rcond=None)[0])
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
    while program.end_time(x) < 200.0:
        worst = worst_time_scaling_ratio(program, x)
        if worst <= 1.0:
            break
        if worst >= least:
            return best
        best = x
        least = worst
        # Without gravity and friction, torque falls with the square of the time.
        x = program.with_time_scaled(x, 1.1 * min(np.sqrt(worst), 8.0))
    else:
        return best
    shorter = x
    while program.end_time(shorter) > 0.01:
        shorter = program.with_time_scaled(shorter, 0.8)
        if worst_time_scaling_ratio(program, shorter) > 1.0:
            break
        x = shorter
    return x


def worst_time_scaling_ratio(program: Program, x: np.ndarray) -> float:
    """Largest ratio to a limit that a longer time relieves, such as those of velocity, acceleration and torque."""
    pairs = program.split(x)
    ratios = [np.abs(phase.time_scaling_ratios(part)).max() for phase, part in pairs]
    return float(max(ratios))
