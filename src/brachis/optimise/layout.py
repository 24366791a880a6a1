"""Where variables, rows and entries of the Jacobian stand in a phase.

Variables: the duration T in seconds, then the free control points (see `boundary`) of each curve: of s(t) where there
is a path, then of each joint that is chosen freely, in chain order. Boundary conditions are built into the control
points and have no rows. Where the knots are free, the interval lengths h in normalised time come last (see `grid`).

Rows: for each limit, in the order of the list, its c values at collocation point 0, then at point 1, and so on, or
their c means over time where it is held over the whole motion; along a path then differences of successive control
points of s, which are >= 0 so that ds/dt >= 0 holds at all times (see `progress`); where the knots are free, last the
sum of h, which is 1. All rows are dimensionless.

Entries of the Jacobian: for each of `batches` those of all its limits by T, by the variables of each curve and by h,
all points of a place together, or of means those by all variables; then those of the differences; last 1 for each of h.

From a limit's partials with respect to the joints to its derivatives with respect to curves and end time.

Rows that keep ds/dt >= 0 at all times: the control points of s do not decrease.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.kinematics import JointState
from brachis.limits import Limit, Partials
from brachis.optimise.boundary import BoundarySpline, SparsityPattern
from brachis.optimise.grid import Grid


def chain(partials: Partials, state: JointState) -> tuple[np.ndarray, ...]:
    """Differentiate a limit with respect to y, ydot, yddot and, where it asks for the jerk, ydddot, (K, c, 1 + r) each.

    See `joint_map` for the derivatives of the jerk.
    """
    exact = state.derivatives
    given = (partials.q, partials.qdot, partials.qddot, partials.qdddot)
    shape = next(part.shape[:2] for part in given if part is not None)
    by_y = by_ydot = by_yddot = np.zeros((*shape, state.y.shape[1]))
    if partials.q is not None:
        by_y = by_y + partials.q @ state.gradient
    if partials.s is not None:
        by_y = by_y.copy()
        by_y[:, :, 0] += partials.s
    if partials.qdot is not None:
        by_y = by_y + partials.qdot @ exact.qdot_y
        by_ydot = by_ydot + partials.qdot @ state.gradient
    if partials.qddot is not None:
        by_y = by_y + partials.qddot @ exact.qddot_y
        by_ydot = by_ydot + partials.qddot @ exact.qddot_ydot
        by_yddot = by_yddot + partials.qddot @ state.gradient
    if partials.qdddot is None:
        return by_y, by_ydot, by_yddot
    by_y = by_y + partials.qdddot @ state.qdddot_y
    by_ydot = by_ydot + 3.0 * partials.qdddot @ exact.qddot_y
    by_yddot = by_yddot + 3.0 * partials.qdddot @ exact.qdot_y
    return by_y, by_ydot, by_yddot, partials.qdddot @ state.gradient


@dataclass(frozen=True, eq=False)
class Progress:
    """Differences of successive control points of s, those that bounds on single variables do not take care of.

    Attributes
    ----------
    offset : (p,) ndarray
        What the rows are besides.
    row, variable : (z,) int ndarray
        Entries of the Jacobian, which is constant, each place once; variables of the phase, the duration among them.
    weight : (z,) ndarray
    """

    offset: np.ndarray
    row: np.ndarray
    variable: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, spline: BoundarySpline, first: int) -> Progress:
        """Take the differences of a spline whose free variables begin at `first`; the duration is variable 0."""
        point, entry = np.nonzero(spline.variable >= 0)
        variable = first + spline.variable[point, entry]
        weight = spline.weight[point, entry]
        every = np.arange(len(spline.rate))
        point = np.append(point, every)
        variable = np.append(variable, np.zeros_like(every))
        weight = np.append(weight, spline.rate)
        # Control point i is in difference i - 1, and with the other sign in difference i.
        number = np.concatenate([point - 1, point])
        places = number * (first + spline.free) + np.tile(variable, 2)
        unique, place = np.unique(
            places[(number >= 0) & (number < len(every) - 1)], return_inverse=True
        )
        signed = np.concatenate([weight, -weight])[
            (number >= 0) & (number < len(every) - 1)
        ]
        total = np.bincount(place, weights=signed)
        unique = unique[total != 0.0]
        total = total[total != 0.0]
        number, variable = np.divmod(unique, first + spline.free)
        several = np.bincount(number, minlength=len(every) - 1) > 1
        kept = several[number]
        row = np.cumsum(several) - 1
        return cls(
            np.diff(spline.fixed)[several],
            row[number[kept]],
            variable[kept],
            total[kept],
        )

    @classmethod
    def none(cls) -> Progress:
        """Return no rows, where there is no path."""
        nothing = np.empty(0, dtype=int)
        return cls(np.empty(0), nothing, nothing, np.empty(0))

    def values(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (p,)."""
        parts = np.bincount(
            self.row, weights=self.weight * x[self.variable], minlength=len(self.offset)
        )
        return np.asarray(self.offset + parts)


SHORTEST_TIME = 1e-4
"""Least duration, s."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Variables, rows and the Jacobian's pattern; see the module.

    Attributes
    ----------
    slices : tuple of slice
        Variables of each curve.
    progress : Progress
        Differences of control points of s; none where there is no path.
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
    progress: Progress
    lengths: slice
    places: tuple[SparsityPattern, ...]
    x_lower: np.ndarray
    x_upper: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    jacobian_rows: np.ndarray
    jacobian_columns: np.ndarray

    @classmethod
    def of(
        cls,
        grid: Grid,
        splines: Sequence[BoundarySpline],
        limits: Sequence[Limit],
        *,
        path: bool,
    ) -> Layout:
        """Lay a phase out over a grid; the first of its `splines` is s where there is a path."""
        ends = np.cumsum([1, *(spline.free for spline in splines)])
        slices = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))
        x_lower = np.concatenate([np.full(ends[-1], -np.inf), grid.lower])
        x_upper = np.concatenate([np.full(ends[-1], np.inf), grid.upper])
        x_lower[0] = SHORTEST_TIME
        if path and not splines[0].rate.any():
            x_lower[slices[0]] = 0.0
            x_upper[slices[0]] = 1.0
        progress = Progress.of(splines[0], slices[0].start) if path else Progress.none()
        lengths = slice(int(ends[-1]), len(x_lower))
        basis = grid.basis(grid.lengths_of(grid.knots))
        places = tuple(SparsityPattern.of(basis.columns, spline) for spline in splines)
        pattern = _pattern(grid, limits, slices, progress, lengths, places)
        bounds = _bounds(grid, limits, len(progress.offset))
        return cls(
            slices, progress, lengths, places, x_lower, x_upper, *bounds, *pattern
        )


def height(limit: Limit, count: int) -> int:
    """Return how many times a limit's c values are rows, with `count` collocation points."""
    return 1 if limit.guarantee.is_mean else count


def batches(limits: Sequence[Limit]) -> list[list[Limit]]:
    """Limits that are differentiated together: those held at every point, and those whose means are."""
    kinds = dict.fromkeys(limit.guarantee.is_mean for limit in limits)
    return [
        [limit for limit in limits if limit.guarantee.is_mean == is_mean]
        for is_mean in kinds
    ]


def _bounds(
    grid: Grid, limits: Sequence[Limit], steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the rows, (c,) each, with `steps` differences of control points of s."""
    count = len(grid.t_norm)
    lower = [
        *(np.tile(each.lower, height(each, count)) for each in limits),
        np.zeros(steps),
        grid.total,
    ]
    upper = [
        *(np.tile(each.upper, height(each, count)) for each in limits),
        np.full(steps, np.inf),
        grid.total,
    ]
    return np.concatenate(lower), np.concatenate(upper)


def _pattern(
    grid: Grid,
    limits: Sequence[Limit],
    slices: Sequence[slice],
    progress: Progress,
    lengths: slice,
    places: Sequence[SparsityPattern],
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the Jacobian's entries, (nnz,) each."""
    count = len(grid.t_norm)
    patterns = [(np.arange(count), np.zeros(count, dtype=int))]
    patterns += [
        (place.point, place.variable + part.start)
        for place, part in zip(places, slices, strict=True)
    ]
    patterns.append((grid.point, grid.variable + lengths.start))
    counts = [height(limit, count) for limit in limits]
    ends = np.cumsum(
        [
            0,
            *(
                times * len(limit.lower)
                for times, limit in zip(counts, limits, strict=True)
            ),
        ]
    )
    numbers = {
        id(limit): np.arange(*pair).reshape(times, -1)
        for limit, times, pair in zip(
            limits, counts, itertools.pairwise(ends), strict=True
        )
    }
    rows = []
    columns = []
    for batch in batches(limits):
        together = np.concatenate([numbers[id(limit)] for limit in batch], axis=1)
        if batch[0].guarantee.is_mean:
            rows.append(np.repeat(together, lengths.stop))
            columns.append(np.tile(np.arange(lengths.stop), together.size))
        else:
            rows += [together[point].ravel() for point, _ in patterns]
            columns += [
                np.repeat(variable, together.shape[1]) for _, variable in patterns
            ]
    first = int(ends[-1])
    of_h = np.arange(lengths.start, lengths.stop)
    rows += [first + progress.row, np.full(len(of_h), first + len(progress.offset))]
    columns += [progress.variable, of_h]
    return np.concatenate(rows), np.concatenate(columns)
