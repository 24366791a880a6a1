"""Splines whose first and last control points are fixed or tied by the boundary conditions.

    control points = S free + sum of T^i fixed_i,    with T the duration

A clamped spline begins like the polynomial y0 + v t + a t^2 / 2 + ..., with its first k derivatives given, where its
first k + 1 control points are those of the polynomial: y0 + v T b_i1 + a T^2 b_i2 + ..., with b_i1 the Greville
abscissae and b_ij the blossoms of t^j / j!. At rest all but the first are zero, and these control points are equal. The
other ones fade from the polynomial, as v T xi_i (1 - xi_i)^2, plus what is free of them: this changes no motion, but
lets a longer duration alone leave the curve smooth, which solvers need. What derivatives have in common at a seam is
linear in the control points too (see `periodic`). Boundary conditions therefore need no rows in the NLP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from brachis.common.arrays import count_each, greville
from brachis.kernel import Basis
from brachis.optimise.bspline import ORDERS, local_basis
from brachis.path.time_law import TimeLaw


@dataclass(frozen=True)
class EndCondition:
    """What is given of a spline at one of its ends.

    Attributes
    ----------
    value : float
        NaN where free.
    derivatives : (k,) ndarray
        The first k time derivatives, in seconds; empty where they are free.
    """

    value: float
    derivatives: np.ndarray

    @property
    def rate(self) -> float:
        """The first derivative, per second; zero where it is free."""
        return float(self.derivatives[:1].sum())


@dataclass(frozen=True, eq=False)
class FreeMatrix:
    """What free variables add to control points: the matrix S, entry by entry in the order of its rows.

    Attributes
    ----------
    point, variable : (z,) int ndarray
        Row and column of each entry.
    weight : (z,) ndarray
        The entries.
    shape : tuple of int
        Numbers of control points and of free variables.
    """

    point: np.ndarray
    variable: np.ndarray
    weight: np.ndarray
    shape: tuple[int, int]

    @classmethod
    def of(cls, matrix: np.ndarray) -> FreeMatrix:
        """Take the entries of a matrix, (N + d, free)."""
        point, variable = np.nonzero(matrix)
        return cls(point, variable, matrix[point, variable], matrix.shape)

    @cached_property
    def counts(self) -> np.ndarray:
        """Numbers of entries in the rows, (N + d,)."""
        return np.bincount(self.point, minlength=self.shape[0])

    def control_points(self, free: np.ndarray) -> np.ndarray:
        """Return what free variables add to the control points, (N + d,)."""
        terms = self.weight * free[self.variable]
        return np.bincount(self.point, terms, self.shape[0])

    def dense(self) -> np.ndarray:
        """Return S with its zeros, (N + d, free)."""
        matrix = np.zeros(self.shape)
        matrix[self.point, self.variable] = self.weight
        return matrix


@dataclass(frozen=True)
class BoundarySpline:
    """A scalar spline of degree d over normalised time with boundary conditions built in.

    Attributes
    ----------
    free_matrix : FreeMatrix
        S.
    fixed_terms : (1 + p, N + d) ndarray
        Fixed terms of the control points, by powers of the duration, up to the highest one that matters, p.
    """

    free_matrix: FreeMatrix
    fixed_terms: np.ndarray

    @classmethod
    def between(
        cls, knots: np.ndarray, degree: int, start: EndCondition, end: EndCondition
    ) -> BoundarySpline:
        """Build a spline with conditions at both ends."""
        count = len(knots) - degree - 1
        # Control points of one group are one variable; those of group -1 are fixed.
        group = np.arange(count)
        numbers = [1 + len(condition.derivatives) for condition in (start, end)]
        terms = np.zeros((max(numbers), count))
        first = slice(None, numbers[0])
        last = slice(count - numbers[1], None)
        sides = ((start, 0, first, last), (end, count - 1, last, first))
        for condition, anchor, near, far in sides:
            group[near] = anchor if np.isnan(condition.value) else -1
            terms[0, near] = np.nan_to_num(condition.value)
            blossoms = _blossoms(knots, degree, anchor, len(condition.derivatives))
            for power, derivative in enumerate(condition.derivatives, 1):
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
        """Return what the boundary conditions alone make of the control points, (N + d,)."""
        return sum_powers(self.fixed_terms, duration)

    def control_points(self, free: np.ndarray, duration: float) -> np.ndarray:
        """Control points (N + d,) from the free variables and the duration, s."""
        return self.free_matrix.control_points(free) + self.fixed_points(duration)

    def free_from(self, control_points: np.ndarray, duration: float) -> np.ndarray:
        """Free variables that come nearest to given control points: means over those that are one variable each."""
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
    """Put splines over the same knots together: the control points of one follow those of the one before.

    Parameters
    ----------
    splines : sequence of BoundarySpline
    slices : sequence of slice
        Where the free variables of each are among all variables.
    count, variables : int
        Numbers of control points of each spline, and of all variables.

    Returns
    -------
    stacked : FreeMatrix
        By all variables.
    terms : (1 + k, all control points) ndarray
        By powers of the duration.
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
    """Add up terms, (1 + k, p), times the powers of a duration, s; or return the slope of the sum by the duration.

    The answer is not to be written to.
    """
    if len(terms) == 1:
        return np.zeros_like(terms[0]) if slope else terms[0]
    powers = np.arange(len(terms))
    if slope:
        return (powers[1:] * duration ** powers[:-1]) @ terms[1:]
    return duration**powers @ terms


def _blossoms(knots: np.ndarray, degree: int, anchor: int, highest: int) -> np.ndarray:
    """Control points of t^j / j!, for j up to `highest`, with t from the end of control point `anchor` on.

    The blossom of t^j / j! is the elementary symmetric polynomial e_j of a control point's d knots, over d! / (d - j)!.

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
    """Build a spline whose value at the end is that at the start plus a jump, and whose derivatives are the same.

    These are all that continue within the spline, the first three at most. With A and B the derivatives, from the value
    on, as functions of the first and the last p + 1 control points, the last ones are B^-1 A times the first ones, plus
    the jump.

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
    degree : int
        d.
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
        Of every curve.
    periodic : bool
        Whether the end continues as the start begins, in derivatives too; nothing else is given of these then. Values
        that are given at both ends say by how much the end is ahead.
    time_law : TimeLaw or None
        s(t) where it is given: then the duration is too, and the first curve has no spline.
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
        """Give values, (c,), NaN where free, with as many vanishing derivatives at both ends."""
        zeros = np.zeros(derivatives)
        sides = [
            tuple(EndCondition(float(value), zeros) for value in values)
            for values in (start, end)
        ]
        return cls(sides[0], sides[1], periodic)

    @property
    def law_curves(self) -> int:
        """Number of curves that the time law gives, and that have no spline: 1 or 0."""
        return int(self.time_law is not None)

    @property
    def rates(self) -> tuple[float, float]:
        """First derivatives of the first curve at start and end, 1/s; zero where these are free."""
        return self.start[0].rate, self.end[0].rate

    @property
    def ahead(self) -> np.ndarray:
        """By how much the end is ahead of the start, (c,); zero where that is free."""
        pairs = zip(self.start, self.end, strict=True)
        return np.nan_to_num([end.value - start.value for start, end in pairs])

    def splines(self, knots: np.ndarray, degree: int) -> tuple[BoundarySpline, ...]:
        """Build the conditions into splines."""
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
    """Basis functions of value and three derivatives at K times.

    Attributes
    ----------
    first : (K,) int ndarray
        Number of the first of the d + 1 control points that matter at each time.
    values : (4, K, d + 1) ndarray
        Per unit of normalised time.
    """

    first: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, knots: np.ndarray, degree: int, t_norm: np.ndarray) -> LocalBasis:
        """Sample the basis at normalised times `t_norm`, (K,); at knots behind them."""
        # Rounding must not choose the side of a knot: the highest derivative jumps there.
        breaks = np.unique(knots)
        place = np.searchsorted(breaks, t_norm - 1e-13).clip(max=len(breaks) - 1)
        near = breaks[place]
        at = np.where(np.abs(near - t_norm) <= 1e-13, near, t_norm)
        return cls(*local_basis(knots, degree, at))

    @property
    def columns(self) -> np.ndarray:
        """Control points that matter at each time, (K, d + 1)."""
        return self.first[:, None] + np.arange(self.values.shape[2])

    def curves(self, control_points: np.ndarray) -> np.ndarray:
        """Value and three derivatives (4, K, c) of c splines with control points (c, N + d)."""
        return self._basis.sum(control_points)

    @cached_property
    def _basis(self) -> Basis:
        return Basis(self.values, self.first)


class SparsityPattern:
    """Where the free variables of splines matter: each time and variable of a spline once, one spline after the other.

    Parameters
    ----------
    columns : (K, d + 1) int ndarray
        Control points of a spline that matter at each time; see `LocalBasis`.
    matrix : FreeMatrix
        Of splines over the same knots, stacked.
    curves : int
        Number of these.

    Attributes
    ----------
    curve, point, variable : (z,) int ndarray
        Numbers of the spline, of the time, and of the variable.
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
        """Differentiate value and three derivatives by the free variables, (4, z); `values` are (4, K, d + 1)."""
        terms = self._weight * values[:, *self._terms]
        count = len(self.point)
        return np.array([np.bincount(self._place, order, count) for order in terms])
