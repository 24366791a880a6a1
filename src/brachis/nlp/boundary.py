"""Splines whose first and last control points are fixed or tied by the boundary conditions.

For a clamped spline, zero velocity at an end means that the first two control points there are equal, and zero
acceleration besides that the first three are, zero
jerk the first four. Boundary conditions therefore need no rows in the NLP: control points at
an end share one free variable, or are fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.bspline import local_basis

_SAME_TIME = 1e-13
"""Normalised times this near to a knot are at the knot."""


@dataclass(frozen=True)
class BoundarySpline:
    """A scalar spline over normalised time with boundary conditions built in.

    Attributes
    ----------
    knots : (N + 2 d + 1,) ndarray
    degree : int
        d.
    variable : (N + d,) int ndarray
        Free variable of every control point, -1 for a fixed one.
    fixed : (N + d,) ndarray
        Value of the fixed control points, 0 for the others.
    """

    knots: np.ndarray
    degree: int
    variable: np.ndarray
    fixed: np.ndarray

    @classmethod
    def resting(cls, knots: np.ndarray, degree: int, *, derivatives: int, start: float, end: float) -> BoundarySpline:
        """Build a spline at rest at both ends.

        Parameters
        ----------
        knots, degree
            See the attributes.
        derivatives : int
            How many derivatives vanish at each end: 1 for velocity, 2 for acceleration too, 3 for jerk.
        start, end : float
            Value at the end in question, NaN where free.
        """
        count = len(knots) - degree - 1
        still = derivatives + 1
        group = np.clip(np.arange(count), still - 1, count - still)
        fixed = np.zeros(count)
        for value, ends in ((start, slice(None, still)), (end, slice(count - still, None))):
            if not np.isnan(value):
                fixed[ends] = value
                group[ends] = -1
        variable = np.full(count, -1)
        _, variable[group >= 0] = np.unique(group[group >= 0], return_inverse=True)
        return cls(knots, degree, variable, fixed)

    @property
    def free(self) -> int:
        """Number of free variables."""
        return int(self.variable.max()) + 1

    @property
    def greville(self) -> np.ndarray:
        """Greville abscissae (N + d,): the normalised times to which the control points belong."""
        windows = np.lib.stride_tricks.sliding_window_view(self.knots[1:-1], self.degree)
        return np.asarray(windows.mean(axis=1))

    def control_points(self, free: np.ndarray) -> np.ndarray:
        """Control points (N + d,) from the free variables."""
        return np.where(self.variable >= 0, free[self.variable], self.fixed)

    def free_from(self, control_points: np.ndarray) -> np.ndarray:
        """Free variables that come nearest to given control points (mean over tied ones)."""
        kept = self.variable >= 0
        sums = np.bincount(self.variable[kept], weights=control_points[kept])
        return np.asarray(sums / np.bincount(self.variable[kept]))


@dataclass(frozen=True)
class Boundary:
    """Boundary conditions of curves that rest at both ends.

    Attributes
    ----------
    start, end : (c,) ndarray
        Values of the curves there, NaN where free.
    derivatives : int
        How many derivatives vanish at each end: 1 for velocity, 2 for acceleration too, 3 for jerk.
    """

    start: np.ndarray
    end: np.ndarray
    derivatives: int

    def splines(self, knots: np.ndarray, degree: int) -> tuple[BoundarySpline, ...]:
        """Build the conditions into splines."""
        pairs = zip(self.start, self.end, strict=True)
        return tuple(
            BoundarySpline.resting(knots, degree, derivatives=self.derivatives, start=start, end=end)
            for start, end in pairs
        )


@dataclass(frozen=True)
class LocalBasis:
    """Basis functions of value and three derivatives at K times.

    Attributes
    ----------
    columns : (K, d + 1) int ndarray
        Control points that matter at each time.
    values : (4, K, d + 1) ndarray
        Per unit of normalised time.
    """

    columns: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, knots: np.ndarray, degree: int, t_norm: np.ndarray) -> LocalBasis:
        """Sample the basis at normalised times `t_norm`, (K,); at knots behind them."""
        breaks = np.unique(knots)
        near = breaks[np.searchsorted(breaks, t_norm - _SAME_TIME).clip(max=len(breaks) - 1)]
        # Rounding must not choose the side of a knot: the highest derivative jumps there.
        first, values = local_basis(knots, degree, np.where(np.abs(near - t_norm) <= _SAME_TIME, near, t_norm))
        return cls(first[:, None] + np.arange(degree + 1), values)

    def curves(self, control_points: np.ndarray) -> np.ndarray:
        """Value and three derivatives (4, K, c) of c splines with control points (c, N + d)."""
        return np.asarray(np.einsum("okw,ckw->okc", self.values, control_points[:, self.columns]))


@dataclass(frozen=True)
class SparsityPattern:
    """Where the free variables of a spline matter: each pair of a time and a variable once.

    Attributes
    ----------
    point, variable : (z,) int ndarray
    """

    point: np.ndarray
    variable: np.ndarray
    _kept: np.ndarray
    _place: np.ndarray

    @classmethod
    def of(cls, columns: np.ndarray, spline: BoundarySpline) -> SparsityPattern:
        """Find the places of a spline's local basis, whose `columns` are (K, d + 1)."""
        variable = spline.variable[columns]
        kept = variable >= 0
        numbers = (np.arange(len(variable))[:, None] * spline.free + variable)[kept]
        unique, place = np.unique(numbers, return_inverse=True)
        return cls(unique // spline.free, unique % spline.free, kept, place)

    def entries(self, values: np.ndarray) -> np.ndarray:
        """Differentiate value and three derivatives by the free variables, (4, z); `values` are (4, K, d + 1)."""
        return np.array([np.bincount(self._place, weights=value[self._kept]) for value in values])
