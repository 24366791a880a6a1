"""Where the knots and the collocation points lie: fixed, or moved by the interval lengths h as variables of the NLP.

Collocation points keep their place (interval, fraction of it). Where the knots are free, h = (h_1, ..., h_N) are
variables at the end of x, in normalised time: bounded from below, and with a row that holds their sum at 1. The
collocation points then move with the knots, and the basis functions at a point depend on the 2 d - 1 intervals around
it. A fixed grid answers the same questions: it has no variables, no rows and empty derivatives.

Means over time are integrals by weights of the collocation points. The motion is smooth within a knot interval and not
across its ends, so every interval is integrated for itself: over each step between neighbouring points the cubic
through the four nearest ones. Points that lie much closer together than the others of their interval are skipped:
cubics through them would swing.
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
    """Numbers of places u, ascending, without those that follow another one by less than half of the median step.

    Both ends are kept.
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
    """Weights, (P,), of the integral over [0, 1] of the cubics through values at places u, (P,)."""
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
    """Knots that are given, and collocation points.

    A `FreeGrid` answers for interval lengths h, (v,), that are variables; here h is empty.

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
        In normalised time; where they are variables, at the lengths that the grid was made with.
    degree : int
    t_norm : (K,) ndarray
        Collocation points in normalised time, ascending, from 0 to 1; as `knots`.

    Attributes
    ----------
    knots, degree, t_norm
        As given.
    breaks : (N + 1,) ndarray
        Ends of the knot intervals.
    lower, upper : (v,) ndarray
        Bounds on h.
    total : (0,) or (1,) ndarray
        What rows of sums of h must be.
    point, variable : (z,) int ndarray
        Pattern of the curves' derivatives with respect to h, each place once.
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
        """Knots, in units of h."""
        return self.knots

    def t_norm_at(self, _h: np.ndarray) -> np.ndarray:
        """Collocation points, in units of h."""
        return self.t_norm

    def lengths_of(self, _knots: np.ndarray) -> np.ndarray:
        """Variables h that belong to given knots."""
        return np.empty(0)

    def basis(self, _h: np.ndarray) -> LocalBasis:
        """Basis functions at the collocation points; the same object as long as they are the same."""
        return self._basis

    @cached_property
    def _basis(self) -> LocalBasis:
        return LocalBasis.of(self.knots, self.degree, self.t_norm)

    def slopes(self, _h: np.ndarray, control_points: np.ndarray) -> np.ndarray:
        """Differentiate value and three derivatives of splines (c, N + d) by h, on the pattern, (4, z, c)."""
        return np.empty((ORDERS, 0, len(control_points)))

    def fix(self, _h: np.ndarray) -> FixedGrid:
        """Return the grid with its knots fixed where they are at `h`."""
        return self

    @cached_property
    def _interval_weights(self) -> np.ndarray:
        """Weights, (N, K), of the collocation points in integrals over each interval, taken to be of length 1."""
        weights = np.zeros((len(self.breaks) - 1, len(self.t_norm)))
        ends = itertools.pairwise(self.breaks)
        for row, (low, high) in zip(weights, ends, strict=True):
            is_behind = self.t_norm > low - tolerances.TIME
            inside = np.flatnonzero(is_behind & (self.t_norm < high + tolerances.TIME))
            # Without continuous accelerations, the values at the end belong to the next interval.
            if self.degree < 3 and high < self.breaks[-1]:
                inside = inside[:-1]
            u = (self.t_norm[inside] - low) / (high - low)
            chosen = _spaced_places(u)
            row[inside[chosen]] = _weights(u[chosen])
        return weights

    def mean_weights(self, _h: np.ndarray) -> np.ndarray:
        """Weights, (K,), of the mean over time of what is known at the collocation points."""
        return np.diff(self.breaks) @ self._interval_weights

    @property
    def mean_slopes(self) -> np.ndarray:
        """Derivatives of `mean_weights` by h, (v, K)."""
        return np.empty((0, len(self.t_norm)))


class FreeGrid(FixedGrid):
    """Knots that are variables; collocation points keep their places within their intervals.

    Parameters
    ----------
    knots, degree, t_norm
        See `FixedGrid`.
    shortest : float
        Least length of an interval, in normalised time.
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
        # Beyond the ends: an interval without length.
        self._around = np.where(self._inside, around, count)
        self.point, _ = np.nonzero(self._inside)
        self.variable = around[self._inside]
        self._basis_at = LastCall(self._find_basis)

    def knots_at(self, h: np.ndarray) -> np.ndarray:
        """Knots for interval lengths `h`, at least the shortest each."""
        breaks = np.concatenate([[0.0], np.cumsum(np.maximum(h, self.lower))])
        return clamped_knots(self.degree, breaks / breaks[-1])

    def t_norm_at(self, h: np.ndarray) -> np.ndarray:
        """Collocation points for interval lengths `h`."""
        return (np.cumsum(h) - h)[self._interval] + self._fraction * h[self._interval]

    def lengths_of(self, knots: np.ndarray) -> np.ndarray:
        """Lengths of the intervals between given knots."""
        return np.diff(knots[self.degree : len(knots) - self.degree])

    def _lengths_around(self, h: np.ndarray) -> np.ndarray:
        return np.append(h, 0.0)[self._around]

    def basis(self, h: np.ndarray) -> LocalBasis:
        """Basis functions at the collocation points; kept until `h` changes."""
        return self._basis_at(h)

    def _find_basis(self, h: np.ndarray) -> LocalBasis:
        values = basis_functions(self._lengths_around(h), self._fraction)
        return LocalBasis(self._interval, values)

    def slopes(self, h: np.ndarray, control_points: np.ndarray) -> np.ndarray:
        """Differentiate splines by the 2 d - 1 lengths around each collocation point."""
        derivatives = basis_derivatives(self._lengths_around(h), self._fraction)
        points = control_points[:, self.basis(h).columns]
        slopes = np.einsum("oikw,ckw->okic", derivatives, points)
        return slopes[:, self._inside]

    def fix(self, h: np.ndarray) -> FixedGrid:
        """Return the grid with fixed knots, in normalised time."""
        t_norm = self.t_norm_at(h)
        return FixedGrid(self.knots_at(h), self.degree, t_norm / t_norm[-1])

    def mean_weights(self, h: np.ndarray) -> np.ndarray:
        """Weights of the mean over time: those of every interval times its length."""
        return h @ self._interval_weights

    @property
    def mean_slopes(self) -> np.ndarray:
        """Derivatives of `mean_weights` by h: the weights of every interval."""
        return self._interval_weights
