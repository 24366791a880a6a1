"""Initial guesses: splines through a joint path, with a smooth s(t) and a sufficiently long time.

The end time is scaled until all limits are met. This gives the solver a feasible start, unless gravity rules that out.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import partial

import numpy as np

from brachis.common.arrays import greville, interpolate_columns, spread
from brachis.errors import UnreachableError
from brachis.kernel import collocation
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program


def starting_point(
    program: Program,
    joint_paths: Sequence[np.ndarray],
    durations: Sequence[float | None],
) -> np.ndarray | None:
    """Fit splines to a joint path for each phase, and scale the time of each phase until the limits are met.

    Points of the joint path are used as control points, which smooths the path. If the smoothed path leaves the branch,
    a least-squares fit is used, which follows the joint path more closely.

    Parameters
    ----------
    program : Program
    joint_paths : sequence of (S, c) ndarray
        For each phase, successive values of its curves. Along a path, these are s and the redundant joints.
    durations : sequence of float or None
        For each phase, the duration, s, of a motion whose values at evenly spaced times form the joint path. With None,
        the phase gets a smooth motion from end to end.

    Returns
    -------
    (v,) ndarray or None
        Starting point; None if a collocation point of the fit is out of reach.
    """
    x_by_phase = []
    for phase, joint_path, duration in zip(
        program.phases, joint_paths, durations, strict=True
    ):
        for fit in (_smooth, _follow):
            with contextlib.suppress(UnreachableError):
                x = fit(phase, joint_path, duration)
                x_by_phase.append(_scale_time(phase, x, (0, 0)))
                break
        else:
            return None
    return np.concatenate(x_by_phase)


def _smooth(phase: Phase, joint_path: np.ndarray, duration: float | None) -> np.ndarray:
    """Return variables with points of the joint path as control points."""
    t_norm = greville(phase.knots, phase.degree)
    t_end, points = _motion_along(phase, joint_path, duration, t_norm)
    values = points[:, phase.boundary.law_curves :]
    return phase.variables_from(Motion(t_end, phase.knots, phase.degree, values.T))


def _follow(phase: Phase, joint_path: np.ndarray, duration: float | None) -> np.ndarray:
    """Return the variables of curves fitted to the joint path by least squares."""
    t_norm = spread(phase.breaks, 4)
    t_end, targets = _motion_along(phase, joint_path, duration, t_norm)
    return fit_curves(phase, t_end, t_norm, targets)


def _motion_along(
    phase: Phase, joint_path: np.ndarray, duration: float | None, t_norm: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return duration, s, and values, (K, c), of a motion along a joint path, (S, c), at normalised times, (K,).

    If a duration is given, the values of the path are at evenly spaced times. Without a duration, the motion takes 1 s
    and is smooth from rest to rest. If rates are given at the ends, the first curve has a constant acceleration between
    them. If a time law gives the first curve, the other curves follow it.
    """
    if phase.time_law is not None:
        s = phase.time_law.at(t_norm * phase.time_law.duration)[0]
        values = interpolate_columns(s, joint_path[:, 0], joint_path)
        return phase.time_law.duration, values
    grid = np.linspace(0.0, 1.0, len(joint_path))
    boundary = phase.boundary
    if boundary.periodic:
        # Add a uniform drift, so that the end of the path is at the required distance ahead of its start.
        missing = boundary.ahead - (joint_path[-1] - joint_path[0])
        joint_path = joint_path + grid[:, None] * missing
    first, last = boundary.rates
    total = first + last
    distance = float(joint_path[-1, 0] - joint_path[0, 0])
    fraction = t_norm
    if duration is None and total == 0.0:
        fraction = t_norm**3 * (10.0 - 15.0 * t_norm + 6.0 * t_norm**2)
    elif duration is None:
        fraction = t_norm * (2.0 * first + (last - first) * t_norm) / total
    values = interpolate_columns(fraction, grid, joint_path)
    return duration or (2.0 * distance / total if total else 1.0), values


def fit_curves(
    phase: Phase, duration: float, t_norm: np.ndarray, targets: np.ndarray
) -> np.ndarray:
    """Return the point x whose curves fit given values by least squares. The fit is exact if splines allow it.

    Parameters
    ----------
    phase : Phase
    duration : float
        Duration of the phase, s.
    t_norm : (K,) ndarray
        Normalised times.
    targets : (K, c) ndarray
        Values of the curves at these times. The values of a curve with a time law are ignored.

    Returns
    -------
    (v,) ndarray
    """
    basis = collocation(phase.knots, phase.degree, t_norm)
    variables = [np.array([duration])]
    spline_targets = targets[:, phase.boundary.law_curves :]
    for spline, values in zip(phase.splines, spline_targets.T, strict=True):
        missing = values - basis @ spline.fixed_points(duration)
        free = basis @ spline.free_matrix.dense()
        variables.append(np.linalg.lstsq(free, missing, rcond=None)[0])
    variables.append(phase.grid.lengths_of(phase.knots))
    return np.clip(np.concatenate(variables), phase.x_lower, phase.x_upper)


def shortest_time(program: Program, x: np.ndarray) -> np.ndarray:
    """Scale the time of every phase until velocity, acceleration and torque limits are just met.

    If the limits cannot be met, the time is chosen with which they are exceeded least. With a time far above the least
    time no limit is active, and a solver that has found no curvature creeps towards the solution. If the arm passes
    postures in which it cannot stay at rest, a long time does not meet the limits either. If a phase begins or ends in
    motion, a longer time slows only its middle. A given duration is not changed.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    return np.concatenate(
        [
            _scale_time(phase, x_of_phase, program.held_orders(number))
            for number, (phase, x_of_phase) in enumerate(program.split(x))
        ]
    )


def _scale_time(phase: Phase, x: np.ndarray, held: tuple[int, int]) -> np.ndarray:
    """Scale the time of a phase; see `shortest_time` and `Phase.scale_time`."""
    if phase.time_law is not None:
        phase.state(x)
        return x

    scale = partial(phase.scale_time, held=held)
    has_path = phase.joint_map.path is not None
    best = x
    least = np.inf
    while x[0] < 200.0:
        worst = phase.worst_time_scaling_ratio(x)
        # If a phase begins or ends in motion, a long motion may run backwards along the path.
        if has_path and phase.state(x).ydot[:, 0].min() < 0.0:
            return best
        if worst <= 1.0:
            break
        if worst >= least:
            return best
        best = x
        least = worst
        # Without gravity and friction, torques fall with the square of the time.
        x = scale(x, 1.1 * min(np.sqrt(worst), 8.0))
    else:
        return best
    shorter = x
    while shorter[0] > 0.01:
        shorter = scale(shorter, 0.8)
        if phase.worst_time_scaling_ratio(shorter) > 1.0:
            break
        x = shorter
    return x


def worst_time_scaling_ratio(program: Program, x: np.ndarray) -> float:
    """Return the largest ratio of a value to its limit, among limits that a longer time relieves, such as torque."""
    return max(
        phase.worst_time_scaling_ratio(x_of_phase)
        for phase, x_of_phase in program.split(x)
    )
