"""Where variables, rows and entries of the Jacobian stand in a phase.

Variables: the duration T in seconds, then the free control points (see `boundary`) of each curve: of s(t) where there
is a path and no time law, then of each joint that is chosen freely, in chain order. Boundary conditions are built into
the control points and have no rows. Where the knots are free, the interval lengths h in normalised time come last (see
`grid`). A duration that is given has equal bounds.

Rows: for each limit that holds at every instant, in the order of the list, its c values at collocation point 0, then at
point 1, and so on; along a path then differences of successive control points of s, which are >= 0 so that ds/dt >= 0
holds at all times (see `Progress`); where the knots are free, last the sum of h, which is 1. All rows are
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
    FreePart,
    SparsityPattern,
    sum_powers,
)
from brachis.optimise.grid import FixedGrid

SHORTEST_TIME = 1e-4
"""Least duration of a phase, s: a motion that takes no longer is not held back by any limit."""


@dataclass(frozen=True, eq=False)
class Progress:
    """Differences of successive control points of s, those that bounds on single variables do not take care of.

    Attributes
    ----------
    given : (1 + k, p) ndarray
        Given terms of the rows, by powers of the duration.
    row, variable : (z,) int ndarray
        Entries of the Jacobian, each place once; variables of the phase, the duration among them.
    weight : (z,) ndarray
        The entries; 0 for the duration.
    """

    given: np.ndarray
    row: np.ndarray
    variable: np.ndarray
    weight: np.ndarray

    @classmethod
    def none(cls) -> Progress:
        """Make no rows."""
        nothing = np.empty(0, dtype=int)
        return cls(np.empty((1, 0)), nothing, nothing, np.empty(0))

    @classmethod
    def of(cls, spline: BoundarySpline) -> Progress:
        """Take the differences of a spline whose free variables follow the duration, variable 0."""
        given = np.diff(spline.given, axis=1)
        depends = np.any(given[1:] != 0.0, axis=0)
        row, variable, weight = _differences(spline.free_part)
        several = np.bincount(row, minlength=len(depends)) + depends > 1
        several |= np.any(given[2:] != 0.0, axis=0)
        number = np.cumsum(several) - 1
        chosen = several[row]
        by_duration = np.flatnonzero(depends[several])
        row = np.concatenate([by_duration, number[row[chosen]]])
        none = np.zeros_like(by_duration)
        variable = np.concatenate([none, 1 + variable[chosen]])
        weight = np.concatenate([none, weight[chosen]])
        order = np.lexsort((variable, row))
        return cls(given[:, several], row[order], variable[order], weight[order])

    def values(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (p,)."""
        terms = self.weight * x[self.variable]
        parts = np.bincount(self.row, terms, self.given.shape[1])
        return sum_powers(self.given, x[0]) + parts

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the Jacobian, (z,)."""
        by_duration = sum_powers(self.given, x[0], slope=True)
        return np.where(self.variable == 0, by_duration[self.row], self.weight)


def _differences(part: FreePart) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Subtract from each row of a matrix the row before it; return row, column and value of what is not zero."""
    rows, columns = part.shape
    row = np.concatenate([part.point - 1, part.point])
    column = np.tile(part.variable, 2)
    weight = np.concatenate([part.weight, -part.weight])
    inside = (row >= 0) & (row < rows - 1)
    places, place = np.unique(
        row[inside] * columns + column[inside], return_inverse=True
    )
    values = np.bincount(place, weight[inside], len(places))
    kept = values != 0.0
    row, column = np.divmod(places[kept], max(columns, 1))
    return row, column, values[kept]


@dataclass(frozen=True, eq=False)
class VariableLayout:
    """Places of the variables in x, and the collocation points at which they matter; see the module.

    Attributes
    ----------
    splines : tuple of BoundarySpline
        One for each curve.
    slices : tuple of slice
        Variables of each curve.
    lengths : slice
        Variables h; empty where the knots are fixed.
    patterns : tuple of SparsityPattern
        Where the variables of each curve matter.
    point, variable : (z,) int ndarray
        Where variables matter at all, by T, by each curve, then by h.
    curve : (z',) int ndarray
        Number of the curve of each entry between those of T and h.
    pattern : CurvePattern
        Point and curve of each.
    progress : Progress
        Differences of control points of s; empty without a path.
    x_lower, x_upper : (v,) ndarray
    """

    splines: tuple[BoundarySpline, ...]
    slices: tuple[slice, ...]
    lengths: slice
    patterns: tuple[SparsityPattern, ...]
    point: np.ndarray
    variable: np.ndarray
    curve: np.ndarray
    pattern: CurvePattern
    progress: Progress
    x_lower: np.ndarray
    x_upper: np.ndarray

    @classmethod
    def of(
        cls,
        grid: FixedGrid,
        boundary: Boundary,
        *,
        has_path: bool,
        splines: tuple[BoundarySpline, ...] | None = None,
    ) -> VariableLayout:
        """Lay the variables of splines over a grid out; the first spline is s where there is a path.

        With a time law the duration is given, and none of the splines is s. Splines may be those of another grid with
        the same knots.
        """
        splines = splines or boundary.splines(grid.knots, grid.degree)
        time_law = boundary.time_law
        ends = np.cumsum([1, *(spline.free for spline in splines)]).tolist()
        slices = tuple(itertools.starmap(slice, itertools.pairwise(ends)))
        lengths = slice(ends[-1], ends[-1] + len(grid.lower))
        x_lower = np.concatenate([np.full(ends[-1], -np.inf), grid.lower])
        x_upper = np.concatenate([np.full(ends[-1], np.inf), grid.upper])
        x_lower[0] = SHORTEST_TIME
        progress = Progress.none()
        if time_law is not None:
            x_lower[0] = time_law.duration
            x_upper[0] = time_law.duration
        elif has_path:
            progress = Progress.of(splines[0])
            if not splines[0].given[1:].any():
                x_lower[slices[0]] = splines[0].given[0].min()
                x_upper[slices[0]] = splines[0].given[0].max()

        columns = grid.basis(grid.lengths_of(grid.knots)).columns
        patterns = tuple(SparsityPattern.of(columns, spline) for spline in splines)
        count = len(grid.t_norm)
        of_curves = [
            pattern.variable + own.start
            for pattern, own in zip(patterns, slices, strict=True)
        ]
        points = [np.arange(count), *(pattern.point for pattern in patterns)]
        point = np.concatenate([*points, grid.point])
        of_time = np.zeros(count, dtype=int)
        of_lengths = grid.variable + lengths.start
        numbers = np.arange(len(splines)) + int(time_law is not None)
        width = len(splines) + int(time_law is not None)
        curve = np.repeat(numbers, [len(pattern.point) for pattern in patterns])
        return cls(
            splines=splines,
            slices=slices,
            lengths=lengths,
            patterns=patterns,
            point=point,
            variable=np.concatenate([of_time, *of_curves, of_lengths]),
            curve=curve,
            pattern=CurvePattern(
                point[count : count + len(curve)], curve, count, width
            ),
            progress=progress,
            x_lower=x_lower,
            x_upper=x_upper,
        )


@dataclass(frozen=True, eq=False)
class RowLayout:
    """Where rows and entries of the Jacobian stand; see the module.

    Attributes
    ----------
    of_limits : tuple of (K, c) int ndarray
        Numbers of the rows of each limit; none, (0, c), where its means are held.
    lower, upper : (c,) ndarray
        Bounds of the rows.
    variables : VariableLayout
    """

    of_limits: tuple[np.ndarray, ...]
    lower: np.ndarray
    upper: np.ndarray
    variables: VariableLayout

    @classmethod
    def of(
        cls, limits: Sequence[Limit], grid: FixedGrid, variables: VariableLayout
    ) -> RowLayout:
        """Give every row of the limits its number."""
        count = len(grid.t_norm)
        of_limits = []
        first = 0
        for limit in limits:
            times = 0 if limit.guarantee.is_mean else count
            size = times * len(limit.lower)
            shape = (times, len(limit.lower))
            of_limits.append(np.arange(first, first + size).reshape(shape))
            first += size
        pairs = list(zip(limits, of_limits, strict=True))
        lower = [np.tile(limit.lower, len(rows)) for limit, rows in pairs]
        upper = [np.tile(limit.upper, len(rows)) for limit, rows in pairs]
        steps = variables.progress.given.shape[1]
        return cls(
            of_limits=tuple(of_limits),
            lower=np.concatenate([*lower, np.zeros(steps), grid.total]),
            upper=np.concatenate([*upper, np.full(steps, np.inf), grid.total]),
            variables=variables,
        )

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the entries of the Jacobian, (nnz,) each; each place occurs once."""
        variables = self.variables
        progress = variables.progress
        count, _ = variables.pattern.shape
        at_points = [rows for rows in self.of_limits if len(rows)]
        pointwise = np.hstack([np.empty((count, 0), dtype=int), *at_points])
        h = np.arange(variables.lengths.start, variables.lengths.stop)
        first = pointwise.size
        rows = [
            pointwise[variables.point].ravel(),
            first + progress.row,
            np.full(len(h), first + progress.given.shape[1]),
        ]
        columns = [
            np.repeat(variables.variable, pointwise.shape[1]),
            progress.variable,
            h,
        ]
        return np.concatenate(rows), np.concatenate(columns)
