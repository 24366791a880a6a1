"""Where variables, rows and entries of the Jacobian stand in a phase.

Variables: the duration T in seconds, then the free control points (see `boundary`) of each curve: of s(t) where there
is a path and no time law, then of each joint that is chosen freely, in chain order. Boundary conditions are built into
the control points and have no rows. Where the knots are free, the interval lengths h in normalised time come last (see
`grid`). A duration that is given has equal bounds.

Rows: for each limit that holds at every instant, in the order of the list, its c values at collocation point 0, then at
point 1, and so on; along a path then differences of successive control points of s, which are >= 0 so that ds/dt >= 0
holds at all times (see `ProgressRows`); where the knots are free, last the sum of h, which is 1. All rows are
dimensionless. Means over time are rows of the program.

Entries of the Jacobian: of all limits that hold at every point, those by T, by the variables of each curve and by h,
all columns of a point together; then those of the differences; last 1 for each of h.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brachis.kernel import CurvePattern
from brachis.limits import Limit
from brachis.optimise.boundary import (
    Boundary,
    BoundarySpline,
    FreeMatrix,
    SparsityPattern,
    stack_splines,
    sum_powers,
)
from brachis.optimise.grid import FixedGrid

SHORTEST_TIME = 1e-4
"""Least duration of a phase, s: a motion that takes no longer is not held back by any limit."""


@dataclass(frozen=True, eq=False)
class ProgressRows:
    """Differences of successive control points of s, those that bounds on single variables do not take care of.

    Attributes
    ----------
    fixed_terms : (1 + k, p) ndarray
        Fixed terms of the rows, by powers of the duration.
    matrix : FreeMatrix
        What variables of the phase add to the rows, each place once; the duration, variable 0, adds nothing.
    """

    fixed_terms: np.ndarray
    matrix: FreeMatrix

    @classmethod
    def none(cls) -> ProgressRows:
        """Make no rows."""
        return cls(np.empty((1, 0)), FreeMatrix.of(np.empty((0, 1))))

    @classmethod
    def of(cls, spline: BoundarySpline) -> ProgressRows:
        """Take the differences of a spline whose free variables follow the duration, variable 0."""
        terms = np.diff(spline.fixed_terms, axis=1)
        row, variable, weight = _differences(spline.free_matrix)
        by_duration = np.flatnonzero(terms[1:].any(axis=0))
        none = np.zeros_like(by_duration)
        row = np.concatenate([by_duration, row])
        variable = np.concatenate([none, 1 + variable])
        weight = np.concatenate([none, weight])
        several = np.bincount(row, minlength=terms.shape[1]) > 1
        several |= terms[2:].any(axis=0)
        order = np.lexsort((variable, row))
        order = order[several[row[order]]]
        number = np.cumsum(several) - 1
        shape = (int(several.sum()), 1 + spline.free)
        matrix = FreeMatrix(number[row[order]], variable[order], weight[order], shape)
        return cls(terms[:, several], matrix)

    def values(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (p,)."""
        return sum_powers(self.fixed_terms, x[0]) + self.matrix.control_points(x)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the Jacobian, (z,); not to be written to."""
        matrix = self.matrix
        if len(self.fixed_terms) == 1:
            return matrix.weight
        by_duration = sum_powers(self.fixed_terms, x[0], slope=True)
        return np.where(matrix.variable == 0, by_duration[matrix.point], matrix.weight)


def _differences(matrix: FreeMatrix) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Subtract from each row of a matrix the row before it; return row, column and value of what is not zero."""
    rows, columns = matrix.shape
    row = np.concatenate([matrix.point - 1, matrix.point])
    column = np.tile(matrix.variable, 2)
    weight = np.concatenate([matrix.weight, -matrix.weight])
    inside = (row >= 0) & (row < rows - 1)
    numbers = row[inside] * columns + column[inside]
    places, place = np.unique(numbers, return_inverse=True)
    values = np.bincount(place, weight[inside], len(places))
    is_entry = values != 0.0
    row, column = np.divmod(places[is_entry], max(columns, 1))
    return row, column, values[is_entry]


class VariableLayout:
    """Places of the variables in x, and the collocation points at which they matter; see the module.

    Parameters
    ----------
    grid : FixedGrid
    boundary : Boundary
    has_path : bool
        Whether the first spline is s; with a time law the duration is given, and none of the splines is s.
    splines : tuple of BoundarySpline, optional
        Those of another grid with the same knots.

    Attributes
    ----------
    splines : tuple of BoundarySpline
        One for each curve.
    slices : tuple of slice
        Variables of each curve.
    lengths : slice
        Variables h; empty where the knots are fixed.
    free_matrix : FreeMatrix
        Of all curves, by all variables; see `stack_splines`.
    fixed_terms : (1 + p, c (N + d)) ndarray
        Fixed terms of all control points, by powers of the duration.
    progress : ProgressRows
        Differences of control points of s; empty without a path.
    x_lower, x_upper : (v,) ndarray
    """

    def __init__(
        self,
        grid: FixedGrid,
        boundary: Boundary,
        *,
        has_path: bool,
        splines: tuple[BoundarySpline, ...] | None = None,
    ) -> None:
        splines = splines or boundary.splines(grid.knots, grid.degree)
        self.splines = splines
        ends = np.cumsum([1, *(spline.free for spline in splines)]).tolist()
        self.slices = tuple(itertools.starmap(slice, itertools.pairwise(ends)))
        self.lengths = slice(ends[-1], ends[-1] + len(grid.lower))
        self.x_lower = np.concatenate([np.full(ends[-1], -np.inf), grid.lower])
        self.x_upper = np.concatenate([np.full(ends[-1], np.inf), grid.upper])
        self.x_lower[0] = SHORTEST_TIME
        self.progress = ProgressRows.none()
        time_law = boundary.time_law
        if time_law is not None:
            self.x_lower[0] = time_law.duration
            self.x_upper[0] = time_law.duration
        elif has_path:
            self.progress = ProgressRows.of(splines[0])
            constant, *by_powers = splines[0].fixed_terms
            if not np.any(by_powers):
                # Free control points have zeros there.
                self.x_lower[self.slices[0]] = constant[0]
                self.x_upper[self.slices[0]] = constant.max()

        points = len(grid.breaks) - 1 + grid.degree
        stacked = stack_splines(splines, self.slices, points, len(self.x_lower))
        self.free_matrix, self.fixed_terms = stacked
        self._grid = grid
        self._law_curves = boundary.law_curves

    @cached_property
    def sparsity(self) -> SparsityPattern:
        """Where the variables of the curves matter; of splines along a timing nobody asks."""
        grid = self._grid
        columns = grid.basis(grid.lengths_of(grid.knots)).columns
        return SparsityPattern(columns, self.free_matrix, len(self.splines))

    @cached_property
    def point(self) -> np.ndarray:
        """Points, (z,), at which variables matter: T, those of each curve, then h."""
        curve_points = np.arange(len(self._grid.t_norm))
        return np.concatenate([curve_points, self.sparsity.point, self._grid.point])

    @cached_property
    def variable(self) -> np.ndarray:
        """Variables, (z,), that matter at these."""
        of_time = np.zeros(len(self._grid.t_norm), dtype=int)
        of_lengths = self._grid.variable + self.lengths.start
        return np.concatenate([of_time, self.sparsity.variable, of_lengths])

    @cached_property
    def pattern(self) -> CurvePattern:
        """Point and curve of each entry between those of T and h."""
        curve = self._law_curves + self.sparsity.curve
        width = self._law_curves + len(self.splines)
        count = len(self._grid.t_norm)
        return CurvePattern(self.sparsity.point, curve, count, width)

    def names(self, curves: Sequence[str]) -> list[str]:
        """Name the variables: ``t_end`` is the duration, ``s[3]`` control point 3 of s, ``h[0]`` a length.

        Numbers begin at 0. A variable that moves several control points has the number of the first one.

        Parameters
        ----------
        curves : sequence of str
            Names of the curves, one for each spline.
        """
        names = ["t_end"]
        for curve, spline in zip(curves, self.splines, strict=True):
            matrix = spline.free_matrix
            first = np.unique(matrix.variable, return_index=True)[1]
            names += [f"{curve}[{point}]" for point in matrix.point[first]]
        count = len(self.x_lower) - len(names)
        return [*names, *(f"h[{number}]" for number in range(count))]


class RowLayout:
    """Where rows and entries of the Jacobian stand; see the module.

    Parameters
    ----------
    limits : sequence of Limit
    grid : FixedGrid
    variables : VariableLayout

    Attributes
    ----------
    lower, upper : (c,) ndarray
        Bounds of the rows.
    """

    def __init__(
        self, limits: Sequence[Limit], grid: FixedGrid, variables: VariableLayout
    ) -> None:
        self._variables = variables
        self._shapes = []
        lower = []
        upper = []
        for limit in limits:
            times = 0 if limit.guarantee.is_mean else len(grid.t_norm)
            lower.append(np.tile(limit.lower, times))
            upper.append(np.tile(limit.upper, times))
            self._shapes.append((times, len(limit.lower)))
        steps = variables.progress.fixed_terms.shape[1]
        self.lower = np.concatenate([*lower, np.zeros(steps), grid.total])
        self.upper = np.concatenate([*upper, np.full(steps, np.inf), grid.total])

    @cached_property
    def of_limits(self) -> list[np.ndarray]:
        """Numbers of the rows of each limit, (K, c) each; none, (0, c), where its means are held."""
        ends = np.cumsum([times * count for times, count in self._shapes])
        return [
            np.arange(end - times * count, end).reshape(times, count)
            for end, (times, count) in zip(ends, self._shapes, strict=True)
        ]

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the entries of the Jacobian, (nnz,) each; each place occurs once."""
        variables = self._variables
        progress = variables.progress
        count, _ = variables.pattern.shape
        at_points = [rows for rows in self.of_limits if len(rows)]
        pointwise = np.hstack([np.empty((count, 0), dtype=int), *at_points])
        h = np.arange(variables.lengths.start, variables.lengths.stop)
        first = pointwise.size
        last = first + progress.fixed_terms.shape[1]
        of_points = pointwise[variables.point].ravel()
        by_points = np.repeat(variables.variable, pointwise.shape[1])
        rows = (of_points, first + progress.matrix.point, np.full(len(h), last))
        columns = (by_points, progress.matrix.variable, h)
        return np.concatenate(rows), np.concatenate(columns)
