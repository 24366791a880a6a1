"""One phase of a motion: spline curves y, mapped to joints, that meet the limits at collocation points.

A phase has rows and variables x = (T, c_1, ..., c_c [, h]): its duration, the free control points of its curves, and
the interval lengths if the knots are free; see `layout`. If a time law gives s(t), T is given too, and s has no control
points. With basis matrices B, B', ... in normalised time,

    dy/dc = B,  dydot/dc = B' / T,  dyddot/dc = B'' / T^2,  dydot/dT = -ydot / T,  dyddot/dT = -2 yddot / T
    dy/dh = dB/dh c,  dydot/dh = dB'/dh c / T,  dyddot/dh = dB''/dh c / T^2,  and so on

Slopes of the limits with respect to y and its derivatives come from the `evaluator`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from brachis.common.arrays import LastCall
from brachis.kernel import VariableSlopes
from brachis.kinematics import JointMap, JointState
from brachis.limits import JointStates, Limit, Partials, Role
from brachis.limits.safeguards import MARGIN, build_branch_margins
from brachis.optimise.boundary import (
    Boundary,
    BoundarySpline,
    EndCondition,
    LocalBasis,
    sum_powers,
)
from brachis.optimise.bspline import ORDERS
from brachis.optimise.evaluator import Evaluation, Evaluator
from brachis.optimise.grid import FixedGrid, FreeGrid
from brachis.optimise.layout import RowLayout, VariableLayout
from brachis.optimise.motion import Motion, per_second, sample_law

_EACH_ORDER = np.arange(ORDERS)
"""Orders of derivatives: 0, 1, 2 and 3."""
_is_checked = attrgetter("is_checked_at_points")


class Phase:
    """A phase, evaluated through functions of its variables x; see the docstring of the module.

    Parameters
    ----------
    joint_map : JointMap
    limits : sequence of Limit
        Limits of robot, process and scene.
    grid : FixedGrid
        Knots and collocation points. In a `FreeGrid` the knots are variables.
    boundary : Boundary
    margin : float or None, optional
        Minimum branch margin, if the joint map has margins. It is added to the limits as a safeguard. With None, no
        safeguard is added.
    pause : float, optional
        Time that the arm waits at rest after the phase, s.
    layout : VariableLayout, optional
        Layout of another phase with the same grid and boundary. By default a new layout is built.

    Attributes
    ----------
    joint_map, grid, boundary, pause
        As given.
    time_law : TimeLaw or None
        Time law of s(t), if it is given.
    limits : tuple of Limit
        The given limits, then the safeguards.
    evaluator : Evaluator
        Evaluator of the joint map and the limits.
    splines : tuple of BoundarySpline
        One spline for each curve.
    slices : tuple of slice
        Positions of the variables of each curve.
    degree, knots, breaks, t_norm
        As in the grid.
    intervals, variables : int
        Numbers of knot intervals, N, and of variables, v.
    x_lower, x_upper : (v,) ndarray
    lower, upper : (c,) ndarray
        Bounds of the rows.
    """

    def __init__(
        self,
        joint_map: JointMap,
        limits: Sequence[Limit],
        grid: FixedGrid,
        boundary: Boundary,
        *,
        margin: float | None = MARGIN,
        pause: float = 0.0,
        layout: VariableLayout | None = None,
    ) -> None:
        safeguards = () if margin is None else build_branch_margins(joint_map, margin)
        self.joint_map = joint_map
        self.limits = (*limits, *safeguards)
        self.evaluator = Evaluator(joint_map, self.limits)
        self.grid = grid
        self.boundary = boundary
        self.pause = pause
        self.time_law = boundary.time_law
        if layout is None:
            layout = VariableLayout(grid, boundary, has_path=joint_map.path is not None)
        self._layout = layout
        self.splines = layout.splines
        self.slices = layout.slices
        self.degree = grid.degree
        self.knots = grid.knots
        self.breaks = grid.breaks
        self.intervals = len(grid.breaks) - 1
        self.t_norm = grid.t_norm
        self.variables = len(layout.x_lower)
        self._points_shape = len(self.splines), self.intervals + self.degree
        self.x_lower = layout.x_lower
        self.x_upper = layout.x_upper
        self._entries: tuple[LocalBasis, np.ndarray] | None = None
        self._rows = RowLayout(self.limits, grid, layout)
        self.lower = self._rows.lower
        self.upper = self._rows.upper
        self._evaluate = LastCall(self._evaluate_anew)
        self._slopes: tuple[Evaluation, np.ndarray] | None = None

    def with_grid(self, grid: FixedGrid, boundary: Boundary | None = None) -> Phase:
        """Return the same phase over another grid, with new boundary conditions if any are given."""
        is_same = boundary is None and grid.knots is self.grid.knots
        splines = self.splines if is_same else None
        boundary = boundary or self.boundary
        has_path = self.joint_map.path is not None
        layout = VariableLayout(grid, boundary, has_path=has_path, splines=splines)
        known = (self.joint_map, self.limits, grid, boundary)
        return Phase(*known, margin=None, pause=self.pause, layout=layout)

    def with_points(self, t_norm: np.ndarray) -> Phase:
        """Return the same phase with new collocation points `t_norm`. The knots and the meaning of x are unchanged."""
        return self.with_knots(self.knots, t_norm)

    def with_knots(self, knots: np.ndarray, t_norm: np.ndarray) -> Phase:
        """Return the same phase over new fixed knots, with collocation points `t_norm`, ascending from 0 to 1.

        If `knots` contain the current ones, ``variables_from(before.motion(x).with_knots(knots))`` is the same motion.
        """
        return self.with_grid(FixedGrid(knots, self.degree, t_norm))

    def with_free_knots(self, shortest: float) -> Phase:
        """Return the same phase with interval lengths as variables, each at least `shortest` mean intervals.

        If s(t) is given, the knots stay fixed: s at a collocation point would depend on the lengths of all intervals
        before it, and no time would be gained.
        """
        if self.time_law is not None:
            return self
        shortest = shortest / self.intervals
        return self.with_grid(FreeGrid(self.knots, self.degree, self.t_norm, shortest))

    def fix_knots(self, x: np.ndarray) -> Phase:
        """Return the same phase with its knots fixed at their positions for x."""
        return self.with_grid(self.grid.fix(self._h(x)))

    def with_limits(self, limits: Sequence[Limit]) -> Phase:
        """Return the same phase with new limits, safeguards included. The meaning of x is unchanged."""
        arguments = (self.joint_map, limits, self.grid, self.boundary)
        return Phase(*arguments, margin=None, pause=self.pause, layout=self._layout)

    def limits_near(self, curves: np.ndarray) -> list[Limit]:
        """Return the limits, reduced to values that matter close to given curves, (S, c); see `Limit.restrict_to`."""
        q = self.joint_map.postures(curves)
        restricted = [limit.restrict_to(q) for limit in self.limits]
        return [limit for limit in restricted if limit is not None]

    def restrict_to(self, curves: np.ndarray, *, is_followed: bool = False) -> Phase:
        """Return the same phase with those limits that `limits_near` returns for curves, (S, c).

        If splines will be laid along the motion and postures are free, limits on postures are narrowed by their inset.
        """
        limits = self.limits_near(curves)
        if is_followed and self.joint_map.r:
            ends = self.joint_map.postures(curves[[0, -1]])
            limits = [
                limit.keep_inside(ends) if limit.is_of_postures else limit
                for limit in limits
            ]
        return self.with_limits(limits)

    def with_margin(self, margin: float) -> Phase:
        """Return the same phase with a different minimum branch margin. The meaning of x is unchanged."""
        limits = [limit for limit in self.limits if limit.role is not Role.SAFEGUARD]
        return self.with_limits(
            [*limits, *build_branch_margins(self.joint_map, margin)]
        )

    @property
    def jacobian_rows(self) -> np.ndarray:
        """Row of each entry of the rows' Jacobian, (nnz,). Each place occurs once."""
        return self._rows.pattern[0]

    @property
    def jacobian_columns(self) -> np.ndarray:
        """Column of each entry of the rows' Jacobian, (nnz,)."""
        return self._rows.pattern[1]

    @property
    def names(self) -> list[str]:
        """Names of the variables; see `VariableLayout.names`."""
        return self._layout.names(
            self.joint_map.curve_names[self.boundary.law_curves :]
        )

    @property
    def lengths(self) -> slice:
        """Positions of the variables that are interval lengths; empty if the knots are fixed."""
        return self._layout.lengths

    @property
    def jumps(self) -> np.ndarray:
        """Knots, in normalised time, at which the highest derivative needed by a limit jumps."""
        order = max((limit.order for limit in self.limits), default=0)
        return self.breaks[1:-1] if self.degree <= order else np.empty(0)

    def _h(self, x: np.ndarray) -> np.ndarray:
        """Return the interval lengths that are variables; empty if the knots are fixed."""
        return x[self._layout.lengths]

    def motion(self, x: np.ndarray) -> Motion:
        """Return the curves that belong to x."""
        h = self._h(x)
        # If the lengths do not add up to exactly 1, the duration is scaled by their sum.
        t_end = float(x[0] * self.grid.t_norm_at(h)[-1])
        points = self._control_points(x)
        knots = self.grid.knots_at(h)
        return Motion(t_end, knots, self.degree, points, self.time_law)

    def _control_points(self, x: np.ndarray) -> np.ndarray:
        """Return the control points, (c, N + d)."""
        layout = self._layout
        free = layout.free_matrix.control_points(x)
        points = free + sum_powers(layout.fixed_terms, x[0])
        return points.reshape(self._points_shape)

    def _orders(
        self, x: np.ndarray, control_points: np.ndarray, *, is_slope: bool = False
    ) -> np.ndarray:
        """Return value and derivatives of all curves at the collocation points, (4, K, c), per unit of normalised time.

        If `is_slope`, the control points are slopes, and the slope of a curve with a time law is zero.
        """
        h = self._h(x)
        orders = self.grid.basis(h).curves(control_points)
        if self.time_law is None:
            return orders
        law_orders = sample_law(self.time_law, self.grid.t_norm_at(h))
        factor = 0.0 if is_slope else 1.0
        return np.concatenate([factor * law_orders, orders], axis=2)

    def scale_time(
        self, x: np.ndarray, factor: float, held: tuple[int, int] = (0, 0)
    ) -> np.ndarray:
        """Return the same motion, longer by a factor. A given duration does not change.

        Parameters
        ----------
        x : (v,) ndarray
        factor : float
        held : tuple of int, optional
            Numbers of time derivatives of the redundant joints that stay the same at start and end.
        """
        if self.time_law is not None:
            return x
        scaled = x.copy()
        scaled[0] *= factor
        if not any(held):
            return scaled
        motion = self.motion(scaled)
        before = self.motion(x)
        curves = np.array(before.at(np.array([0.0, before.t_end])))
        lost = curves * (1.0 - 1.0 / factor ** np.arange(ORDERS))[:, None, None]
        points = motion.control_points.copy()
        for j in range(1, len(points)):
            sides = [
                EndCondition(0.0, lost[1 : 1 + order, end, j])
                for end, order in enumerate(held)
            ]
            change = BoundarySpline.between(motion.knots, self.degree, *sides)
            points[j] += change.fixed_points(motion.t_end)
        return self.variables_from(replace(motion, control_points=points))

    def variables_from(self, motion: Motion) -> np.ndarray:
        """Return the point x closest to curves over the same knots, or over as many knots if the knots are free."""
        pairs = zip(self.splines, motion.control_points, strict=True)
        free = [spline.free_from(points, motion.t_end) for spline, points in pairs]
        h = self.grid.lengths_of(motion.knots)
        return np.concatenate([[motion.t_end], *free, h])

    def evaluate(self, x: np.ndarray) -> Evaluation:
        """Evaluate joint motion and limits at the collocation points. The result is cached until x changes.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        return self._evaluate(x)

    def _evaluate_anew(self, x: np.ndarray) -> Evaluation:
        curves = per_second(self._orders(x, self._control_points(x)), x[0])
        t = self.grid.t_norm_at(self._h(x)) * x[0]
        return self.evaluator.evaluate(*curves, t=t)

    def state(self, x: np.ndarray) -> JointState:
        """Return the joint motion at the collocation points; raise as `evaluate` does."""
        return self.evaluate(x).motion

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Compute the values of the rows, (c,); raise UnreachableError as `evaluate` does."""
        evaluation = self.evaluate(x)
        pairs = zip(self.limits, evaluation.by_limit, strict=True)
        values = [
            limit_values.ravel()
            for limit, limit_values in pairs
            if not limit.guarantee.is_mean
        ]
        totals = np.full(len(self.grid.total), self._h(x).sum())
        return np.concatenate([*values, self._layout.progress.values(x), totals])

    @property
    def value_rows(self) -> list[np.ndarray]:
        """Indices of the rows of each limit, (K, c) for each limit; empty, (0, c), for a limit on means."""
        return self._rows.of_limits

    def mean_weights(self, x: np.ndarray) -> np.ndarray:
        """Return the weights of the collocation points in a mean over the phase's time, (K,)."""
        return self.grid.mean_weights(self._h(x))

    def violation(self, x: np.ndarray) -> np.ndarray:
        """Return the violations of the limits at every collocation point, (K, c); negative if a limit is met.

        Limits on the whole motion are left out. Safeguards are left out too, because they are not physical limits.
        Raises UnreachableError as `evaluate` does.
        """
        return self.evaluate(x).violation(_is_checked)

    def violation_at(self, x: np.ndarray, t_norm: np.ndarray) -> np.ndarray:
        """Return violations at normalised times, (K,). The nearest collocation point determines full turns."""
        motion = self.motion(x)
        known = self.state(x)
        at = self.grid.t_norm_at(self._h(x))
        place = np.clip(np.searchsorted(at, t_norm), 0, len(at) - 1)
        ahead = ((t_norm - at[place]) * motion.t_end)[:, None]
        near = known.q[place] + known.qdot[place] * ahead
        evaluation = self.evaluator.evaluate(
            *motion.at(t_norm * motion.t_end), near=near
        )
        return evaluation.violation(_is_checked)

    def time_scaling_ratios(self, x: np.ndarray) -> np.ndarray:
        """Return ratios of values to their limits, (K, c), for limits that a longer time relieves; see `Limit.ratio`.

        Limits on means are left out, because a mean is the same at all points. Raises UnreachableError as `evaluate`
        does.
        """
        ratios = [np.empty((len(self.t_norm), 0))]
        for limit, values in zip(self.limits, self.evaluate(x).by_limit, strict=True):
            if limit.longer_time == "relieves" and not limit.guarantee.is_mean:
                ratios.append(limit.ratio(values))
        return np.hstack(ratios)

    def worst_time_scaling_ratio(self, x: np.ndarray) -> float:
        """Return the largest of `time_scaling_ratios`."""
        return float(np.abs(self.time_scaling_ratios(x)).max(initial=0.0))

    def posture_violation(self, motion: JointStates) -> float:
        """Return the largest violation, along a motion, of limits that depend only on postures; 0 if there are none."""
        limits = [limit for limit in self.limits if limit.is_of_postures]
        violations = [limit.violation(limit.values(motion)).max() for limit in limits]
        return float(max(violations, default=0.0))

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Compute the entries of the rows' Jacobian on its pattern, (nnz,); raise as `evaluate` does."""
        slopes = self.limit_slopes(x)
        is_mean = self.evaluator.is_mean
        if is_mean.any():
            slopes = slopes[:, ~is_mean]
        entries = (self._layout.progress.jacobian(x), np.ones(len(self.grid.lower)))
        return np.concatenate([slopes.ravel(), *entries])

    def limit_slopes(self, x: np.ndarray) -> np.ndarray:
        """Return slopes of all limits' values by the variables, (z, c); cache, and raise errors, as `evaluate` does."""
        evaluation = self.evaluate(x)
        if self._slopes is None or self._slopes[0] is not evaluation:
            slopes, entries = evaluation.differentiate(self._variable_slopes(x))
            self._slopes = (evaluation, self._add_lengths(entries, slopes, x))
        return self._slopes[1]

    def gradient(self, partials: Partials, x: np.ndarray) -> np.ndarray:
        """Return the gradient, (v,), of a sum over the collocation points; raise UnreachableError as `evaluate` does.

        Parameters
        ----------
        partials : Partials
            Partials of the terms of the sum with respect to the joints, (K, 1, n): one term per point.
        x : (v,) ndarray
        """
        return self.gradient_by_curves(self.evaluate(x).chain(partials), x)

    def gradient_by_curves(self, slopes: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the gradient, (v,), of a sum over the points from its slopes by y, ydot, ..., (orders, K, 1, c)."""
        entries = self.slopes_by_variables(slopes, x)
        return self.sum_up(entries)[0]

    def end_pattern(self, point: int) -> np.ndarray:
        """Return the variables, (z,), that affect the curves at the first (0) or last (-1) collocation point."""
        return self._layout.variable[self._at_end(point)]

    def end_slopes(self, x: np.ndarray, point: int) -> np.ndarray:
        """Return slopes of the curves and their time derivatives at an end, (4, c, z); see `end_pattern`."""
        # Each value is a curve, or a derivative of a curve, at this end.
        curves = len(self.boundary.start)
        values = ORDERS * curves
        by_curves = np.zeros((ORDERS, len(self.t_norm), values, curves))
        by_curves[:, point] = np.eye(values).reshape(-1, ORDERS, curves).swapaxes(0, 1)
        slopes = self.slopes_by_variables(by_curves, x)[self._at_end(point)]
        return slopes.T.reshape(ORDERS, curves, -1)

    def last_interval(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the duration of the last interval, s, and its relative slopes, (z,); see `end_pattern`."""
        growth = np.where(self.end_pattern(-1) == 0, 1.0 / x[0], 0.0)
        return float(x[0] * (1.0 - self.breaks[-2])), growth

    def _at_end(self, point: int) -> np.ndarray:
        """Return the indices of entries at the first or last collocation point, leaving out T if it is given."""
        number = range(len(self.t_norm))[point]
        is_free = (self._layout.variable > 0) | (self.time_law is None)
        return np.flatnonzero((self._layout.point == number) & is_free)

    def sum_up(
        self, slopes: np.ndarray, weights: np.ndarray | float = 1.0
    ) -> np.ndarray:
        """Return the sum, (c, v), of slopes, (z, c), over the collocation points with weights (K,)."""
        factors = np.broadcast_to(weights, len(self.t_norm))[self._layout.point]
        terms = slopes * factors[:, None]
        variable = self._layout.variable
        return np.array(
            [np.bincount(variable, term, self.variables) for term in terms.T]
        )

    def sum_outer_products(self, slopes: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the sum, (v, v), of g g^T over slopes g, (z, c), of values at points; weights (K, c) or (K, 1)."""
        columns = slopes.shape[1]
        rows = np.zeros((len(self.t_norm), columns, self.variables))
        point = self._layout.point[:, None]
        variable = self._layout.variable[:, None]
        rows[point, np.arange(columns), variable] = slopes
        flat = rows.reshape(-1, self.variables)
        return (rows * weights[:, :, None]).reshape(flat.shape).T @ flat

    def slopes_by_variables(self, by: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Convert slopes by y, ydot, ..., (orders, K, c, 1 + r), into slopes by the phase's variables, (z, c)."""
        entries = self._variable_slopes(x).find_entries(by)
        return self._add_lengths(entries, by, x)

    def _variable_slopes(self, x: np.ndarray) -> VariableSlopes:
        """Return slopes of the curves and their time derivatives with respect to T and each curve's variables."""
        shared = self._by_duration(x)[None]
        return VariableSlopes(shared, self._layout.pattern, self._basis(x))

    def _add_lengths(
        self, entries: np.ndarray, by: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        """Append slopes by h to the other slopes if the knots are free; see `slopes_by_variables`."""
        orders = len(by)
        if not len(self.grid.point):
            return entries
        by_h = self.grid.slopes(self._h(x), self._control_points(x))[:orders]
        together = np.concatenate(by[..., self.boundary.law_curves :], axis=2)
        of_lengths = (
            together[self.grid.point] @ np.hstack(per_second(by_h, x[0]))[:, :, None]
        )
        return np.concatenate([entries, of_lengths[:, :, 0]])

    def _by_duration(self, x: np.ndarray) -> np.ndarray:
        """Return slopes of the curves and their time derivatives with respect to T, (4, K, c)."""
        rates = -_EACH_ORDER / x[0]
        slower = np.array(self.state(x).curves) * rates[:, None, None]
        terms = self._layout.fixed_terms
        if len(terms) == 1:
            return slower
        points = sum_powers(terms, x[0], slope=True).reshape(self._points_shape)
        moving = per_second(self._orders(x, points, is_slope=True), x[0])
        return np.array(moving) + slower

    def _basis(self, x: np.ndarray) -> np.ndarray:
        """Return slopes of the curves and their time derivatives by the variables between T and h, (4, z)."""
        basis = self.grid.basis(self._h(x))
        if self._entries is None or self._entries[0] is not basis:
            self._entries = (basis, self._layout.sparsity.entries(basis.values))
        return self._entries[1] / (x[0] ** _EACH_ORDER)[:, None]
