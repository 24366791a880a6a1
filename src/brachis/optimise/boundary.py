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

_SAME_TIME = 1e-13
"""Normalised times this near to a knot are at the knot."""


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
    variable : (N + d, w) int ndarray
        Free variables that make up every control point, -1 for none.
    weight : (N + d, w) ndarray
        Their weights; rows of S.
    fixed : (N + d,) ndarray
        What the control points have besides.
    rate : (N + d,) ndarray
        And what they have for every second of the duration.
    """

    knots: np.ndarray
    degree: int
    variable: np.ndarray
    weight: np.ndarray
    fixed: np.ndarray
    rate: np.ndarray

    @classmethod
    def between(
        cls, knots: np.ndarray, degree: int, start: EndCondition, end: EndCondition
    ) -> BoundarySpline:
        """Build a spline with conditions at both ends."""
        abscissae = greville(knots, degree)
        count = len(abscissae)
        group = np.arange(count)
        fixed = np.zeros(count)
        rate = np.zeros(count)
        first, last = (
            1 if np.isnan(each.rate) else 1 + each.derivatives for each in (start, end)
        )
        ends = slice(None, first), slice(count - last, None)
        for condition, anchor, own, other in (
            (start, 0, *ends),
            (end, count - 1, *ends[::-1]),
        ):
            group[own] = anchor if np.isnan(condition.value) else -1
            fixed[own] = np.nan_to_num(condition.value)
            away = abscissae - abscissae[anchor]
            fading = away * (1.0 - np.abs(away)) ** 2
            fading[own] = away[own]
            fading[other] = 0.0
            rate += np.nan_to_num(condition.rate) * fading
        variable = np.full(count, -1)
        _, variable[group >= 0] = np.unique(group[group >= 0], return_inverse=True)
        return cls(knots, degree, variable[:, None], np.ones((count, 1)), fixed, rate)

    @property
    def free(self) -> int:
        """Number of free variables."""
        return int(self.variable.max()) + 1

    @property
    def greville(self) -> np.ndarray:
        """Greville abscissae (N + d,): the normalised times to which the control points belong."""
        return greville(self.knots, self.degree)

    @property
    def matrix(self) -> np.ndarray:
        """S, (N + d, free)."""
        matrix = np.zeros((len(self.fixed), self.free))
        point, entry = np.nonzero(self.variable >= 0)
        np.add.at(
            matrix, (point, self.variable[point, entry]), self.weight[point, entry]
        )
        return matrix

    def control_points(self, free: np.ndarray, duration: float) -> np.ndarray:
        """Control points (N + d,) from the free variables and the duration, s."""
        or_none = np.append(free, 0.0)  # which -1 points at
        parts = self.weight * or_none[self.variable]
        return np.asarray(parts.sum(axis=1) + self.fixed + duration * self.rate)

    def free_from(self, control_points: np.ndarray, duration: float) -> np.ndarray:
        """Free variables that come nearest to given control points: means over those that are one variable each."""
        own_part = control_points - self.fixed - duration * self.rate
        alone = (
            ((self.variable >= 0).sum(axis=1) == 1)
            & (self.weight[:, 0] == 1.0)
            & (self.variable[:, 0] >= 0)
        )
        own = self.variable[alone, 0]
        return np.asarray(np.bincount(own, weights=own_part[alone]) / np.bincount(own))


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
    count = len(knots) - degree - 1
    variable = np.full((count, orders), -1)
    weight = np.zeros((count, orders))
    fixed = np.zeros(count)
    variable[: count - orders, 0] = np.arange(count - orders)
    weight[: count - orders, 0] = 1.0
    variable[count - orders :] = np.arange(orders)
    weight[count - orders :] = np.linalg.solve(last, first)
    fixed[count - orders :] = jump
    weight[-1], variable[-1, 1:] = (
        np.eye(orders)[0],
        -1,
    )  # the value itself, without rounding
    if not np.isnan(start):
        fixed += start * np.where(variable == 0, weight, 0.0).sum(axis=1)
        variable -= 1
    return BoundarySpline(
        knots, degree, np.maximum(variable, -1), weight, fixed, np.zeros(count)
    )


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
            ahead = np.nan_to_num(self.end - self.start)
            pairs = zip(self.start, ahead, strict=True)
            return tuple(
                periodic(knots, degree, float(start), float(jump))
                for start, jump in pairs
            )
        rest = np.zeros(len(self.start))
        rates = (
            rest if each is None else each
            for each in (self.start_rates, self.end_rates)
        )
        starts, ends = (
            [
                EndCondition(float(value), float(rate), self.derivatives)
                for value, rate in zip(*pair, strict=True)
            ]
            for pair in zip((self.start, self.end), rates, strict=True)
        )
        return tuple(
            BoundarySpline.between(knots, degree, *pair)
            for pair in zip(starts, ends, strict=True)
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
        near = breaks[
            np.searchsorted(breaks, t_norm - _SAME_TIME).clip(max=len(breaks) - 1)
        ]
        # Rounding must not choose the side of a knot: the highest derivative jumps there.
        first, values = local_basis(
            knots, degree, np.where(np.abs(near - t_norm) <= _SAME_TIME, near, t_norm)
        )
        return cls(first[:, None] + np.arange(degree + 1), values)

    def curves(self, control_points: np.ndarray) -> np.ndarray:
        """Value and three derivatives (4, K, c) of c splines with control points (c, N + d)."""
        return np.asarray(
            np.einsum("okw,ckw->okc", self.values, control_points[:, self.columns])
        )


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
    _weight: np.ndarray

    @classmethod
    def of(cls, columns: np.ndarray, spline: BoundarySpline) -> SparsityPattern:
        """Find the places of a spline's local basis, whose `columns` are (K, d + 1)."""
        variable = spline.variable[columns]
        kept = variable >= 0
        numbers = (np.arange(len(variable))[:, None, None] * spline.free + variable)[
            kept
        ]
        unique, place = np.unique(numbers, return_inverse=True)
        return cls(
            unique // spline.free,
            unique % spline.free,
            kept,
            place,
            spline.weight[columns][kept],
        )

    def entries(self, values: np.ndarray) -> np.ndarray:
        """Differentiate value and three derivatives by the free variables, (4, z); `values` are (4, K, d + 1)."""
        spread = np.broadcast_to(values[..., None], (len(values), *self._kept.shape))
        return np.array(
            [
                np.bincount(self._place, weights=self._weight * value[self._kept])
                for value in spread
            ]
        )
