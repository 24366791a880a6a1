"""A point of a phase as curves over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.bspline import insert_knots
from brachis.nlp.boundary import LocalBasis
from brachis.summary import Summary

_BISECTIONS = 45


def per_second(orders: np.ndarray, t_end: float) -> tuple[np.ndarray, ...]:
    """Value and derivatives per second, from those per unit of normalised time."""
    return tuple(part / t_end**order for order, part in enumerate(orders))


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
        Of each curve: along a path of s, then of each redundant joint in chain order.
    """

    t_end: float
    knots: np.ndarray
    degree: int
    control_points: np.ndarray

    @property
    def breaks(self) -> np.ndarray:
        """Times between which the curves are polynomials, (N + 1,), s."""
        return np.unique(self.knots) * self.t_end

    def at(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Value y of the curves and three time derivatives, each (K, c), at times t, (K,), in seconds.

        At knots those behind them.
        """
        basis = LocalBasis.of(self.knots, self.degree, t / self.t_end)
        return per_second(basis.curves(self.control_points), self.t_end)

    def over(self, knots: np.ndarray) -> Motion:
        """Return the same curves over a clamped knot vector that contains the present one."""
        points = insert_knots(self.control_points, self.knots, knots, self.degree)
        return Motion(self.t_end, knots, self.degree, points)

    def times_of(self, s: np.ndarray) -> np.ndarray:
        """Find the times, (P,), s, at which path coordinates s, (P,), are reached; s(t) does not decrease."""
        low, high = np.zeros(len(s)), np.full(len(s), self.t_end)
        for _ in range(_BISECTIONS if len(s) else 0):
            middle = 0.5 * (low + high)
            order = np.argsort(middle, kind="stable")
            before = np.empty(len(s), dtype=bool)
            before[order] = self.at(middle[order])[0][:, 0] < s[order]
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return 0.5 * (low + high)
