"""Splines whose first and last control points are fixed, or tied together, by boundary conditions.

    control points = S free + sum of T^i fixed_i,    where T is the duration

Suppose the first k derivatives are given at the start. A clamped spline begins like the polynomial y0 + v t + a t^2 / 2
+ ... if its first k + 1 control points are those of the polynomial: y0 + v T b_i1 + a T^2 b_i2 + .... Here b_i1 are the
Greville abscissae and b_ij the blossoms of t^j / j!. At rest v, a, ... are zero, and these control points are equal.
In the other control points, the fixed terms of the polynomial fade out, as v T xi_i (1 - xi_i)^2, and free parts are
added. This does not restrict the motion. But if only the duration gets longer, the curve stays smooth, which solvers
need. Conditions on derivatives at a seam are also linear in the control points (see `periodic`). Boundary conditions
therefore need no rows in the NLP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from brachis.common.arrays import count_each, greville
from brachis.kernel import Basis
from brachis.optimise.bspline import ORDERS, local_basis
from brachis.path.time_law import TimeLaw


@dataclass(frozen=True)
class EndCondition:
    """Conditions on a spline at one of its ends.

    Attributes
    ----------
    value : float
        Value at the end; NaN if the value is free.
    derivatives : (k,) ndarray
        The first k time derivatives, per second; empty if they are free. They are NaN at an end at which the planner
        also chooses the speed of the motion.
    """

    value: float
    derivatives: np.ndarray

    @property
    def given(self) -> np.ndarray:
        """The derivatives that are given, (k,)."""
        return self.derivatives[np.isfinite(self.derivatives)]

    @property
    def rate(self) -> float:
        """The first derivative at the end, per second; zero if it is free."""
        return float(self.given[:1].sum())


@dataclass(frozen=True, eq=False)
class FreeMatrix:
    """The matrix S from free variables to control points. Its nonzero entries are stored in the order of its rows.

    Attributes
    ----------
    point, variable : (z,) int ndarray
        Row and column of each entry.
    weight : (z,) ndarray
        Value of each entry.
    shape : tuple of int
        Numbers of control points and of free variables.
    """

    point: np.ndarray
    variable: np.ndarray
    weight: np.ndarray
    shape: tuple[int, int]

    @classmethod
    def of(cls, matrix: np.ndarray) -> FreeMatrix:
        """Store the nonzero entries of a dense matrix, (N + d, free)."""
        point, variable = np.nonzero(matrix)
        return cls(point, variable, matrix[point, variable], matrix.shape)

    @cached_property
    def counts(self) -> np.ndarray:
        """Number of entries in each row, (N + d,)."""
        return np.bincount(self.point, minlength=self.shape[0])

    def control_points(self, free: np.ndarray) -> np.ndarray:
        """Return the contribution of the free variables to the control points, (N + d,)."""
        terms = self.weight * free[self.variable]
        return np.bincount(self.point, terms, self.shape[0])

    def dense(self) -> np.ndarray:
        """Return S as a dense matrix, (N + d, free)."""
        matrix = np.zeros(self.shape)
        matrix[self.point, self.variable] = self.weight
        return matrix


@dataclass(frozen=True)
class BoundarySpline:
    """A scalar spline of degree d over normalised time, with boundary conditions built in.

    Attributes
    ----------
    free_matrix : FreeMatrix
        The matrix S.
    fixed_terms : (1 + p, N + d) ndarray
        Fixed terms of the control points, one row for each power of the duration up to p, the highest that is needed.
    """

    free_matrix: FreeMatrix
    fixed_terms: np.ndarray

    @classmethod
    def between(
        cls, knots: np.ndarray, degree: int, start: EndCondition, end: EndCondition
    ) -> BoundarySpline:
        """Build a spline with conditions at both ends."""
        count = len(knots) - degree - 1
        # All control points of a group are a single variable. Control points of group -1 are fixed.
        group = np.arange(count)
        numbers = [1 + len(condition.given) for condition in (start, end)]
        terms = np.zeros((max(numbers), count))
        first = slice(None, numbers[0])
        last = slice(count - numbers[1], None)
        sides = ((start, 0, first, last), (end, count - 1, last, first))
        for condition, anchor, near, far in sides:
            group[near] = anchor if np.isnan(condition.value) else -1
            terms[0, near] = np.nan_to_num(condition.value)
            blossoms = _blossoms(knots, degree, anchor, len(condition.given))
            for power, derivative in enumerate(condition.given, 1):
                fading = blossoms[power] * (1.0 - np.abs(blossoms[1])) ** 2
                fading[near] = blossoms[power][near]
                fading[far] = 0.0
                terms[power] += derivative * fading
        points = np.flatnonzero(group >= 0)
        variables = np.unique(group[points], return_inverse=True)[1]
        shape = (count, int(variables.max(initial=-1)) + 1)
        matrix = FreeMatrix(points, variables, np.ones(len(points)), shape)
        powers = np.flatnonzero(terms[1:].any(axis=1)) + 1
        return cls(matrix, terms[: 1 + powers.max(initial=0)])

    @property
    def free(self) -> int:
        """Number of free variables."""
        return self.free_matrix.shape[1]

    def fixed_points(self, duration: float) -> np.ndarray:
        """Return the contribution of the boundary conditions to the control points, (N + d,)."""
        return sum_powers(self.fixed_terms, duration)

    def control_points(self, free: np.ndarray, duration: float) -> np.ndarray:
        """Compute the control points, (N + d,), from the free variables and the duration, s."""
        return self.free_matrix.control_points(free) + self.fixed_points(duration)

    def free_from(self, control_points: np.ndarray, duration: float) -> np.ndarray:
        """Return free variables for given control points. A variable shared by several points is set to their mean."""
        free_points = control_points - self.fixed_points(duration)
        matrix = self.free_matrix
        is_alone = (matrix.counts[matrix.point] == 1) & (matrix.weight == 1.0)
        variable = matrix.variable[is_alone]
        sums = np.bincount(variable, free_points[matrix.point[is_alone]], self.free)
        return sums / np.bincount(variable, minlength=self.free)


def stack_splines(
    splines: Sequence[BoundarySpline],
    slices: Sequence[slice],
    count: int,
    variables: int,
) -> tuple[FreeMatrix, np.ndarray]:
    """Stack splines over the same knots. The control points of each spline follow those of the one before it.

    Parameters
    ----------
    splines : sequence of BoundarySpline
    slices : sequence of slice
        Positions of each spline's free variables among all variables.
    count, variables : int
        Numbers of control points of each spline, and of all variables.

    Returns
    -------
    stacked : FreeMatrix
        Matrix with respect to all variables.
    terms : (1 + k, all control points) ndarray
        Fixed terms, one row for each power of the duration.
    """
    powers = max((len(spline.fixed_terms) for spline in splines), default=1)
    terms = np.zeros((powers, len(splines), count))
    points = [np.empty(0, dtype=int)]
    columns = [np.empty(0, dtype=int)]
    weights = [np.empty(0)]
    for number, (spline, block) in enumerate(zip(splines, slices, strict=True)):
        matrix = spline.free_matrix
        terms[: len(spline.fixed_terms), number] = spline.fixed_terms
        points.append(number * count + matrix.point)
        columns.append(block.start + matrix.variable)
        weights.append(matrix.weight)
    stacked = FreeMatrix(
        np.concatenate(points),
        np.concatenate(columns),
        np.concatenate(weights),
        (len(splines) * count, variables),
    )
    return stacked, terms.reshape(powers, -1)


def sum_powers(
    terms: np.ndarray, duration: float, *, slope: bool = False
) -> np.ndarray:
    """Add up terms, (1 + k, p), times the powers of a duration, s. If `slope`, return the derivative of this sum.

    Do not write to the returned array.
    """
    if len(terms) == 1:
        return np.zeros_like(terms[0]) if slope else terms[0]
    powers = np.arange(len(terms))
    if slope:
        return (powers[1:] * duration ** powers[:-1]) @ terms[1:]
    return duration**powers @ terms


def _blossoms(knots: np.ndarray, degree: int, anchor: int, highest: int) -> np.ndarray:
    """Return control points of t^j / j!, for j up to `highest`, with t = 0 at the end to which `anchor` belongs.

    The blossom of t^j / j! is e_j (d - j)! / d!, where e_j is the elementary symmetric polynomial of the d knots of a
    control point.

    Returns
    -------
    (1 + highest or 2, N + d) ndarray
    """
    abscissae = greville(knots, degree)
    windows = sliding_window_view(knots[1:-1], degree)
    windows = windows - abscissae[anchor]
    symmetric = np.zeros((degree + 1, len(windows)))
    symmetric[0] = 1.0
    for column in windows.T:
        symmetric[1:] += column * symmetric[:-1]
    blossoms = np.empty((max(highest, 1) + 1, len(windows)))
    size = 1.0
    for j in range(len(blossoms)):
        blossoms[j] = symmetric[j] / size
        size *= degree - j
    blossoms[1] = abscissae - abscissae[anchor]
    return blossoms


def periodic(
    knots: np.ndarray, degree: int, start: float, jump: float
) -> BoundarySpline:
    """Build a spline with equal derivatives at both ends, whose value at the end is ahead of the start by a jump.

    The derivatives that are made equal are those that are continuous within the spline, at most the first three. Let A
    and B be the matrices that give the value and derivatives from the first and the last p + 1 control points. The last
    control points are then B^-1 A times the first ones, plus the jump.

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
    degree : int
        d.
    start : float
        Value at the start; NaN if it is free.
    jump : float
        Value at the end minus value at the start.
    """
    orders = min(degree, ORDERS)
    _, derivatives = local_basis(knots, degree, np.array([0.0, 1.0]))
    first = derivatives[:orders, 0, :orders]
    last = derivatives[:orders, 1, -orders:]
    free = len(knots) - degree - 1 - orders
    matrix = np.eye(free + orders, free)
    matrix[free:, :orders] = np.linalg.solve(last, first)
    matrix[-1] = np.eye(free)[0]  # the value itself, without rounding error
    terms = np.zeros((1, len(matrix)))
    terms[0, free:] = jump
    if not np.isnan(start):
        terms[0] += start * matrix[:, 0]
        matrix = matrix[:, 1:]
    return BoundarySpline(FreeMatrix.of(matrix), terms)


@dataclass(frozen=True)
class Boundary:
    """Boundary conditions of curves.

    Attributes
    ----------
    start, end : (c,) tuple of EndCondition
        Conditions on each curve at the start and at the end.
    periodic : bool
        Whether the motion continues smoothly from its end to its start. If so, no derivatives are given. If values are
        given at both ends, their difference is the distance by which the end is ahead of the start.
    time_law : TimeLaw or None
        Time law of s(t), if it is given. In this case the duration is given too, and the first curve has no spline.
    """

    start: tuple[EndCondition, ...]
    end: tuple[EndCondition, ...]
    periodic: bool = False
    time_law: TimeLaw | None = None

    @classmethod
    def at_rest(
        cls,
        start: np.ndarray,
        end: np.ndarray,
        derivatives: int,
        *,
        periodic: bool = False,
    ) -> Boundary:
        """Build conditions from values, (c,), NaN if free, and a number of derivatives that vanish at both ends."""
        zeros = np.zeros(derivatives)
        sides = [
            tuple(EndCondition(float(value), zeros) for value in values)
            for values in (start, end)
        ]
        return cls(sides[0], sides[1], periodic)

    @property
    def law_curves(self) -> int:
        """Number of curves that are given by a time law and therefore have no spline: 1 or 0."""
        return int(self.time_law is not None)

    @property
    def rates(self) -> tuple[float, float]:
        """First derivatives of the first curve at its start and end, 1/s; zero if they are free."""
        return self.start[0].rate, self.end[0].rate

    @property
    def are_speeds_free(self) -> tuple[bool, bool]:
        """Whether the speed of the motion is free at the start and at the end."""
        sides = (self.start, self.end)
        start, end = (np.isnan(side[0].derivatives).any() for side in sides)
        return bool(start), bool(end)

    def with_speeds(self, orders: np.ndarray | None = None) -> Boundary:
        """Return the conditions with given values and derivatives where speeds are free; at rest by default.

        Parameters
        ----------
        orders : (2, 3 or more, c) ndarray, optional
            Values, first, second, ... derivatives of the curves at the start and at the end, per second.
        """
        if not any(self.are_speeds_free):
            return self
        if orders is None:
            orders = np.zeros((2, 1 + ORDERS, len(self.start)))
            orders[:, 0] = [
                [end.value for end in side] for side in (self.start, self.end)
            ]
        sides = []
        for side, given, is_free in zip(
            (self.start, self.end), orders, self.are_speeds_free, strict=True
        ):
            changed = [
                EndCondition(of_curve[0], of_curve[1 : 1 + len(condition.derivatives)])
                for condition, of_curve in zip(side, given.T, strict=True)
            ]
            sides.append(tuple(changed) if is_free else side)
        return replace(self, start=sides[0], end=sides[1])

    @property
    def ahead(self) -> np.ndarray:
        """Distance by which the end of each curve is ahead of its start, (c,); zero if the distance is free."""
        pairs = zip(self.start, self.end, strict=True)
        return np.nan_to_num([end.value - start.value for start, end in pairs])

    def splines(self, knots: np.ndarray, degree: int) -> tuple[BoundarySpline, ...]:
        """Build splines that satisfy the conditions."""
        if self.periodic:
            jumps = zip(self.start, self.ahead, strict=True)
            return tuple(
                periodic(knots, degree, condition.value, jump)
                for condition, jump in jumps
            )
        pairs = zip(
            self.start[self.law_curves :], self.end[self.law_curves :], strict=True
        )
        return tuple(BoundarySpline.between(knots, degree, *pair) for pair in pairs)


@dataclass(frozen=True)
class LocalBasis:
    """Basis functions at K times, for the value and three derivatives of splines.

    Attributes
    ----------
    first : (K,) int ndarray
        Index of the first of the d + 1 control points that have an effect at each time.
    values : (4, K, d + 1) ndarray
        Basis functions and their derivatives, per unit of normalised time.
    """

    first: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, knots: np.ndarray, degree: int, t_norm: np.ndarray) -> LocalBasis:
        """Evaluate the basis at normalised times `t_norm`, (K,); at a knot, just after the knot."""
        # Rounding must not decide on which side of a knot a time lies, because the highest derivative jumps there.
        breaks = np.unique(knots)
        place = np.searchsorted(breaks, t_norm - 1e-13).clip(max=len(breaks) - 1)
        near = breaks[place]
        at = np.where(np.abs(near - t_norm) <= 1e-13, near, t_norm)
        return cls(*local_basis(knots, degree, at))

    @property
    def columns(self) -> np.ndarray:
        """Control points that have an effect at each time, (K, d + 1)."""
        return self.first[:, None] + np.arange(self.values.shape[2])

    def curves(self, control_points: np.ndarray) -> np.ndarray:
        """Return value and three derivatives, (4, K, c), of c splines with control points (c, N + d)."""
        return self._basis.sum(control_points)

    @cached_property
    def _basis(self) -> Basis:
        return Basis(self.values, self.first)


class SparsityPattern:
    """The times at which free variables of splines have an effect. Each pair of time and variable occurs once.

    Parameters
    ----------
    columns : (K, d + 1) int ndarray
        Control points of a spline that have an effect at each time; see `LocalBasis`.
    matrix : FreeMatrix
        Stacked matrix of splines over the same knots.
    curves : int
        Number of the splines in `matrix`.

    Attributes
    ----------
    curve, point, variable : (z,) int ndarray
        Indices of the spline, the time and the variable of each pair, spline by spline.
    """

    def __init__(self, columns: np.ndarray, matrix: FreeMatrix, curves: int) -> None:
        begins = np.cumsum(matrix.counts) - matrix.counts
        count, width = columns.shape
        firsts = np.arange(curves) * (matrix.shape[0] // max(curves, 1))
        points = (firsts[:, None, None] + columns).ravel()
        counts = matrix.counts[points]
        term = np.repeat(np.arange(len(points)), counts)
        within = count_each(counts)
        entry = begins[points][term] + within
        self._weight = matrix.weight[entry]
        row, function = np.divmod(term, width)
        self._terms = (row % count, function)
        numbers = row * matrix.shape[1] + matrix.variable[entry]
        unique, self._place = np.unique(numbers, return_inverse=True)
        unique_row, self.variable = np.divmod(unique, matrix.shape[1])
        self.curve, self.point = np.divmod(unique_row, count)

    def entries(self, values: np.ndarray) -> np.ndarray:
        """Differentiate value and derivatives, `values`, (4, K, d + 1), with respect to the free variables, (4, z)."""
        terms = self._weight * values[:, *self._terms]
        count = len(self.point)
        return np.array([np.bincount(self._place, order, count) for order in terms])
