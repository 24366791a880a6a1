"""Positions of knots and collocation points: fixed, or moved by the interval lengths h as variables of the NLP.

A collocation point stays in its interval, at the same fraction of the interval. If the knots are free, the lengths h =
(h_1, ..., h_N), in normalised time, are variables at the end of x. They have lower bounds, and a row requires their sum
to be 1. The collocation points then move with the knots, and the basis functions at a point depend on the lengths of
the 2 d - 1 intervals around it. A fixed grid has the same interface, but no variables, no rows and empty derivatives.

Means over time are weighted sums over the collocation points. Every interval is integrated separately, because the
motion is smooth within a knot interval but not across its ends. Each step between neighbouring points is integrated
with the cubic through the four nearest points. Points much closer together than the other points of their interval are
skipped, because cubics through them would oscillate.
"""

from __future__ import annotations

import itertools
from functools import cached_property

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import LastCall
from brachis.optimise.boundary import LocalBasis
from brachis.optimise.bspline import (
    ORDERS,
    basis_derivatives,
    basis_functions,
    clamped_knots,
    locate,
)


def _spaced_places(u: np.ndarray) -> list[int]:
    """Return the indices of places u, ascending, leaving out a place less than half a median step after another.

    Both ends are included.
    """
    if len(u) == 1:
        return [0]
    least = 0.5 * float(np.median(np.diff(u)))
    numbers = [0]
    for number in range(1, len(u) - 1):
        if u[number] - u[numbers[-1]] >= least and u[-1] - u[number] >= least:
            numbers.append(number)
    return [*numbers, len(u) - 1]


def _weights(u: np.ndarray) -> np.ndarray:
    """Return weights, (P,), for values at places u, (P,), to integrate the cubics through them over [0, 1]."""
    count = min(4, len(u))
    ends = np.concatenate([[0.0], u[1:-1], [1.0]])
    weights = np.zeros(len(u))
    powers = np.arange(1, count + 1)
    for step, (low, high) in enumerate(itertools.pairwise(ends)):
        first = int(np.clip(step - 1, 0, len(u) - count))
        stencil = slice(first, first + count)
        moments = (high - low) ** powers / powers
        matrix = np.vander(u[stencil] - low, count, increasing=True).T
        weights[stencil] += np.linalg.solve(matrix, moments)
    return weights


class FixedGrid:
    """Fixed knots, and collocation points.

    In a `FreeGrid` the interval lengths h, (v,), are variables. In a `FixedGrid` h is empty.

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
        Knots in normalised time. If they are variables, these are the knots with which the grid was created.
    degree : int
    t_norm : (K,) ndarray
        Collocation points in normalised time, ascending from 0 to 1, at these knots.

    Attributes
    ----------
    knots, degree, t_norm
        As given.
    breaks : (N + 1,) ndarray
        Ends of the knot intervals.
    lower, upper : (v,) ndarray
        Bounds on h.
    total : (0,) or (1,) ndarray
        Required value of the row that holds the sum of h.
    point, variable : (z,) int ndarray
        Sparsity pattern of the curves' derivatives with respect to h. Each pair occurs once.
    """

    lower: np.ndarray = np.empty(0)
    upper: np.ndarray = np.empty(0)
    total: np.ndarray = np.empty(0)
    point: np.ndarray = np.empty(0, dtype=int)
    variable: np.ndarray = np.empty(0, dtype=int)

    def __init__(self, knots: np.ndarray, degree: int, t_norm: np.ndarray) -> None:
        self.knots = knots
        self.degree = degree
        self.t_norm = t_norm
        self.breaks = knots[degree : len(knots) - degree]

    def knots_at(self, _h: np.ndarray) -> np.ndarray:
        """Return the knots in the units of h."""
        return self.knots

    def t_norm_at(self, _h: np.ndarray) -> np.ndarray:
        """Return the collocation points in the units of h."""
        return self.t_norm

    def lengths_of(self, _knots: np.ndarray) -> np.ndarray:
        """Return the variables h that belong to given knots."""
        return np.empty(0)

    def basis(self, _h: np.ndarray) -> LocalBasis:
        """Return the basis functions at the collocation points. Unless they change, it is always the same object."""
        return self._basis

    @cached_property
    def _basis(self) -> LocalBasis:
        return LocalBasis.of(self.knots, self.degree, self.t_norm)

    def slopes(self, _h: np.ndarray, control_points: np.ndarray) -> np.ndarray:
        """Return the slopes by h, (4, z, c), of the value and three derivatives of splines, (c, N + d)."""
        return np.empty((ORDERS, 0, len(control_points)))

    def fix(self, _h: np.ndarray) -> FixedGrid:
        """Return the grid with its knots fixed at their positions for `h`."""
        return self

    @cached_property
    def _interval_weights(self) -> np.ndarray:
        """Weights, (N, K), of the collocation points in the mean over each interval."""
        weights = np.zeros((len(self.breaks) - 1, len(self.t_norm)))
        ends = itertools.pairwise(self.breaks)
        for row, (low, high) in zip(weights, ends, strict=True):
            is_behind = self.t_norm > low - tolerances.TIME
            inside = np.flatnonzero(is_behind & (self.t_norm < high + tolerances.TIME))
            # If accelerations jump at knots, the values at the end of an interval are those of the next interval.
            if self.degree < 3 and high < self.breaks[-1]:
                inside = inside[:-1]
            u = (self.t_norm[inside] - low) / (high - low)
            chosen = _spaced_places(u)
            row[inside[chosen]] = _weights(u[chosen])
        return weights

    def mean_weights(self, _h: np.ndarray) -> np.ndarray:
        """Return the weights, (K,), of the collocation points in a mean over time."""
        return np.diff(self.breaks) @ self._interval_weights

    @property
    def mean_slopes(self) -> np.ndarray:
        """Derivatives of `mean_weights` with respect to h, (v, K)."""
        return np.empty((0, len(self.t_norm)))


class FreeGrid(FixedGrid):
    """Knots that are variables, and collocation points that keep their places within their intervals.

    Parameters
    ----------
    knots, degree, t_norm
        See `FixedGrid`.
    shortest : float
        Minimum length of an interval, in normalised time.
    """

    total = np.ones(1)

    def __init__(
        self, knots: np.ndarray, degree: int, t_norm: np.ndarray, shortest: float
    ) -> None:
        super().__init__(knots, degree, t_norm)
        breaks = self.breaks
        count = len(breaks) - 1
        self.lower = np.full(count, shortest)
        self.upper = np.ones(count)
        self._interval, self._fraction = locate(breaks, t_norm)
        around = self._interval[:, None] + np.arange(1 - degree, degree)
        self._inside = (around >= 0) & (around < count)
        # Beyond both ends, intervals have zero length.
        self._around = np.where(self._inside, around, count)
        self.point, _ = np.nonzero(self._inside)
        self.variable = around[self._inside]
        self._basis_at = LastCall(self._find_basis)

    def knots_at(self, h: np.ndarray) -> np.ndarray:
        """Return the knots for interval lengths `h`, which are first raised to the minimum length."""
        breaks = np.concatenate([[0.0], np.cumsum(np.maximum(h, self.lower))])
        return clamped_knots(self.degree, breaks / breaks[-1])

    def t_norm_at(self, h: np.ndarray) -> np.ndarray:
        """Return the collocation points for interval lengths `h`."""
        return (np.cumsum(h) - h)[self._interval] + self._fraction * h[self._interval]

    def lengths_of(self, knots: np.ndarray) -> np.ndarray:
        """Return the lengths of the intervals between given knots."""
        return np.diff(knots[self.degree : len(knots) - self.degree])

    def _lengths_around(self, h: np.ndarray) -> np.ndarray:
        return np.append(h, 0.0)[self._around]

    def basis(self, h: np.ndarray) -> LocalBasis:
        """Return the basis functions at the collocation points. The functions are cached until `h` changes."""
        return self._basis_at(h)

    def _find_basis(self, h: np.ndarray) -> LocalBasis:
        values = basis_functions(self._lengths_around(h), self._fraction)
        return LocalBasis(self._interval, values)

    def slopes(self, h: np.ndarray, control_points: np.ndarray) -> np.ndarray:
        """Differentiate splines with respect to the 2 d - 1 lengths around each collocation point."""
        derivatives = basis_derivatives(self._lengths_around(h), self._fraction)
        points = control_points[:, self.basis(h).columns]
        slopes = np.einsum("oikw,ckw->okic", derivatives, points)
        return slopes[:, self._inside]

    def fix(self, h: np.ndarray) -> FixedGrid:
        """Return the grid with fixed knots, in normalised time."""
        t_norm = self.t_norm_at(h)
        return FixedGrid(self.knots_at(h), self.degree, t_norm / t_norm[-1])

    def mean_weights(self, h: np.ndarray) -> np.ndarray:
        """Return the weights of the mean over time: the weights within each interval times its length."""
        return h @ self._interval_weights

    @property
    def mean_slopes(self) -> np.ndarray:
        """Derivatives of `mean_weights` with respect to h: the weights within each interval."""
        return self._interval_weights
