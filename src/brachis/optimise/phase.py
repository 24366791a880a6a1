"""One phase of a motion: spline curves y, mapped to joints, within limits at collocation points.

A phase has variables x = (T, c_1, ..., c_c [, h]), its duration and the free control points of its curves, and rows;
see `layout`. With basis matrices B, B', B'' in normalised time,

    dy/dc = B,  dydot/dc = B' / T,  dyddot/dc = B'' / T^2,  dydot/dT = -ydot / T,  dyddot/dT = -2 yddot / T
    dy/dh = dB/dh c,  dydot/dh = dB'/dh c / T,  dyddot/dh = dB''/dh c / T^2,  and so on

and a limit with partials (p_q, p_v, p_a) has d/dy = p_q G + p_v dqdot/dy + p_a dqddot/dy,
d/dydot = p_v G + p_a dqddot/dydot and d/dyddot = p_a G, with G and the rest from the joint map; one that asks for the
jerk likewise (`chain`, `joint_map`).

A point of a phase as curves over time.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from brachis.common.summary import Summary
from brachis.kinematics import JointMap, JointState
from brachis.limits import Limit, Partials, Role
from brachis.limits.safeguards import MARGIN, build_branch_margins
from brachis.optimise.boundary import Boundary, LocalBasis
from brachis.optimise.bspline import insert_knots
from brachis.optimise.grid import FixedGrid, FreeGrid, Grid
from brachis.optimise.layout import Layout, batches, chain, height

_BISECTIONS = 45


def per_second(orders: np.ndarray, t_end: float) -> tuple[np.ndarray, ...]:
    """Value and derivatives per second, from those per unit of normalised time."""
    return tuple(part / t_end**order for order, part in enumerate(orders))


@dataclass(frozen=True, repr=False)
class Motion(Summary):
    """A point x of a phase as curves.

    Attributes
    ----------
    t_end : float
        s.
    knots : ndarray
        In normalised time.
    degree : int
    control_points : (c, N + d) ndarray
        Of each curve: along a path of s, then of each redundant joint in chain order.
    """

    t_end: float
    knots: np.ndarray
    degree: int
    control_points: np.ndarray

    @property
    def breaks(self) -> np.ndarray:
        """Times between which the curves are polynomials, (N + 1,), s."""
        return np.unique(self.knots) * self.t_end

    def at(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Value y of the curves and three time derivatives, each (K, c), at times t, (K,), in seconds.

        At knots those behind them.
        """
        basis = LocalBasis.of(self.knots, self.degree, t / self.t_end)
        return per_second(basis.curves(self.control_points), self.t_end)

    def over(self, knots: np.ndarray) -> Motion:
        """Return the same curves over a clamped knot vector that contains the present one."""
        points = insert_knots(self.control_points, self.knots, knots, self.degree)
        return Motion(self.t_end, knots, self.degree, points)

    def times_of(self, s: np.ndarray) -> np.ndarray:
        """Find the times, (P,), s, at which path coordinates s, (P,), are reached; s(t) does not decrease."""
        low = np.zeros(len(s))
        high = np.full(len(s), self.t_end)
        for _ in range(_BISECTIONS if len(s) else 0):
            middle = 0.5 * (low + high)
            order = np.argsort(middle, kind="stable")
            before = np.empty(len(s), dtype=bool)
            before[order] = self.at(middle[order])[0][:, 0] < s[order]
            low = np.where(before, middle, low)
            high = np.where(before, high, middle)
        return 0.5 * (low + high)


class Phase:
    """A phase as functions of its variables x; see the module.

    Parameters
    ----------
    joint_map : JointMap
    limits : sequence of Limit
        Of robot, process and scene; safeguards of the joint map are added.
    grid : Grid
        Knots and collocation points.
    boundary : Boundary

    Attributes
    ----------
    joint_map, grid, boundary
        As given.
    limits : tuple of Limit
        Those given, then the safeguards.
    splines : tuple of BoundarySpline
        Of each curve.
    slices : tuple of slice
        The variables of each curve.
    x_lower, x_upper : (v,) ndarray
    lower, upper : (c,) ndarray
        Bounds of the rows.
    jacobian_rows, jacobian_columns : (nnz,) int ndarray
        Fixed sparsity pattern; each place occurs once.
    evaluations : dict of str to int
        How often states and Jacobians were computed.
    """

    def __init__(
        self,
        joint_map: JointMap,
        limits: Sequence[Limit],
        grid: Grid,
        boundary: Boundary,
    ) -> None:
        self.joint_map = joint_map
        self.limits = (*limits, *build_branch_margins(joint_map, MARGIN))
        self._lay_out(grid, boundary)

    def _lay_out(self, grid: Grid, boundary: Boundary) -> None:
        """Set grid and boundary conditions, and all that depends on them."""
        self.grid = grid
        self.boundary = boundary
        self.splines = boundary.splines(grid.knots, grid.degree)
        layout = Layout.of(
            grid, self.splines, self.limits, path=self.joint_map.path is not None
        )
        self.slices = layout.slices
        self._lengths = layout.lengths
        self._places = layout.places
        self._progress = layout.progress
        self.x_lower = layout.x_lower
        self.x_upper = layout.x_upper
        self.lower = layout.lower
        self.upper = layout.upper
        self.jacobian_rows = layout.jacobian_rows
        self.jacobian_columns = layout.jacobian_columns
        self._entries: tuple[LocalBasis, list[np.ndarray]] | None = None
        self._last: tuple[bytes, JointState] | None = None
        self.evaluations = {"states": 0, "jacobians": 0}

    def over(self, grid: Grid, boundary: Boundary | None = None) -> Phase:
        """Return the same phase over another grid, and with other boundary conditions where they are given."""
        other = copy.copy(self)
        other._lay_out(grid, boundary or self.boundary)  # noqa: SLF001  (its own class)
        return other

    def with_grid(self, t_norm: np.ndarray) -> Phase:
        """Return the same phase over its present knots, with collocation points `t_norm`; x keeps its meaning."""
        return self.with_knots(self.knots, t_norm)

    def with_knots(self, knots: np.ndarray, t_norm: np.ndarray) -> Phase:
        """Return the same phase over other fixed knots, with collocation points `t_norm`, ascending from 0 to 1.

        Where `knots` contain the present ones, ``variables_from(before.motion(x).over(knots))`` is the same motion.
        """
        return self.over(FixedGrid(knots, self.degree, t_norm))

    def with_free_knots(self, shortest: float) -> Phase:
        """Return the same phase with interval lengths as variables, each at least `shortest` mean intervals."""
        return self.over(
            FreeGrid(self.knots, self.degree, self.t_norm, shortest / self.intervals)
        )

    def frozen(self, x: np.ndarray) -> Phase:
        """Return the phase with its knots fixed where they are at x."""
        return self.over(self.grid.frozen(x[self._lengths]))

    def with_limits(self, limits: tuple[Limit, ...]) -> Phase:
        """Return the same phase with other limits, safeguards included; x keeps its meaning."""
        other = copy.copy(self)
        other.limits = limits
        other._lay_out(self.grid, self.boundary)  # noqa: SLF001  (its own class)
        return other

    def with_margin(self, margin: float) -> Phase:
        """Return the same phase with another least branch margin; x keeps its meaning."""
        own = tuple(limit for limit in self.limits if limit.role is not Role.SAFEGUARD)
        return self.with_limits((*own, *build_branch_margins(self.joint_map, margin)))

    @property
    def variables(self) -> int:
        """Number of variables."""
        return len(self.x_lower)

    @property
    def degree(self) -> int:
        """Degree of the splines."""
        return self.grid.degree

    @property
    def knots(self) -> np.ndarray:
        """Clamped knot vector; see `Grid`."""
        return self.grid.knots

    @property
    def breaks(self) -> np.ndarray:
        """Ends of the knot intervals in normalised time, (N + 1,)."""
        return self.knots[self.degree : len(self.knots) - self.degree]

    @property
    def jumps(self) -> np.ndarray:
        """Knots, in normalised time, at which the highest derivative that a limit asks for jumps."""
        order = max((limit.order for limit in self.limits), default=0)
        return self.breaks[1:-1] if self.degree <= order else np.empty(0)

    @property
    def intervals(self) -> int:
        """Number of knot intervals, N."""
        return len(self.knots) - 2 * self.degree - 1

    @property
    def t_norm(self) -> np.ndarray:
        """Collocation points in normalised time, (K,); see `Grid`."""
        return self.grid.t_norm

    def end_variables(self, point: int) -> np.ndarray:
        """Variables that are the curves' values at the start (`point` 0) or end (-1), (c,); -1 where fixed."""
        pairs = zip(self.splines, self.slices, strict=True)
        found = ((int(spline.variable[point, 0]), part.start) for spline, part in pairs)
        return np.array(
            [first + own if own >= 0 else -1 for own, first in found], dtype=int
        )

    def motion(self, x: np.ndarray) -> Motion:
        """Curves that belong to x."""
        h = x[self._lengths]
        # Should the lengths add up to a little more or less than 1, so much longer or shorter is the motion.
        span = self.grid.t_norm_at(h)[-1]
        return Motion(
            float(x[0] * span),
            self.grid.knots_at(h),
            self.degree,
            self._control_points(x),
        )

    def _control_points(self, x: np.ndarray) -> np.ndarray:
        """Control points (c, N + d)."""
        parts = zip(self.splines, self.slices, strict=True)
        return np.array(
            [spline.control_points(x[part], x[0]) for spline, part in parts]
        )

    def variables_from(self, motion: Motion) -> np.ndarray:
        """Point x nearest to given curves over the same knots, or over as many where these are free."""
        pairs = zip(self.splines, motion.control_points, strict=True)
        free = [spline.free_from(points, motion.t_end) for spline, points in pairs]
        return np.concatenate(
            [[motion.t_end], *free, self.grid.lengths_of(motion.knots)]
        )

    def state(self, x: np.ndarray) -> JointState:
        """Joint motion at the collocation points; kept until x changes, so that rows and Jacobian share it.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        key = x.tobytes()
        if self._last is None or self._last[0] != key:
            self.evaluations["states"] += 1
            h = x[self._lengths]
            curves = per_second(
                self.grid.basis(h).curves(self._control_points(x)), x[0]
            )
            self._last = (
                key,
                self.joint_map.state(*curves, t=self.grid.t_norm_at(h) * x[0]),
            )
        return self._last[1]

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (c,); raises UnreachableError as `state` does."""
        values = [self._held(limit, x).ravel() for limit in self.limits]
        totals = np.full(len(self.grid.total), x[self._lengths].sum())
        return np.concatenate([*values, self._progress.values(x), totals])

    def _held(self, limit: Limit, x: np.ndarray) -> np.ndarray:
        """Values of a limit that are rows, (K, c), or (1, c) where their means are."""
        values = limit.values(self.state(x))
        return (
            self.grid.mean_weights(x[self._lengths])[None] @ values
            if limit.guarantee.is_mean
            else values
        )

    def has(self, limit: Limit) -> bool:
        """Tell whether a limit is one of the phase's, the very object."""
        return any(each is limit for each in self.limits)

    def rows_of(self, limit: Limit) -> np.ndarray:
        """Numbers of the rows of one of the limits, (K, c), or (1, c) where its means are rows."""
        before = self.limits[: [each is limit for each in self.limits].index(True)]
        count = len(self.t_norm)
        first = sum(height(each, count) * len(each.lower) for each in before)
        return first + np.arange(height(limit, count) * len(limit.lower)).reshape(
            -1, len(limit.lower)
        )

    def violation_of_means(self, x: np.ndarray) -> float:
        """How far the limits that hold over the whole motion are violated; -inf where there are none."""
        means = [
            limit.violation(self._held(limit, x)).max()
            for limit in self.limits
            if limit.guarantee.is_mean
        ]
        return float(max(means, default=-np.inf))

    def violation(self, x: np.ndarray) -> np.ndarray:
        """How far the limits are violated at every collocation point, (K, c); negative inside.

        Those that hold over the whole motion are left out. So are safeguards: falling a little short of one harms
        nobody. Raises UnreachableError as `state` does.
        """
        return self._violation(self.state(x))

    def violation_at(self, x: np.ndarray, t_norm: np.ndarray) -> np.ndarray:
        """As `violation`, at other normalised times, (K,); turns of 2 pi follow the nearest collocation point."""
        motion = self.motion(x)
        known = self.state(x)
        at = self.grid.t_norm_at(x[self._lengths])
        place = np.clip(np.searchsorted(at, t_norm), 0, len(at) - 1)
        near = (
            known.q[place]
            + known.qdot[place] * ((t_norm - at[place]) * motion.t_end)[:, None]
        )
        return self._violation(
            self.joint_map.state(*motion.at(t_norm * motion.t_end), near=near)
        )

    def _violation(self, state: JointState) -> np.ndarray:
        own = [
            limit
            for limit in self.limits
            if limit.role is not Role.SAFEGUARD and not limit.guarantee.is_mean
        ]
        return np.concatenate(
            [limit.violation(limit.values(state)) for limit in own], axis=1
        )

    def time_scaling_ratios(self, x: np.ndarray) -> np.ndarray:
        """Ratios, (K, c), to the limits that a longer time relieves; see `Limit.ratio`.

        Raises UnreachableError as `state` does.
        """
        scaling = [limit for limit in self.limits if limit.longer_time == "relieves"]
        ratios = [limit.ratio(self._held(limit, x)) for limit in scaling]
        return np.concatenate(
            [np.broadcast_to(own, (len(self.t_norm), own.shape[1])) for own in ratios],
            axis=1,
        )

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the rows' Jacobian on its sparsity pattern, (nnz,); raises UnreachableError as `state` does."""
        self.evaluations["jacobians"] += 1
        entries = [
            part.ravel()
            for batch in batches(self.limits)
            for part in self._of_rows(batch, x)
        ]
        return np.concatenate(
            [*entries, self._progress.weight, np.ones(len(self.grid.lower))]
        )

    def gradient(self, partials: Partials, x: np.ndarray) -> np.ndarray:
        """Gradient, (v,), of a sum over the collocation points; raises UnreachableError as `state` does.

        Parameters
        ----------
        partials : Partials
            Of its terms with respect to the joints, one term a point: (K, 1, n).
        x : (v,) ndarray
        """
        return self._summed(
            list(self._chained([partials], x)), np.ones(len(self.t_norm))
        )[0]

    def _of_rows(self, batch: Sequence[Limit], x: np.ndarray) -> list[np.ndarray]:
        """Entries of the rows of limits that are differentiated together."""
        state = self.state(x)
        slopes = list(self._chained([limit.partials(state) for limit in batch], x))
        if not batch[0].guarantee.is_mean:
            return slopes
        entries = self._summed(slopes, self.grid.mean_weights(x[self._lengths]))
        values = np.concatenate([limit.values(state) for limit in batch], axis=1)
        entries[:, self._lengths] += values.T @ self.grid.mean_slopes.T
        return [entries]

    def _summed(self, slopes: Sequence[np.ndarray], weights: np.ndarray) -> np.ndarray:
        """Add up what `_chained` gives over the collocation points, with weights (K,): (c, v)."""
        points = [
            np.arange(len(self.t_norm)),
            *(place.point for place in self._places),
            self.grid.point,
        ]
        of_curves = [
            place.variable + part.start
            for place, part in zip(self._places, self.slices, strict=True)
        ]
        variables = [
            np.zeros_like(points[0]),
            *of_curves,
            self.grid.variable + self._lengths.start,
        ]
        terms = np.concatenate(slopes) * weights[np.concatenate(points)][:, None]
        return np.array(
            [
                np.bincount(np.concatenate(variables), term, self.variables)
                for term in terms.T
            ]
        )

    def _chained(
        self, functions: Sequence[Partials], x: np.ndarray
    ) -> Iterator[np.ndarray]:
        """Differentiate functions of the joint motion by T, each curve's variables and h, (places, c) all together."""
        state = self.state(x)
        each = [chain(partials, state) for partials in functions]
        orders = max(
            len(parts) for parts in each
        )  # up to the derivative of the curves that any function asks for
        padded = (
            (*parts, *[np.zeros_like(parts[0])] * (orders - len(parts)))
            for parts in each
        )
        by = [np.concatenate(parts, axis=1) for parts in zip(*padded, strict=True)]
        slopes = per_second(
            self.grid.slopes(x[self._lengths], self._control_points(x))[:orders], x[0]
        )
        drifts = zip(by, self._drifts(x), strict=False)
        yield np.asarray(
            sum(np.einsum("kcj,kj->kc", part, drift) for part, drift in drifts)
        )
        for j, (places, basis) in enumerate(
            zip(self._places, self._bases(x), strict=True)
        ):
            values = per_second(basis[:orders], x[0])
            parts = (
                part[places.point, :, j] * own[:, None]
                for part, own in zip(by, values, strict=True)
            )
            yield sum(parts, start=np.zeros(()))
        yield (
            np.concatenate(by, axis=2)[self.grid.point] @ np.hstack(slopes)[:, :, None]
        )[:, :, 0]

    def _drifts(self, x: np.ndarray) -> list[np.ndarray]:
        """Differentiate the curves and their time derivatives by T, (K, c) each: a longer time slows them down."""
        state = self.state(x)
        rates = np.array([spline.rate for spline in self.splines])
        moving = per_second(self.grid.basis(x[self._lengths]).curves(rates), x[0])
        orders = enumerate(
            zip(moving, (state.y, state.ydot, state.yddot, state.ydddot), strict=True)
        )
        return [rate - order / x[0] * part for order, (rate, part) in orders]

    def _bases(self, x: np.ndarray) -> list[np.ndarray]:
        """Basis functions of every curve's free variables, (3, z) each; computed anew where the grid's change."""
        basis = self.grid.basis(x[self._lengths])
        if self._entries is None or self._entries[0] is not basis:
            self._entries = (
                basis,
                [places.entries(basis.values) for places in self._places],
            )
        return self._entries[1]
