"""One phase of a motion: spline curves y, mapped to joints, within limits at collocation points.

A phase has variables x = (T, c_1, ..., c_c [, h]), its duration and the free control points of its curves, and rows;
see `layout`. With basis matrices B, B', B'' in normalised time,

    dy/dc = B,  dydot/dc = B' / T,  dyddot/dc = B'' / T^2,  dydot/dT = -ydot / T,  dyddot/dT = -2 yddot / T
    dy/dh = dB/dh c,  dydot/dh = dB'/dh c / T,  dyddot/dh = dB''/dh c / T^2

and a limit with partials (p_q, p_v, p_a) has d/dy = p_q G + p_v dqdot/dy + p_a dqddot/dy,
d/dydot = p_v G + p_a dqddot/dydot and d/dyddot = p_a G, with G and the rest from the joint map.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence

import numpy as np

from brachis.kinematics import JointDerivatives, JointMap, JointState
from brachis.limits import Limit, Partials, Role, branch_margin
from brachis.limits.branch_margin import MARGIN
from brachis.nlp.boundary import Boundary, LocalBasis
from brachis.nlp.chain import by_time, chain, timed
from brachis.nlp.grid import FixedGrid, FreeGrid, Grid
from brachis.nlp.layout import Layout
from brachis.nlp.motion import Motion


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

    def __init__(self, joint_map: JointMap, limits: Sequence[Limit], grid: Grid, boundary: Boundary) -> None:
        self.joint_map = joint_map
        self.limits = (*limits, *branch_margin.build(joint_map, MARGIN))
        self._lay_out(grid, boundary)

    def _lay_out(self, grid: Grid, boundary: Boundary) -> None:
        """Set grid and boundary conditions, and all that depends on them."""
        self.grid, self.boundary = grid, boundary
        self.splines = boundary.splines(grid.knots, grid.degree)
        layout = Layout.of(grid, self.splines, self.limits, path=self.joint_map.path is not None)
        self.slices, self._lengths, self._places = layout.slices, layout.lengths, layout.places
        self._progress = layout.progress
        self.x_lower, self.x_upper = layout.x_lower, layout.x_upper
        self.lower, self.upper = layout.lower, layout.upper
        self.jacobian_rows, self.jacobian_columns = layout.jacobian_rows, layout.jacobian_columns
        self._entries: tuple[LocalBasis, list[np.ndarray]] | None = None
        self._last: tuple[bytes, JointState] | None = None
        self._exact: tuple[JointState, JointDerivatives] | None = None
        self.evaluations = {"states": 0, "jacobians": 0}

    def over(self, grid: Grid, boundary: Boundary | None = None) -> Phase:
        """Return the same phase over another grid, and with other boundary conditions where they are given."""
        other = copy.copy(self)
        other._lay_out(grid, boundary or self.boundary)  # noqa: SLF001  (its own class)
        return other

    def resampled(self, t_norm: np.ndarray) -> Phase:
        """Return the same phase over its present knots, with collocation points `t_norm`; x keeps its meaning."""
        return self.with_knots(self.knots, t_norm)

    def with_knots(self, knots: np.ndarray, t_norm: np.ndarray) -> Phase:
        """Return the same phase over other fixed knots, with collocation points `t_norm`, ascending from 0 to 1.

        Where `knots` contain the present ones, ``variables_from(before.motion(x).over(knots))`` is the same motion.
        """
        return self.over(FixedGrid(knots, self.degree, t_norm))

    def with_free_knots(self, shortest: float) -> Phase:
        """Return the same phase with interval lengths as variables, each at least `shortest` mean intervals."""
        return self.over(FreeGrid(self.knots, self.degree, self.t_norm, shortest / self.intervals))

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
        return self.with_limits((*own, *branch_margin.build(self.joint_map, margin)))

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
        return np.array([first + own if own >= 0 else -1 for own, first in found], dtype=int)

    def motion(self, x: np.ndarray) -> Motion:
        """Curves that belong to x."""
        h = x[self._lengths]
        # Should the lengths add up to a little more or less than 1, so much longer or shorter is the motion.
        span = self.grid.t_norm_at(h)[-1]
        return Motion(float(x[0] * span), self.grid.knots_at(h), self.degree, self._control_points(x))

    def _control_points(self, x: np.ndarray) -> np.ndarray:
        """Control points (c, N + d)."""
        parts = zip(self.splines, self.slices, strict=True)
        return np.array([spline.control_points(x[part], x[0]) for spline, part in parts])

    def variables_from(self, motion: Motion) -> np.ndarray:
        """Point x nearest to given curves over the same knots, or over as many where these are free."""
        pairs = zip(self.splines, motion.control_points, strict=True)
        free = [spline.free_from(points, motion.t_end) for spline, points in pairs]
        return np.concatenate([[motion.t_end], *free, self.grid.lengths_of(motion.knots)])

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
            y, ydot, yddot = self.grid.basis(h).curves(self._control_points(x))
            ydot, yddot = ydot / x[0], yddot / x[0] ** 2
            self._last = (key, self.joint_map.state(y, ydot, yddot, t=self.grid.t_norm_at(h) * x[0]))
        return self._last[1]

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (c,); raises UnreachableError as `state` does."""
        state = self.state(x)
        values = [limit.values(state).ravel() for limit in self.limits]
        totals = np.full(len(self.grid.total), x[self._lengths].sum())
        return np.concatenate([*values, self._progress.values(x), totals])

    def has(self, limit: Limit) -> bool:
        """Tell whether a limit is one of the phase's, the very object."""
        return any(each is limit for each in self.limits)

    def rows_of(self, limit: Limit) -> np.ndarray:
        """Numbers of the rows of one of the limits, (K, c)."""
        before = self.limits[: [each is limit for each in self.limits].index(True)]
        count, size = len(self.t_norm), len(limit.lower)
        return count * sum(len(each.lower) for each in before) + np.arange(count * size).reshape(count, size)

    def violation(self, x: np.ndarray) -> np.ndarray:
        """How far the limits are violated at every collocation point, (K, c); negative inside.

        Safeguards are left out: falling a little short of one harms nobody. Raises UnreachableError as `state` does.
        """
        return self._violation(self.state(x))

    def violation_at(self, x: np.ndarray, t_norm: np.ndarray) -> np.ndarray:
        """As `violation`, at other normalised times, (K,); turns of 2 pi follow the nearest collocation point."""
        motion, known, at = self.motion(x), self.state(x), self.grid.t_norm_at(x[self._lengths])
        place = np.clip(np.searchsorted(at, t_norm), 0, len(at) - 1)
        near = known.q[place] + known.qdot[place] * ((t_norm - at[place]) * motion.t_end)[:, None]
        return self._violation(self.joint_map.state(*motion.at(t_norm * motion.t_end), near=near))

    def _violation(self, state: JointState) -> np.ndarray:
        own = [limit for limit in self.limits if limit.role is not Role.SAFEGUARD]
        return np.concatenate([limit.violation(limit.values(state)) for limit in own], axis=1)

    def time_scaling_ratios(self, x: np.ndarray) -> np.ndarray:
        """Ratios, (K, c), to the limits that a longer time relieves; see `Limit.ratio`.

        Raises UnreachableError as `state` does.
        """
        state = self.state(x)
        scaling = [limit for limit in self.limits if limit.time_scaling]
        return np.concatenate([limit.ratio(limit.values(state)) for limit in scaling], axis=1)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the rows' Jacobian on its sparsity pattern, (nnz,); raises UnreachableError as `state` does."""
        state = self.state(x)
        self.evaluations["jacobians"] += 1
        entries = [part.ravel() for part in self._chained([limit.partials(state) for limit in self.limits], x)]
        return np.concatenate([*entries, self._progress.weight, np.ones(len(self.grid.lower))])

    def gradient(self, partials: Partials, x: np.ndarray) -> np.ndarray:
        """Gradient, (v,), of a sum over the collocation points; raises UnreachableError as `state` does.

        Parameters
        ----------
        partials : Partials
            Of its terms with respect to the joints, one term a point: (K, 1, n).
        x : (v,) ndarray
        """
        of_curves = [place.variable + part.start for place, part in zip(self._places, self.slices, strict=True)]
        of_time, of_lengths = np.zeros(len(self.t_norm), dtype=int), self.grid.variable + self._lengths.start
        slopes = np.concatenate([part.ravel() for part in self._chained([partials], x)])
        return np.bincount(np.concatenate([of_time, *of_curves, of_lengths]), slopes, self.variables)

    def _chained(self, functions: Sequence[Partials], x: np.ndarray) -> Iterator[np.ndarray]:
        """Differentiate each function of the joint motion by T, each curve's variables and h, (places, c) each."""
        state, exact = self.state(x), self._derivatives(x)
        moving = timed(self._basis_of_rates(x), x[0])
        bases = [timed(basis, x[0]) for basis in self._bases(x)]
        slopes = np.hstack(timed(self.grid.slopes(x[self._lengths], self._control_points(x)), x[0]))
        for partials in functions:
            by = chain(partials, state, exact)
            drifts = (np.einsum("kcj,kj->kc", part, rate) for part, rate in zip(by, moving, strict=True))
            yield sum(drifts, start=by_time(by, state) / -x[0])
            for j, (places, basis) in enumerate(zip(self._places, bases, strict=True)):
                parts = (part[places.point, :, j] * values[:, None] for part, values in zip(by, basis, strict=True))
                yield sum(parts, start=np.zeros(()))
            yield np.concatenate(by, axis=2)[self.grid.point] @ slopes[:, :, None]

    def _derivatives(self, x: np.ndarray) -> JointDerivatives:
        """Differentiate the state at x; kept until x changes, as the state is."""
        state = self.state(x)
        if self._exact is None or self._exact[0] is not state:
            self._exact = state, self.joint_map.derivatives(state)
        return self._exact[1]

    def _basis_of_rates(self, x: np.ndarray) -> np.ndarray:
        """Differentiate the curves and their derivatives by the duration at fixed t_norm, (3, K, c)."""
        rates = np.array([spline.rate for spline in self.splines])
        return self.grid.basis(x[self._lengths]).curves(rates)

    def _bases(self, x: np.ndarray) -> list[np.ndarray]:
        """Basis functions of every curve's free variables, (3, z) each; computed anew where the grid's change."""
        basis = self.grid.basis(x[self._lengths])
        if self._entries is None or self._entries[0] is not basis:
            self._entries = basis, [places.entries(basis.values) for places in self._places]
        return self._entries[1]
