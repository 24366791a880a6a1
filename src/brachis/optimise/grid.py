"""Where the knots and the collocation points lie: fixed, or moved by the interval lengths h as variables of the NLP.

Collocation points keep their place (interval, fraction of it). Where the knots are free, h = (h_1, ..., h_N) are
variables at the end of x, in normalised time: bounded from below, and with a row that holds their sum at 1. The
collocation points then move with the knots, and the basis functions at a point depend on the 2 d - 1 intervals around
it. Both kinds of grid answer for both cases: a fixed one has no variables, no rows and empty derivatives.

Weights by which values at collocation points are integrated over normalised time.

The motion is smooth within a knot interval and not across its ends, so every interval is integrated for itself: over
each step between neighbouring points the cubic through the four nearest ones. Points that lie much closer together
than the others of their interval are skipped: cubics through them would swing.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np

from brachis.optimise.boundary import LocalBasis
from brachis.optimise.bspline import (
    ORDERS,
    basis_derivatives,
    basis_functions,
    clamped_knots,
)

_SAME_TIME = 1e-12
_STENCIL = 4
_CLOSE = 0.5
"""Points are skipped that follow another one by less than this part of the interval's median step."""
_CONTINUOUS_ACCELERATION = 3
"""Least degree with which the values at the end of an interval belong to it as well as to the next one."""


def interval_weights(breaks: np.ndarray, t_norm: np.ndarray, degree: int) -> np.ndarray:
    """Weights for integrals over each knot interval, taken to be of length 1.

    Parameters
    ----------
    breaks : (N + 1,) ndarray
        Ends of the intervals.
    t_norm : (K,) ndarray
        Points, ascending, all breaks among them.
    degree : int
        Of the splines.

    Returns
    -------
    (N, K) ndarray
        ``diff(breaks) @ weights`` are the weights of the integral over all.
    """
    weights = np.zeros((len(breaks) - 1, len(t_norm)))
    for row, low, high in zip(weights, breaks[:-1], breaks[1:], strict=True):
        inside = np.flatnonzero(
            (t_norm > low - _SAME_TIME) & (t_norm < high + _SAME_TIME)
        )
        if degree < _CONTINUOUS_ACCELERATION and high < breaks[-1]:
            inside = inside[:-1]
        kept = inside[_spaced((t_norm[inside] - low) / (high - low))]
        row[kept] = _weights((t_norm[kept] - low) / (high - low))
    return weights


def _spaced(u: np.ndarray) -> np.ndarray:
    """Numbers of places u, ascending, without those that follow another one too closely; both ends are kept."""
    least = _CLOSE * float(np.median(np.diff(u))) if len(u) > 1 else 0.0
    kept = [0]
    for number in range(1, len(u) - 1):
        if u[number] - u[kept[-1]] >= least and u[-1] - u[number] >= least:
            kept.append(number)
    return np.array(kept if len(u) == 1 else [*kept, len(u) - 1])


def _weights(u: np.ndarray) -> np.ndarray:
    """Weights, (P,), of the integral over [0, 1] of the cubics through values at places u, (P,)."""
    count = min(_STENCIL, len(u))
    ends = np.concatenate([[0.0], u[1:-1], [1.0]])[: max(len(u), 2)]
    weights = np.zeros(len(u))
    powers = np.arange(count)
    for step in range(len(ends) - 1):
        first = int(np.clip(step - 1, 0, len(u) - count))
        stencil = slice(first, first + count)
        middle = ends[step]
        moments = np.diff(
            [
                (end - middle) ** (powers + 1) / (powers + 1)
                for end in ends[step : step + 2]
            ],
            axis=0,
        )[0]
        weights[stencil] += np.linalg.solve(
            np.vander(u[stencil] - middle, count, increasing=True).T, moments
        )
    return weights


class Grid(Protocol):
    """Knots and collocation points as functions of the interval lengths h, (v,), that are variables.

    Attributes
    ----------
    degree : int
    knots : (N + 2 d + 1,) ndarray
        In normalised time; where they are variables, at the lengths that the grid was made with.
    t_norm : (K,) ndarray
        Collocation points in normalised time, ascending, from 0 to 1; as `knots`.
    lower, upper : (v,) ndarray
        Bounds on h.
    total : (0,) or (1,) ndarray
        What rows of sums of h must be.
    point, variable : (z,) int ndarray
        Pattern of the curves' derivatives with respect to h, each place once.
    """

    degree: int
    knots: np.ndarray
    t_norm: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    total: np.ndarray
    point: np.ndarray
    variable: np.ndarray

    def knots_at(self, h: np.ndarray) -> np.ndarray:
        """Knots, in units of h."""
        ...

    def t_norm_at(self, h: np.ndarray) -> np.ndarray:
        """Collocation points, in units of h."""
        ...

    def lengths_of(self, knots: np.ndarray) -> np.ndarray:
        """Variables h that belong to given knots."""
        ...

    def basis(self, h: np.ndarray) -> LocalBasis:
        """Basis functions at the collocation points; the same object as long as they are the same."""
        ...

    def slopes(self, h: np.ndarray, control_points: np.ndarray) -> np.ndarray:
        """Differentiate value and three derivatives of splines (c, N + d) by h, on the pattern, (4, z, c)."""
        ...

    def frozen(self, h: np.ndarray) -> Grid:
        """Return the grid with its knots fixed where they are at `h`."""
        ...

    def mean_weights(self, h: np.ndarray) -> np.ndarray:
        """Weights, (K,), of the mean over time of what is known at the collocation points."""
        ...

    @property
    def mean_slopes(self) -> np.ndarray:
        """Derivatives of `mean_weights` by h, (v, K)."""
        ...


class FixedGrid:
    """Knots that are given; see `Grid`."""

    lower = upper = total = np.empty(0)
    point = variable = np.empty(0, dtype=int)

    def __init__(self, knots: np.ndarray, degree: int, t_norm: np.ndarray) -> None:
        self.knots = knots
        self.degree = degree
        self.t_norm = t_norm
        self._basis = LocalBasis.of(knots, degree, t_norm)

    def knots_at(self, _h: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return self.knots

    def t_norm_at(self, _h: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return self.t_norm

    def lengths_of(self, _knots: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return np.empty(0)

    def basis(self, _h: np.ndarray) -> LocalBasis:
        """See `Grid`."""
        return self._basis

    def slopes(self, _h: np.ndarray, control_points: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return np.empty((ORDERS, 0, len(control_points)))

    def frozen(self, _h: np.ndarray) -> FixedGrid:
        """See `Grid`."""
        return self

    def mean_weights(self, _h: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return self._weights

    @property
    def mean_slopes(self) -> np.ndarray:
        """See `Grid`."""
        return np.empty((0, len(self.t_norm)))

    @cached_property
    def _weights(self) -> np.ndarray:
        breaks = self.knots[self.degree : len(self.knots) - self.degree]
        return np.asarray(
            np.diff(breaks) @ interval_weights(breaks, self.t_norm, self.degree)
        )


class FreeGrid:
    """Knots that are variables; see `Grid`.

    Parameters
    ----------
    knots, degree, t_norm
        See `Grid`.
    shortest : float
        Least length of an interval, in normalised time.
    """

    total = np.ones(1)

    def __init__(
        self, knots: np.ndarray, degree: int, t_norm: np.ndarray, shortest: float
    ) -> None:
        self.knots = knots
        self.degree = degree
        self.t_norm = t_norm
        breaks = knots[degree : len(knots) - degree]
        count = len(breaks) - 1
        self.lower = np.full(count, shortest)
        self.upper = np.ones(count)
        self._interval = np.clip(
            np.searchsorted(breaks, t_norm, side="right") - 1, 0, count - 1
        )
        self._fraction = (t_norm - breaks[self._interval]) / np.diff(breaks)[
            self._interval
        ]
        around = self._interval[:, None] + np.arange(1 - degree, degree)
        self._inside = (around >= 0) & (around < count)
        self._around = np.where(
            self._inside, around, count
        )  # beyond the ends: an interval without length
        self._columns = self._interval[:, None] + np.arange(degree + 1)
        self.point, _ = np.nonzero(self._inside)
        self.variable = around[self._inside]
        self._last: tuple[bytes, LocalBasis] | None = None

    def knots_at(self, h: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        breaks = np.concatenate([[0.0], np.cumsum(np.maximum(h, self.lower))])
        return clamped_knots(self.degree, breaks / breaks[-1])

    def t_norm_at(self, h: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return (np.cumsum(h) - h)[self._interval] + self._fraction * h[self._interval]

    def lengths_of(self, knots: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return np.diff(knots[self.degree : len(knots) - self.degree])

    def _lengths_around(self, h: np.ndarray) -> np.ndarray:
        return np.append(h, 0.0)[self._around]

    def basis(self, h: np.ndarray) -> LocalBasis:
        """See `Grid`."""
        key = h.tobytes()
        if self._last is None or self._last[0] != key:
            values = basis_functions(self._lengths_around(h), self._fraction)
            self._last = key, LocalBasis(self._columns, values)
        return self._last[1]

    def slopes(self, h: np.ndarray, control_points: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        derivatives = basis_derivatives(self._lengths_around(h), self._fraction)
        slopes = np.einsum(
            "oikw,ckw->okic", derivatives, control_points[:, self._columns]
        )
        return np.asarray(slopes[:, self._inside])

    def frozen(self, h: np.ndarray) -> FixedGrid:
        """See `Grid`."""
        t_norm = self.t_norm_at(h)
        return FixedGrid(self.knots_at(h), self.degree, t_norm / t_norm[-1])

    def mean_weights(self, h: np.ndarray) -> np.ndarray:
        """See `Grid`."""
        return np.asarray(h @ self.mean_slopes)

    @cached_property
    def mean_slopes(self) -> np.ndarray:
        """See `Grid`: points keep their places in their intervals."""
        breaks = self.knots[self.degree : len(self.knots) - self.degree]
        return interval_weights(breaks, self.t_norm, self.degree)
