"""Where variables, rows and entries of the Jacobian stand in a phase.

Variables: the duration T in seconds, then the free control points (see `boundary`) of each curve: of s(t) where there
is a path, then of each joint that is chosen freely, in chain order. Boundary conditions are built into the control
points and have no rows. Where the knots are free, the interval lengths h in normalised time come last (see `grid`).

Rows: for each limit, in the order of the list, its c values at collocation point 0, then at point 1, and so on; along a
path then the differences of successive control points of s, which are >= 0 so that ds/dt >= 0 holds at all times; where
the knots are free, last the sum of h, which is 1. All rows are dimensionless.

Entries of the Jacobian: those of all limits by T, by the variables of each curve and by h, all points of a place
together; then -1 and 1 for each difference; last 1 for each of h.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.limits import Limit
from brachis.nlp.boundary import BoundarySpline, SparsityPattern
from brachis.nlp.grid import Grid

SHORTEST_TIME = 1e-4
"""Least duration, s."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Variables, rows and the Jacobian's pattern; see the module.

    Attributes
    ----------
    slices : tuple of slice
        Variables of each curve.
    s : slice
        Variables of s; none where there is no path.
    lengths : slice
        Variables h; none where the knots are fixed.
    places : tuple of SparsityPattern
        Where the variables of each curve matter.
    x_lower, x_upper : (v,) ndarray
    lower, upper : (c,) ndarray
        Bounds of the rows.
    jacobian_rows, jacobian_columns : (nnz,) int ndarray
        Sparsity pattern; each place occurs once.
    """

    slices: tuple[slice, ...]
    s: slice
    lengths: slice
    places: tuple[SparsityPattern, ...]
    x_lower: np.ndarray
    x_upper: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    jacobian_rows: np.ndarray
    jacobian_columns: np.ndarray

    @classmethod
    def of(cls, grid: Grid, splines: Sequence[BoundarySpline], limits: Sequence[Limit], *, path: bool) -> Layout:
        """Lay a phase out over a grid; the first of its `splines` is s where there is a path."""
        ends = np.cumsum([1, *(spline.free for spline in splines)])
        slices = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))
        x_lower = np.concatenate([np.full(ends[-1], -np.inf), grid.lower])
        x_upper = np.concatenate([np.full(ends[-1], np.inf), grid.upper])
        x_lower[0] = SHORTEST_TIME
        s = slices[0] if path else slice(1, 1)
        x_lower[s], x_upper[s] = 0.0, 1.0
        lengths = slice(int(ends[-1]), len(x_lower))
        basis = grid.basis(grid.lengths_of(grid.knots))
        places = tuple(SparsityPattern.of(basis.columns, spline) for spline in splines)
        steps = np.arange(s.start, s.stop - 1)
        pattern = _pattern(grid, limits, slices, steps, lengths, places)
        return cls(slices, s, lengths, places, x_lower, x_upper, *_bounds(grid, limits, len(steps)), *pattern)


def _bounds(grid: Grid, limits: Sequence[Limit], steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the rows, (c,) each, with `steps` differences of control points of s."""
    count = len(grid.t_norm)
    lower = [*(np.tile(each.lower, count) for each in limits), np.zeros(steps), grid.total]
    upper = [*(np.tile(each.upper, count) for each in limits), np.full(steps, np.inf), grid.total]
    return np.concatenate(lower), np.concatenate(upper)


def _pattern(
    grid: Grid,
    limits: Sequence[Limit],
    slices: Sequence[slice],
    steps: np.ndarray,
    lengths: slice,
    places: Sequence[SparsityPattern],
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the Jacobian's entries, (nnz,) each; `steps` are the variables of s but the last one."""
    count = len(grid.t_norm)
    patterns = [(np.arange(count), np.zeros(count, dtype=int))]
    patterns += [(place.point, place.variable + part.start) for place, part in zip(places, slices, strict=True)]
    patterns.append((grid.point, grid.variable + lengths.start))
    sizes = [len(limit.lower) for limit in limits]
    ends = count * np.cumsum([0, *sizes])
    blocks = [np.arange(*pair).reshape(count, -1) for pair in itertools.pairwise(ends)]
    numbers = np.concatenate([np.empty((count, 0), dtype=int), *blocks], axis=1)
    rows = [numbers[point].ravel() for point, _ in patterns]
    columns = [np.repeat(variable, sum(sizes)) for _, variable in patterns]
    first = int(ends[-1])
    differences, of_h = first + np.arange(len(steps)), np.arange(lengths.start, lengths.stop)
    rows += [differences, differences, np.full(len(of_h), first + len(steps))]
    columns += [steps, steps + 1, of_h]
    return np.concatenate(rows), np.concatenate(columns)
