"""How near a motion is to its limits over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.arrays import freeze
from brachis.robot import dynamics
from brachis.trajectory.trajectory import Trajectory

_POINTS_PER_INTERVAL = 40
_LEAST_HALF_RANGE, _LARGEST_HALF_RANGE = 1e-5, 1.0
"""Positions are measured in half ranges between these, rad or m."""
KINDS = ("torque", "velocity", "acceleration", "position")
"""Kinds of limits, in the order of `LimitRatios.names`."""


@dataclass(frozen=True, eq=False)
class LimitRatios:
    """Ratios of the motion to all limits of the robot. The arrays are read-only.

    Attributes
    ----------
    t : (K,) ndarray
        Ascending, s; a time at which the acceleration jumps occurs twice, before and after the jump.
    names : tuple of (str, str)
        Kind of limit and joint of every column.
    values : (K, c) ndarray
        1 at the upper limit, -1 at the lower one. Positions count by their distance from an end, so that 0.9 is
        0.1 rad or m away; in half ranges where these are shorter than that, and 0 where both ends are further away.
    """

    t: np.ndarray
    names: tuple[tuple[str, str], ...]
    values: np.ndarray

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, "t", "values")


def limit_ratios(trajectory: Trajectory) -> LimitRatios:
    """Compare a trajectory with every limit at its nodes, its knots and densely between.

    Parameters
    ----------
    trajectory : Trajectory

    Returns
    -------
    LimitRatios
    """
    knots = np.unique(trajectory.knots) * trajectory.t_end
    steps = np.arange(_POINTS_PER_INTERVAL) / _POINTS_PER_INTERVAL
    grid = (knots[:-1, None] + np.diff(knots)[:, None] * steps).ravel()
    samples = trajectory.at(np.clip(np.union1d(grid, trajectory.times), 0.0, trajectory.t_end))
    t, q, qdot, qddot, tau = samples.t, samples.q, samples.qdot, samples.qddot, samples.tau
    jumps = np.any(trajectory.qddot_before != trajectory.qddot, axis=1)
    if jumps.any():
        before = trajectory.q[jumps], trajectory.qdot[jumps], trajectory.qddot_before[jumps]
        first = (trajectory.times[jumps], *before, dynamics.torque(trajectory.robot, *before))
        parts = [np.concatenate([a, b]) for a, b in zip(first, (t, q, qdot, qddot, tau), strict=True)]
        order = np.argsort(parts[0], kind="stable")
        t, q, qdot, qddot, tau = (part[order] for part in parts)
    limits = trajectory.robot.limits
    tables = {
        "torque": tau / limits.torque,
        "velocity": qdot / limits.velocity,
        "acceleration": qddot / limits.acceleration,
        "position": _positions(q, limits.position_lower, limits.position_upper),
    }
    limited = {kind: np.isfinite(getattr(limits, kind)) for kind in KINDS[:-1]}
    limited["position"] = np.isfinite(limits.position_lower) | np.isfinite(limits.position_upper)
    names = tuple((kind, trajectory.joint_names[i]) for kind in KINDS for i in np.flatnonzero(limited[kind]))
    return LimitRatios(t, names, np.concatenate([tables[kind][:, limited[kind]] for kind in KINDS], axis=1))


def _positions(q: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Place of positions (K, n) in their ranges; 0 where both ends are far or open."""
    half = np.clip(0.5 * upper - 0.5 * lower, _LEAST_HALF_RANGE, _LARGEST_HALF_RANGE)
    from_upper = np.maximum(1.0 + (q - upper) / half, 0.0)
    from_lower = np.minimum(-1.0 + (q - lower) / half, 0.0)
    return np.asarray(from_upper + from_lower)
