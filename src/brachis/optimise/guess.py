"""Initial guesses: splines through a joint path, a smooth s(t), a long enough time.

The end time is scaled until all limits hold, which gives the solver a feasible start wherever gravity leaves one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import partial

import numpy as np

from brachis.common.arrays import greville, interpolate_columns, spread
from brachis.errors import UnreachableError
from brachis.optimise.bspline import basis_matrix
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program


def starting_point(
    program: Program,
    joint_paths: Sequence[np.ndarray],
    durations: Sequence[float | None],
) -> np.ndarray | None:
    """Fit splines to a joint path of every phase, and scale each phase's time until the limits hold.

    Control points taken from the joint path itself smooth it; where that leaves the branch, least squares follow it
    closer.

    Parameters
    ----------
    program : Program
    joint_paths : sequence of (S, c) ndarray
        For each phase, successive values of its curves: along a path of s and the redundant joints.
    durations : sequence of float or None
        Of the motions whose values at even times these are, s; where None, they get smooth ones from end to end.

    Returns
    -------
    (v,) ndarray or None
        None where the fit is out of reach at a collocation point.
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
    """Take control points from the joint path."""
    t_norm = greville(phase.knots, phase.degree)
    t_end, points = _motion_along(phase, joint_path, duration, t_norm)
    values = points[:, phase.boundary.law_curves :]
    return phase.variables_from(Motion(t_end, phase.knots, phase.degree, values.T))


def _follow(phase: Phase, joint_path: np.ndarray, duration: float | None) -> np.ndarray:
    """Fit curves to the joint path."""
    t_norm = spread(phase.breaks, 4)
    t_end, targets = _motion_along(phase, joint_path, duration, t_norm)
    return fit_curves(phase, t_end, t_norm, targets)


def _motion_along(
    phase: Phase, joint_path: np.ndarray, duration: float | None, t_norm: np.ndarray
) -> tuple[float, np.ndarray]:
    """Duration, s, and values (K, c) at normalised times, (K,), of a motion along a joint path, (S, c).

    A path with a duration has its values at even times. Else the motion is smooth from rest to rest, and takes 1 s; or
    its first curve has a constant acceleration between the rates at the ends. Where a time law gives the first curve,
    the others follow it.
    """
    if phase.time_law is not None:
        s = phase.time_law.at(t_norm * phase.time_law.duration)[0]
        values = interpolate_columns(s, joint_path[:, 0], joint_path)
        return phase.time_law.duration, values
    grid = np.linspace(0.0, 1.0, len(joint_path))
    boundary = phase.boundary
    if boundary.periodic:
        # An even drift lets the path end as far ahead of its start as it has to.
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
    """Point x whose curves come nearest to given values, by least squares; exact where the splines contain them.

    Parameters
    ----------
    phase : Phase
    duration : float
        s.
    t_norm : (K,) ndarray
        Normalised times.
    targets : (K, c) ndarray
        Values of the curves there; that of a curve that is given does not count.

    Returns
    -------
    (v,) ndarray
    """
    basis = basis_matrix(phase.knots, phase.degree, t_norm)
    variables = [np.array([duration])]
    spline_targets = targets[:, phase.boundary.law_curves :]
    for spline, values in zip(phase.splines, spline_targets.T, strict=True):
        missing = values - basis @ spline.fixed_points(duration)
        free = basis @ spline.free_matrix.dense()
        variables.append(np.linalg.lstsq(free, missing, rcond=None)[0])
    variables.append(phase.grid.lengths_of(phase.knots))
    return np.clip(np.concatenate(variables), phase.x_lower, phase.x_upper)


def shortest_time(program: Program, x: np.ndarray) -> np.ndarray:
    """Scale the time of every phase until velocity, acceleration and torque limits just hold.

    They are exceeded least if they cannot hold. Far above the least time no limit is active, and a solver that has seen
    no curvature creeps towards it. Where an arm passes postures that it cannot hold, long times do not hold the limits
    either, and between ends in motion they are slower on the way alone. A duration that is given stays.

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
        # A long motion between moving ends goes backwards along the path.
        if has_path and phase.state(x).ydot[:, 0].min() < 0.0:
            return best
        if worst <= 1.0:
            break
        if worst >= least:
            return best
        best = x
        least = worst
        # Without gravity and friction, torque falls with the square of the time.
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
    """Largest ratio to a limit that a longer time relieves, such as those of velocity, acceleration and torque."""
    return max(
        phase.worst_time_scaling_ratio(x_of_phase)
        for phase, x_of_phase in program.split(x)
    )
