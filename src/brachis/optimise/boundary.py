"""Splines whose first and last control points are fixed or tied by the boundary conditions.

    control points = S free + fixed + T rate,    with T the duration

A clamped spline begins like the straight line y0 + v t, with v given and the derivatives after the first zero up to the
k-th one, where its first k + 1 control points are those of the line: y0 + v T xi_i, with xi the Greville abscissae. At
rest, v = 0, these are equal. The other control points fade from the line, v T xi_i (1 - xi_i)^2, plus what is free of
them: this changes no motion, but lets a longer duration alone leave the curve smooth, which solvers need. What
derivatives have in common at a seam is linear in the control points too (see `periodic`). Boundary conditions therefore
need no rows in the NLP.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.optimise.bspline import ORDERS, local_basis


@dataclass(frozen=True)
class EndCondition:
    """What is given of a spline at one of its ends.

    Attributes
    ----------
    value : float
        NaN where free.
    rate : float
        First derivative per second; NaN where free.
    derivatives : int
        With a rate: how many derivatives are given, those after the first one as zero.
    """

    value: float
    rate: float
    derivatives: int


@dataclass(frozen=True)
class BoundarySpline:
    """A scalar spline over normalised time with boundary conditions built in.

    Attributes
    ----------
    knots : (N + 2 d + 1,) ndarray
    degree : int
        d.
    matrix : (N + d, free) ndarray
        S.
    fixed : (N + d,) ndarray
        What the control points have besides.
    rate : (N + d,) ndarray
        And what they have for every second of the duration.
    """

    knots: np.ndarray
    degree: int
    matrix: np.ndarray
    fixed: np.ndarray
    rate: np.ndarray

    @classmethod
    def between(
        cls, knots: np.ndarray, degree: int, start: EndCondition, end: EndCondition
    ) -> BoundarySpline:
        """Build a spline with conditions at both ends."""
        abscissae = greville(knots, degree)
        count = len(abscissae)
        # Control points of one group are one variable; those of group -1 are fixed.
        group = np.arange(count)
        fixed = np.zeros(count)
        rate = np.zeros(count)
        given = [
            1 if np.isnan(own.rate) else 1 + own.derivatives for own in (start, end)
        ]
        first = slice(None, given[0])
        last = slice(count - given[1], None)
        sides = ((start, 0, first, last), (end, count - 1, last, first))
        for condition, anchor, own, other in sides:
            group[own] = anchor if np.isnan(condition.value) else -1
            fixed[own] = np.nan_to_num(condition.value)
            away = abscissae - abscissae[anchor]
            fading = away * (1.0 - np.abs(away)) ** 2
            fading[own] = away[own]
            fading[other] = 0.0
            rate += np.nan_to_num(condition.rate) * fading
        free = np.unique(group[group >= 0])
        matrix = (group[:, None] == free).astype(float)
        return cls(knots, degree, matrix, fixed, rate)

    @property
    def free(self) -> int:
        """Number of free variables."""
        return self.matrix.shape[1]

    @property
    def greville(self) -> np.ndarray:
        """Greville abscissae (N + d,): the normalised times to which the control points belong."""
        return greville(self.knots, self.degree)

    def control_points(self, free: np.ndarray, duration: float) -> np.ndarray:
        """Control points (N + d,) from the free variables and the duration, s."""
        return np.asarray(self.matrix @ free + self.fixed + duration * self.rate)

    def free_from(self, control_points: np.ndarray, duration: float) -> np.ndarray:
        """Free variables that come nearest to given control points: means over those that are one variable each."""
        own_part = control_points - self.fixed - duration * self.rate
        is_alone = np.count_nonzero(self.matrix, axis=1) == 1
        is_alone &= self.matrix.max(axis=1, initial=0.0) == 1.0
        own = self.matrix[is_alone]
        return np.asarray(own_part[is_alone] @ own / own.sum(axis=0))

    def end_variable(self, point: int) -> int:
        """Variable that the value at the start (`point` 0) or end (-1) is; -1 where that is fixed."""
        return int(np.argmax(self.matrix[point])) if self.matrix[point].any() else -1


def greville(knots: np.ndarray, degree: int) -> np.ndarray:
    """Return the Greville abscissae (N + d,) of a clamped knot vector."""
    windows = np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree)
    return np.asarray(windows.mean(axis=1))


def periodic(
    knots: np.ndarray, degree: int, start: float, jump: float
) -> BoundarySpline:
    """Build a spline whose value at the end is that at the start plus a jump, and whose derivatives are the same.

    These are all that continue within the spline, the first three at most. With A and B the derivatives, from the value
    on, as functions of the first and the last p + 1 control points, the last ones are B^-1 A times the first ones, plus
    the jump.

    Parameters
    ----------
    knots, degree
        See `BoundarySpline`.
    start : float
        Value at the start, NaN where free.
    jump : float
    """
    orders = min(degree, ORDERS)
    _, derivatives = local_basis(knots, degree, np.array([0.0, 1.0]))
    first = derivatives[:orders, 0, :orders]
    last = derivatives[:orders, 1, -orders:]
    free = len(knots) - degree - 1 - orders
    matrix = np.eye(free + orders, free)
    matrix[free:, :orders] = np.linalg.solve(last, first)
    matrix[-1] = np.eye(free)[0]  # the value itself, without rounding
    fixed = np.zeros(len(matrix))
    fixed[free:] = jump
    if not np.isnan(start):
        fixed += start * matrix[:, 0]
        matrix = matrix[:, 1:]
    return BoundarySpline(knots, degree, matrix, fixed, np.zeros(len(matrix)))


@dataclass(frozen=True)
class Boundary:
    """Boundary conditions of curves.

    Attributes
    ----------
    start, end : (c,) ndarray
        Values of the curves there, NaN where free.
    derivatives : int
        How many derivatives are given at each end: 1 for velocity, 2 for acceleration too, 3 for jerk.
    start_rates, end_rates : (c,) ndarray or None
        First derivatives there per second, NaN where free; None at rest. The further ones that are given are zero.
    periodic : bool
        Whether the end continues as the start begins, in derivatives too; nothing else is given of these then. Values
        that are given at both ends say by how much the end is ahead.
    """

    start: np.ndarray
    end: np.ndarray
    derivatives: int
    start_rates: np.ndarray | None = None
    end_rates: np.ndarray | None = None
    periodic: bool = False

    def splines(self, knots: np.ndarray, degree: int) -> tuple[BoundarySpline, ...]:
        """Build the conditions into splines."""
        if self.periodic:
            pairs = zip(self.start, np.nan_to_num(self.end - self.start), strict=True)
            return tuple(periodic(knots, degree, *pair) for pair in pairs)
        rest = np.zeros(len(self.start))
        first_rates = rest if self.start_rates is None else self.start_rates
        last_rates = rest if self.end_rates is None else self.end_rates
        columns = zip(self.start, first_rates, self.end, last_rates, strict=True)
        return tuple(
            BoundarySpline.between(
                knots,
                degree,
                EndCondition(start, first, self.derivatives),
                EndCondition(end, last, self.derivatives),
            )
            for start, first, end, last in columns
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
        # Rounding must not choose the side of a knot: the highest derivative jumps there.
        breaks = np.unique(knots)
        place = np.searchsorted(breaks, t_norm - 1e-13).clip(max=len(breaks) - 1)
        near = breaks[place]
        at = np.where(np.abs(near - t_norm) <= 1e-13, near, t_norm)
        first, values = local_basis(knots, degree, at)
        return cls(first[:, None] + np.arange(degree + 1), values)

    def curves(self, control_points: np.ndarray) -> np.ndarray:
        """Value and three derivatives (4, K, c) of c splines with control points (c, N + d)."""
        points = control_points[:, self.columns]
        return np.asarray(np.einsum("okw,ckw->okc", self.values, points))


@dataclass(frozen=True)
class SparsityPattern:
    """Where the free variables of a spline matter: each pair of a time and a variable once.

    Attributes
    ----------
    point, variable : (z,) int ndarray
    """

    point: np.ndarray
    variable: np.ndarray
    _terms: tuple[np.ndarray, np.ndarray]
    _place: np.ndarray
    _weight: np.ndarray

    @classmethod
    def of(cls, columns: np.ndarray, spline: BoundarySpline) -> SparsityPattern:
        """Find the places of a spline's local basis, whose `columns` are (K, d + 1)."""
        weights = spline.matrix[columns]
        point, function, variable = np.nonzero(weights)
        numbers = point * spline.free + variable
        unique, place = np.unique(numbers, return_inverse=True)
        weight = weights[point, function, variable]
        own_point, own_variable = np.divmod(unique, max(spline.free, 1))
        return cls(own_point, own_variable, (point, function), place, weight)

    def entries(self, values: np.ndarray) -> np.ndarray:
        """Differentiate value and three derivatives by the free variables, (4, z); `values` are (4, K, d + 1)."""
        terms = self._weight * values[:, *self._terms]
        count = len(self.point)
        return np.array([np.bincount(self._place, own, count) for own in terms])
