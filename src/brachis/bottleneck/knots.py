"""What the knots cost: the motion beside the fastest timing of its own joint path.

A spline can only ramp from one limit to another, so that few knot intervals cost time that no limit accounts
for. The phase plane (`brachis.search.phase_plane`) times the same joint path with torques that may jump; with ever more
intervals splines come as near to that as one likes. The motion that it finds counts only if it keeps to all limits,
also to those that it leaves out (friction, power, means).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.limits import Limit, Moments
from brachis.search.phase_plane import fastest
from brachis.trajectory import Trajectory

_STATIONS = 1001
_BISECTIONS = 50
_WITHIN, _MOST = 0.02, 0.01
"""The motion in the phase plane may exceed limits by more than the first fraction for this fraction of its time: at
the stations beside rest its derivatives are differences, and rough."""
_JUMPING = 2
"""Highest derivative that the phase plane bounds: it jumps there."""


@dataclass(frozen=True)
class KnotCost:
    """What the knots cost.

    Attributes
    ----------
    intervals : int
        Number of knot intervals of the motion.
    given : bool
        Whether the task gives this number, so that ``intervals: auto`` is left to try.
    t_end : float
        Of the fastest timing of the same joint path, s, to about 0.2 %.
    saved : float
        How much shorter that is, as a fraction of the motion's end time.
    """

    intervals: int
    given: bool
    t_end: float
    saved: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {"intervals": self.intervals, "t_end_s": self.t_end, "saved": self.saved}


def knot_cost(trajectory: Trajectory, limits: Sequence[Limit], t_end: float) -> KnotCost | None:
    """Compare a planned motion with the fastest timing of its own joint path.

    Parameters
    ----------
    trajectory : Trajectory
    limits : sequence of Limit
        Of the task.
    t_end : float
        Of the fastest motion over these knots, s; the trajectory may be a calmer one.

    Returns
    -------
    KnotCost or None
        None if the phase plane does not tell: a limit bounds the jerk or the rate of the torque, or the motion in the
        phase plane exceeds a limit that it leaves out.
    """
    if any(limit.order > _JUMPING for limit in limits):
        return None
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = trajectory.position(_times_at(trajectory, s))
    first, last = np.abs(trajectory.path_spline.derivative()([0.0, trajectory.t_end]))
    rate = fastest(limits, s, q, (first, last), s)
    if rate is None:
        return None
    steps = 2.0 * np.diff(s) / (rate[1:] + rate[:-1])
    if steps[_exceeds(limits, s, q, rate, steps)].sum() > _MOST * steps.sum():
        return None
    least = float(steps.sum())
    intervals = len(np.unique(trajectory.knots)) - 1
    given = trajectory.task.spline.intervals != "auto"
    return KnotCost(intervals, given, least, 1.0 - least / t_end)


def _times_at(trajectory: Trajectory, s: np.ndarray) -> np.ndarray:
    """Find when path coordinates, (S,), are passed, s."""
    low, high = np.zeros_like(s), np.full_like(s, trajectory.t_end)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        before = trajectory.path_coordinate(middle) < s
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return high


def _exceeds(limits: Sequence[Limit], s: np.ndarray, q: np.ndarray, rate: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Tell between which stations the motion in the phase plane exceeds a limit, (S - 1,)."""
    q_ds = np.gradient(q, s, axis=0, edge_order=2)
    q_dds = np.gradient(q_ds, s, axis=0, edge_order=2)
    acceleration = (np.diff(rate**2) / (2.0 * np.diff(s)))[:, None]
    speed = rate[:-1, None]
    qddot = q_ds[:-1] * acceleration + q_dds[:-1] * speed**2
    moments = Moments(q[:-1], q_ds[:-1] * speed, qddot, np.zeros_like(qddot), s[:-1])
    ratios = [np.abs(limit.ratios(moments, np.cumsum(steps))).max(axis=1) for limit in limits]
    return np.max(ratios, axis=0) > 1.0 + _WITHIN
