"""The motion of a phase: curves y(t) as splines. The first curve may be given by a time law instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import drop_near, greville, spread
from brachis.errors import UnreachableError
from brachis.kernel import Spline
from brachis.optimise.bspline import ORDERS, clamped_knots, insert_knots, local_basis
from brachis.path.time_law import TimeLaw
from brachis.trajectory import PhaseSpline

_ROUNDING = 1e-13
"""Rounding error of a time, as a fraction of the end time."""
_S_MISS = 2e-13
"""Largest permitted deviation of the spline of s from the time law."""
_LOOKS = 5
"""Number of instants in each interval at which the spline and the time law are compared."""
_SAMPLES = 20
"""Number of samples of a time law per station. Linear interpolation between samples gives the time at a station."""


def per_second(orders: np.ndarray, t_end: float) -> tuple[np.ndarray, ...]:
    """Convert value and derivatives per unit of normalised time to derivatives per second."""
    return tuple(values / t_end**order for order, values in enumerate(orders))


def sample_law(time_law: TimeLaw, t_norm: np.ndarray) -> np.ndarray:
    """Sample s and its derivatives per unit of normalised time, (4, K, 1)."""
    duration = time_law.duration
    orders = time_law.at(t_norm * duration)
    scale = duration ** np.arange(ORDERS)
    return (orders * scale[:, None])[:, :, None]


def follow_law(
    law: TimeLaw, stations: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the times at which a time law passes stations, (P,), s, with ds/dt, 1/s, and d2s/dt2, 1/s^2, there."""
    t = np.linspace(0.0, law.duration, _SAMPLES * len(stations))
    times = np.interp(stations, law.at(t)[0], t)
    _, rate, acceleration, _ = law.at(times)
    return times, rate, acceleration


@dataclass(frozen=True, repr=False)
class Motion(PhaseSpline):
    """The curves that belong to a point x of a phase. If a time law gives s(t), s has no spline.

    Attributes
    ----------
    t_end : float
        End time, s.
    knots : ndarray
        Knots in normalised time.
    degree : int
    control_points : (c, N + d) ndarray
        Control points of each curve. Along a path without a time law, s comes first, then each redundant joint in chain
        order.
    time_law : TimeLaw or None
        Time law of s(t), if it is given.
    """

    time_law: TimeLaw | None = None

    @property
    def breaks(self) -> np.ndarray:
        """Times, (N + 1,), s, between which the curves are polynomials."""
        return np.unique(self.knots) * self.t_end

    def at(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return value y of the curves and three time derivatives, each (K, c), at times t, (K,), in seconds.

        At a knot, the values just after the knot are returned.
        """
        t_norm = t / self.t_end
        within = t_norm.clip(self.knots[0], self.knots[-1])
        spline = Spline(self.knots, self.control_points.T, self.degree)
        # Rounding must not decide on which side of a knot a time lies, because the highest derivative jumps there.
        orders = spline.derivatives(within, ORDERS - 1, _ROUNDING)
        if self.time_law is not None:
            law_orders = sample_law(self.time_law, t_norm)
            orders = np.concatenate([law_orders, orders], axis=2)
        return per_second(orders, self.t_end)

    def with_knots(self, knots: np.ndarray) -> Motion:
        """Return the same curves over a clamped knot vector that contains the current one."""
        points = insert_knots(self.control_points, self.knots, knots, self.degree)
        return replace(self, knots=knots, control_points=points)

    def with_end(self, end: int, values: np.ndarray, curves: Sequence[int]) -> Motion:
        """Return the motion with new values and derivatives at one end.

        Parameters
        ----------
        end : int
            0 for the beginning, -1 for the end.
        values : (1 + k, c) ndarray
            Values and derivatives per second, one order after the other.
        curves : sequence of int
            Indices of the c curves among those that have control points.
        """
        count = len(values)
        orders = np.arange(count)[:, None]
        t_norm = np.array([float(end != 0)])
        near = slice(None, count) if end == 0 else slice(-count, None)
        _, basis = local_basis(self.knots, self.degree, t_norm)
        matrix = basis[:count, 0, near]
        points = self.control_points.copy()
        # Basis functions add up to 1. If derivatives are zero, points are therefore equal to the last digit.
        slopes = np.concatenate([0.0 * values[:1], (values * self.t_end**orders)[1:]])
        nearest = values[0] + np.linalg.solve(matrix, slopes)
        points[curves, near] = nearest.T
        return replace(self, control_points=points)

    def as_spline(self) -> PhaseSpline:
        """Return all curves as splines. If s has a time law, knots are added until s follows it to rounding error.

        Raises
        ------
        UnreachableError
            The time law bends too sharply for splines.
        """
        law = self.time_law
        if law is None:
            return PhaseSpline(self.t_end, self.knots, self.degree, self.control_points)
        from scipy.interpolate import make_interp_spline

        law_knots = law.spline.t / self.t_end
        breaks = np.union1d(np.unique(self.knots), np.clip(law_knots, 0.0, 1.0))
        breaks = drop_near(breaks, tolerances.PATH)
        for _ in range(12):
            knots = clamped_knots(self.degree, breaks)
            places = greville(knots, self.degree)
            s = law.at(places * self.t_end)[0]
            points = make_interp_spline(places, s, k=self.degree, t=knots).c
            t_norm = spread(breaks, _LOOKS)
            spline_s = Spline(knots, points, self.degree)(t_norm)
            miss = np.abs(spline_s - law.at(t_norm * self.t_end)[0])
            worst = miss[:-1].reshape(-1, _LOOKS).max(axis=1)
            if worst.max() < _S_MISS:
                other_points = self.with_knots(knots).control_points
                both = np.vstack([points, other_points])
                return PhaseSpline(self.t_end, knots, self.degree, both)
            middles = 0.5 * (breaks[:-1] + breaks[1:])
            breaks = np.union1d(breaks, middles[worst >= _S_MISS])
        raise UnreachableError("the given speed changes too sharply for splines")
