"""Order of the variables, of the rows and of the entries of the Jacobian in a phase.

Variables: the duration T in seconds comes first, then the free control points (see `boundary`) of each curve. The
curves are s(t), if there is a path and no time law, then each redundant joint in chain order. Boundary conditions are
built into the control points and have no rows. If the knots are free, the interval lengths h in normalised time come
last (see `grid`). If the duration is given, its lower and upper bounds are equal.

Rows: each limit that applies at every instant comes first, in the order of the list, with its c values at collocation
point 0, then at point 1, and so on. Along a path, differences of successive control points of s follow. They must be >=
0, so that ds/dt >= 0 at all times (see `ProgressRows`). If the knots are free, the last row is the sum of h, which must
be 1. All rows are dimensionless. Means over time are rows of the program, not of a phase.

Entries of the Jacobian: those of all limits that apply at every instant come first, with respect to T, to the variables
of each curve and to h. For each pair of point and variable, the entries of all limits are together. The entries of the
differences follow. The last entries are a 1 for each length in h.
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
"""Minimum duration of a phase, s. No limit holds back a motion that is so short."""


@dataclass(frozen=True, eq=False)
class ProgressRows:
    """Rows for those differences of successive control points of s that bounds on single variables do not cover.

    Attributes
    ----------
    fixed_terms : (1 + k, p) ndarray
        Fixed terms of the rows, one for each power of the duration.
    matrix : FreeMatrix
        Contributions of the phase's variables to the rows. Each entry occurs once. The duration, variable 0, has no
        contribution.
    """

    fixed_terms: np.ndarray
    matrix: FreeMatrix

    @classmethod
    def none(cls) -> ProgressRows:
        """Return an object without rows."""
        return cls(np.empty((1, 0)), FreeMatrix.of(np.empty((0, 1))))

    @classmethod
    def of(cls, spline: BoundarySpline) -> ProgressRows:
        """Build the rows for a spline whose free variables come after the duration, variable 0."""
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
        """Compute the values of the rows, (p,)."""
        return sum_powers(self.fixed_terms, x[0]) + self.matrix.control_points(x)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the entries of the Jacobian, (z,). Do not write to the returned array."""
        matrix = self.matrix
        if len(self.fixed_terms) == 1:
            return matrix.weight
        by_duration = sum_powers(self.fixed_terms, x[0], slope=True)
        return np.where(matrix.variable == 0, by_duration[matrix.point], matrix.weight)


def _differences(matrix: FreeMatrix) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Subtract from each row the row before it, and return row, column and value of the nonzero entries."""
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
    """Positions of the variables in x, and the collocation points that they affect; see the docstring of the module.

    Parameters
    ----------
    grid : FixedGrid
    boundary : Boundary
    has_path : bool
        Whether there is a path. If so, the first spline is s, unless a time law gives the duration and s.
    splines : tuple of BoundarySpline, optional
        Splines to reuse, from another grid with the same knots.

    Attributes
    ----------
    splines : tuple of BoundarySpline
        One spline for each curve.
    slices : tuple of slice
        Positions of the variables of each curve.
    lengths : slice
        Positions of the variables h; empty if the knots are fixed.
    free_matrix : FreeMatrix
        Matrix of all curves' control points with respect to all variables; see `stack_splines`.
    fixed_terms : (1 + p, c (N + d)) ndarray
        Fixed terms of all control points, one for each power of the duration.
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
                # The fixed terms of free control points are zero.
                self.x_lower[self.slices[0]] = constant[0]
                self.x_upper[self.slices[0]] = constant.max()

        points = len(grid.breaks) - 1 + grid.degree
        stacked = stack_splines(splines, self.slices, points, len(self.x_lower))
        self.free_matrix, self.fixed_terms = stacked
        self._grid = grid
        self._law_curves = boundary.law_curves

    @cached_property
    def sparsity(self) -> SparsityPattern:
        """Pattern of the collocation points at which the variables of the curves have an effect. Built on demand."""
        grid = self._grid
        columns = grid.basis(grid.lengths_of(grid.knots)).columns
        return SparsityPattern(columns, self.free_matrix, len(self.splines))

    @cached_property
    def point(self) -> np.ndarray:
        """Points, (z,), at which variables have an effect: first T, then the variables of each curve, then h."""
        curve_points = np.arange(len(self._grid.t_norm))
        return np.concatenate([curve_points, self.sparsity.point, self._grid.point])

    @cached_property
    def variable(self) -> np.ndarray:
        """Variables, (z,), that have an effect at the points in `point`."""
        of_time = np.zeros(len(self._grid.t_norm), dtype=int)
        of_lengths = self._grid.variable + self.lengths.start
        return np.concatenate([of_time, self.sparsity.variable, of_lengths])

    @cached_property
    def pattern(self) -> CurvePattern:
        """Point and curve of each entry between the entries of T and those of h."""
        curve = self._law_curves + self.sparsity.curve
        width = self._law_curves + len(self.splines)
        count = len(self._grid.t_norm)
        return CurvePattern(self.sparsity.point, curve, count, width)

    def names(self, curves: Sequence[str]) -> list[str]:
        """Name the variables, for example ``t_end`` (duration), ``s[3]`` (control point 3 of s), ``h[0]`` (length).

        Numbers begin at 0. A variable that moves several control points has the number of the first of them.

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
    """Order of the rows and of the entries of the Jacobian; see the docstring of the module.

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
        """Indices of the rows of each limit, (K, c) for each limit; empty, (0, c), for a limit on means."""
        ends = np.cumsum([times * count for times, count in self._shapes])
        return [
            np.arange(end - times * count, end).reshape(times, count)
            for end, (times, count) in zip(ends, self._shapes, strict=True)
        ]

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the entries of the Jacobian, (nnz,) each. Each entry occurs once."""
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
