"""The motion of a phase: curves y(t) as splines, the first of them perhaps given by a time law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.common.summary import Summary
from brachis.errors import UnreachableError
from brachis.optimise.boundary import LocalBasis, greville
from brachis.optimise.bspline import (
    ORDERS,
    clamped_knots,
    insert_knots,
    local_basis,
    spread,
)
from brachis.path.time_law import TimeLaw
from brachis.trajectory import PhaseSpline

_S_MISS = 2e-13
"""By which s may miss what is given of it."""
_LOOKS = 5
"""Times in every interval at which s is compared."""


def bisect(
    is_before: Callable[[np.ndarray], np.ndarray], end: np.ndarray
) -> np.ndarray:
    """Find numbers between 0 and `end`, (P,), up to which a condition holds.

    Parameters
    ----------
    is_before : callable
        Tells of trial numbers, (P,), whether they come before the ones that are sought.
    end : (P,) ndarray
    """
    low = np.zeros(len(end))
    high = end
    for _ in range(45 if len(end) else 0):  # to 3e-14 of the end
        middle = 0.5 * (low + high)
        before = is_before(middle)
        low = np.where(before, middle, low)
        high = np.where(before, high, middle)
    return np.asarray(0.5 * (low + high))


def per_second(orders: np.ndarray, t_end: float) -> tuple[np.ndarray, ...]:
    """Value and derivatives per second, from those per unit of normalised time."""
    return tuple(part / t_end**order for order, part in enumerate(orders))


def given_orders(
    time_law: TimeLaw | None, t_norm: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Value and derivatives of given curves per unit of normalised time, (4, K, 1); none without a time law."""
    if time_law is None:
        return ()
    duration = time_law.duration
    orders = time_law.at(t_norm * duration)
    scale = duration ** np.arange(ORDERS)
    return ((orders * scale[:, None])[:, :, None],)


@dataclass(frozen=True, repr=False)
class Motion(Summary):
    """A point x of a phase as curves.

    Attributes
    ----------
    t_end : float
        s.
    knots : ndarray
        In normalised time.
    degree : int
    control_points : (c, N + d) ndarray
        Of each curve: along a path of s unless a time law gives it, then of each redundant joint in chain order.
    time_law : TimeLaw or None
        s(t) where it is given.
    """

    t_end: float
    knots: np.ndarray
    degree: int
    control_points: np.ndarray
    time_law: TimeLaw | None = None

    @property
    def breaks(self) -> np.ndarray:
        """Times between which the curves are polynomials, (N + 1,), s."""
        return np.unique(self.knots) * self.t_end

    def at(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Value y of the curves and three time derivatives, each (K, c), at times t, (K,), in seconds.

        At knots those behind them.
        """
        t_norm = t / self.t_end
        basis = LocalBasis.of(self.knots, self.degree, t_norm)
        given = given_orders(self.time_law, t_norm)
        orders = np.concatenate([*given, basis.curves(self.control_points)], axis=2)
        return per_second(orders, self.t_end)

    def with_knots(self, knots: np.ndarray) -> Motion:
        """Return the same curves over a clamped knot vector that contains the present one."""
        points = insert_knots(self.control_points, self.knots, knots, self.degree)
        return replace(self, knots=knots, control_points=points)

    def with_start(self, values: np.ndarray) -> Motion:
        """Return the motion with other values and derivatives at its beginning.

        Parameters
        ----------
        values : (1 + k, c) ndarray
            Of the curves that have control points, by order, per second.
        """
        orders = np.arange(len(values))[:, None]
        _, basis = local_basis(self.knots, self.degree, np.zeros(1))
        matrix = basis[: len(values), 0, : len(values)]
        points = self.control_points.copy()
        first = np.linalg.solve(matrix, values * self.t_end**orders)
        points[:, : len(values)] = first.T
        return replace(self, control_points=points)

    def as_spline(self) -> PhaseSpline:
        """Write all curves as splines; one that is given over more knots, so that it is met to rounding.

        Raises
        ------
        UnreachableError
            What is given is too sharp for splines.
        """
        if self.time_law is None:
            return PhaseSpline(self.t_end, self.knots, self.degree, self.control_points)
        own = self.time_law.spline.t / self.t_end
        breaks = np.union1d(np.unique(self.knots), np.clip(own, 0.0, 1.0))
        breaks = breaks[np.append(np.diff(breaks) > tolerances.PATH, True)]
        for _ in range(12):
            knots = clamped_knots(self.degree, breaks)
            points = self._interpolate_given(knots)
            t_norm = spread(breaks, _LOOKS)
            basis = LocalBasis.of(knots, self.degree, t_norm)
            found = basis.curves(points[None])[0, :, 0]
            miss = np.abs(found - self.time_law.at(t_norm * self.t_end)[0])
            worst = miss[:-1].reshape(-1, _LOOKS).max(axis=1)
            if worst.max() < _S_MISS:
                finer = (self.control_points, self.knots, knots, self.degree)
                both = np.vstack([points, insert_knots(*finer)])
                return PhaseSpline(self.t_end, knots, self.degree, both)
            middles = 0.5 * (breaks[:-1] + breaks[1:])
            breaks = np.union1d(breaks, middles[worst >= _S_MISS])
        raise UnreachableError("the given speed changes too sharply for splines")

    def _interpolate_given(self, knots: np.ndarray) -> np.ndarray:
        """Control points of the curve that is given, over clamped knots, (N + d,)."""
        from scipy.interpolate import make_interp_spline

        assert self.time_law is not None
        places = greville(knots, self.degree)
        s = self.time_law.at(places * self.t_end)[0]
        spline = make_interp_spline(places, s, k=self.degree, t=knots)
        return np.asarray(spline.c)

    def times_of(self, s: np.ndarray) -> np.ndarray:
        """Find the times, (P,), s, at which path coordinates s, (P,), are reached; s(t) does not decrease."""
        end = np.full(len(s), self.t_end)
        return bisect(lambda t: self.at(t)[0][:, 0] < s, end)
