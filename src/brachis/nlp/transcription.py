"""The nonlinear program: minimum end time of spline trajectories along a path.

    minimise    t_E
    over        x = (t_E, s, q_r1, ..., q_rr)
    subject to  lower <= rows(x) <= upper,   x_lower <= x <= x_upper

Variables: the end time t_E in seconds, then the free control points (see `curves`) of s(t), then those of each
redundant joint in chain order. s(0) = 0, s(t_E) = 1, the start posture and rest at both ends are built into the control
points and have no rows.

Rows: for each constraint of `constraints.TABLE` that applies, in the table's order, its c values at collocation point
0, then at point 1, and so on; last the differences of successive control points of s, which are >= 0 so that
ds/dt >= 0 holds at all times. All rows are dimensionless.

Derivatives: with y = (s, q_r) and basis matrices B, B', B'' in normalised time,

    dy/dc = B,  dydot/dc = B' / t_E,  dyddot/dc = B'' / t_E^2,  dydot/dt_E = -ydot / t_E,  dyddot/dt_E = -2 yddot / t_E

and a constraint with partials (p_q, p_v, p_a) has d/dy = p_q G + p_v dqdot/dy + p_a dqddot/dy,
d/dydot = p_v G + p_a dqddot/dydot and d/dyddot = p_a G, with G and the rest from `kinematics.decomposition`.
"""

from __future__ import annotations

import copy
import itertools
from dataclasses import dataclass

import numpy as np

from brachis.bspline import clamped_uniform_knots
from brachis.kinematics import Decomposition, JointDerivatives, JointState
from brachis.nlp import constraints
from brachis.nlp.constraints import Constraint, Partials
from brachis.nlp.constraints.branch_margin import MARGIN
from brachis.nlp.curves import TiedSpline, Windows
from brachis.robot import Limits

_SHORTEST_TIME = 1e-4
_BISECTIONS = 45


@dataclass(frozen=True)
class Motion:
    """A point x of the NLP as curves.

    Attributes
    ----------
    t_end : float
        s.
    knots : ndarray
        In normalised time.
    degree : int
    control_points : (1 + r, N + d) ndarray
        Of s, then of each redundant joint in chain order.
    """

    t_end: float
    knots: np.ndarray
    degree: int
    control_points: np.ndarray

    @property
    def breaks(self) -> np.ndarray:
        """Times between which the curves are polynomials, (N + 1,), s."""
        return np.unique(self.knots) * self.t_end

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """y, ydot and yddot, each (K, 1 + r), at times t, (K,), in seconds."""
        windows = Windows.of(self.knots, self.degree, t / self.t_end)
        y, ydot, yddot = windows.curves(self.control_points)
        return y, ydot / self.t_end, yddot / self.t_end**2

    def times_of(self, s: np.ndarray) -> np.ndarray:
        """Find the times, (P,), s, at which path coordinates s, (P,), are reached; s(t) does not decrease."""
        low, high = np.zeros(len(s)), np.full(len(s), self.t_end)
        for _ in range(_BISECTIONS if len(s) else 0):
            middle = 0.5 * (low + high)
            order = np.argsort(middle, kind="stable")
            before = np.empty(len(s), dtype=bool)
            before[order] = self.at(middle[order])[0][:, 0] < s[order]
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return 0.5 * (low + high)


class Transcription:
    """The NLP as functions of x; see the module for its mathematics, variables and rows.

    Parameters
    ----------
    decomposition : Decomposition
    degree, intervals : int
    derivatives_at_rest : int
        1: zero velocity at both ends; 2: zero acceleration too.
    tau : (K,) ndarray
        Collocation points in normalised time, ascending, from 0 to 1.
    end : (n,) ndarray or None
        End posture, None where free.
    start_free : bool
        The motion begins anywhere near the decomposition's start posture, with its tool at the path's beginning.

    Attributes
    ----------
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
        decomposition: Decomposition,
        *,
        degree: int,
        intervals: int,
        derivatives_at_rest: int,
        tau: np.ndarray,
        end: np.ndarray | None = None,
        start_free: bool = False,
    ) -> None:
        self.decomposition = decomposition
        self.knots = clamped_uniform_knots(degree, intervals)
        self.degree = degree
        self.splines = self._make_splines(derivatives_at_rest, end, start_free=start_free)
        self.constraints = self._build_constraints(MARGIN)
        self._lay_out_variables()
        self._collocate(tau)

    def _collocate(self, tau: np.ndarray) -> None:
        """Set the collocation points and all that depends on them."""
        self.tau = tau
        self._windows = Windows.of(self.knots, self.degree, tau)
        self._entries = [self._windows.entries(spline) for spline in self.splines]
        self.evaluations = {"states": 0, "jacobians": 0}
        self._last: tuple[bytes, JointState] | None = None
        self._lay_out_rows()

    def resampled(self, tau: np.ndarray) -> Transcription:
        """Return the same problem with other collocation points `tau`, (K,); x keeps its meaning."""
        other = copy.copy(self)
        other._collocate(tau)  # noqa: SLF001  (its own class)
        return other

    def _make_splines(self, derivatives: int, end: np.ndarray | None, *, start_free: bool) -> tuple[TiedSpline, ...]:
        """s, then the redundant joints."""
        start = np.full(self.decomposition.robot.n, None) if start_free else self.decomposition.start
        pairs: list[tuple[float | None, float | None]] = [(0.0, 1.0)]
        pairs += [(start[joint], None if end is None else end[joint]) for joint in self.decomposition.redundant]
        return tuple(
            TiedSpline.resting(self.knots, self.degree, derivatives=derivatives, start=first, end=last)
            for first, last in pairs
        )

    def _lay_out_variables(self) -> None:
        """Slices of x and bounds on it."""
        ends = np.cumsum([1, *(spline.free for spline in self.splines)])
        self.slices = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))
        self.x_lower = np.full(ends[-1], -np.inf)
        self.x_upper = np.full(ends[-1], np.inf)
        self.x_lower[0] = _SHORTEST_TIME
        self.x_lower[self.slices[0]], self.x_upper[self.slices[0]] = 0.0, 1.0

    def _lay_out_rows(self) -> None:
        """Bounds of the rows and the Jacobian's sparsity pattern."""
        count = len(self.tau)
        lower, upper, rows, columns = [], [], [], []
        first = 0
        for constraint in self.constraints:
            size = len(constraint.lower)
            lower.append(np.tile(constraint.lower, count))
            upper.append(np.tile(constraint.upper, count))
            places = first + np.arange(count * size).reshape(count, size)
            rows.append(places.ravel())
            columns.append(np.zeros(count * size, dtype=int))
            for (point, variable, _), part in zip(self._entries, self.slices, strict=True):
                rows.append(places[point].ravel())
                columns.append(np.repeat(variable + part.start, size))
            first += count * size
        steps = self.splines[0].free - 1
        rows += [first + np.arange(steps), first + np.arange(steps)]
        columns += [self.slices[0].start + np.arange(steps), self.slices[0].start + 1 + np.arange(steps)]
        lower.append(np.zeros(steps))
        upper.append(np.full(steps, np.inf))
        self.lower, self.upper = np.concatenate(lower), np.concatenate(upper)
        self.jacobian_rows, self.jacobian_columns = np.concatenate(rows), np.concatenate(columns)

    def with_margin(self, margin: float) -> Transcription:
        """Return the same problem with another least branch margin; x keeps its meaning."""
        other = copy.copy(self)
        other.constraints = self._build_constraints(margin)
        other._collocate(self.tau)  # noqa: SLF001  (its own class)
        return other

    def with_limits(self, limits: Limits) -> Transcription:
        """Return the same problem for a robot with other limits; x and the branch margins keep their meaning."""
        other = copy.copy(self)
        other.decomposition = self.decomposition.with_limits(limits)
        other.constraints = other._build_constraints(max(self.guards, default=MARGIN))  # noqa: SLF001  (its own class)
        other._collocate(self.tau)  # noqa: SLF001  (its own class)
        return other

    def _build_constraints(self, margin: float) -> tuple[Constraint, ...]:
        built = (build(self.decomposition, margin) for build in constraints.TABLE.values())
        return tuple(c for c in built if c is not None)

    @property
    def guards(self) -> tuple[float, ...]:
        """Lower bounds of the constraints that guard the computation: the branch margins in force."""
        return tuple(float(bound) for c in self.constraints if not c.physical for bound in c.lower)

    def guard_slack(self, x: np.ndarray) -> float:
        """Smallest distance of a guard from its bound; infinite where there is none.

        Raises
        ------
        UnreachableError
            See `state`.
        """
        state = self.state(x)
        slacks = [(c.values(state) - c.lower).min() for c in self.constraints if not c.physical]
        return float(min(slacks, default=np.inf))

    @property
    def variables(self) -> int:
        """Number of variables."""
        return len(self.x_lower)

    def motion(self, x: np.ndarray) -> Motion:
        """Curves that belong to x."""
        return Motion(float(x[0]), self.knots, self.degree, self._control_points(x))

    def _control_points(self, x: np.ndarray) -> np.ndarray:
        """Control points (1 + r, N + d)."""
        parts = zip(self.splines, self.slices, strict=True)
        return np.array([spline.control_points(x[part]) for spline, part in parts])

    def variables_from(self, motion: Motion) -> np.ndarray:
        """Point x nearest to given curves over the same knots."""
        free = [spline.free_from(c) for spline, c in zip(self.splines, motion.control_points, strict=True)]
        return np.concatenate([[motion.t_end], *free])

    def objective(self, x: np.ndarray) -> float:
        """End time t_E, s."""
        return float(x[0])

    def gradient(self) -> np.ndarray:
        """Gradient of the objective (constant)."""
        unit = np.zeros(self.variables)
        unit[0] = 1.0
        return unit

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
            y, ydot, yddot = self._windows.curves(self._control_points(x))
            ydot, yddot = ydot / x[0], yddot / x[0] ** 2
            self._last = (key, self.decomposition.state(y, ydot, yddot, t=self.tau * x[0]))
        return self._last[1]

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (c,).

        Raises
        ------
        UnreachableError
            See `state`.
        """
        state = self.state(x)
        values = [constraint.values(state).ravel() for constraint in self.constraints]
        return np.concatenate([*values, np.diff(x[self.slices[0]])])

    def excess(self, x: np.ndarray) -> np.ndarray:
        """How far the physical limits are exceeded at every collocation point, (K, c); negative inside.

        Branch margins are left out: they guard the computation, and falling a little short of one harms nobody.

        Raises
        ------
        UnreachableError
            See `state`.
        """
        return self._excess(self.state(x))

    def excess_at(self, x: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """As `excess`, at other normalised times `tau`, (K,); 2 pi lifts follow the nearest collocation point."""
        motion, known = self.motion(x), self.state(x)
        place = np.clip(np.searchsorted(self.tau, tau), 0, len(self.tau) - 1)
        near = known.q[place] + known.qdot[place] * ((tau - self.tau[place]) * motion.t_end)[:, None]
        return self._excess(self.decomposition.state(*motion.at(tau * motion.t_end), near=near))

    def _excess(self, state: JointState) -> np.ndarray:
        limits = [c for c in self.constraints if c.physical]
        values = [(constraint.values(state), constraint) for constraint in limits]
        return np.concatenate([np.maximum(v - c.upper, c.lower - v) for v, c in values], axis=1)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the rows' Jacobian on its sparsity pattern, (nnz,).

        Raises
        ------
        UnreachableError
            See `state`.
        """
        state = self.state(x)
        self.evaluations["jacobians"] += 1
        exact = self.decomposition.derivatives(state)
        entries: list[np.ndarray] = []
        for constraint in self.constraints:
            by_y, by_ydot, by_yddot = chain(constraint.partials(state), state, exact)
            by_time = np.einsum("kcj,kj->kc", by_ydot, state.ydot) + 2.0 * np.einsum(
                "kcj,kj->kc", by_yddot, state.yddot
            )
            entries.append(by_time.ravel() / -x[0])
            for j, (point, _, basis) in enumerate(self._entries):
                entry = by_y[point, :, j] * basis[0][:, None]
                entry += by_ydot[point, :, j] * (basis[1] / x[0])[:, None]
                entry += by_yddot[point, :, j] * (basis[2] / x[0] ** 2)[:, None]
                entries.append(entry.ravel())
        steps = self.splines[0].free - 1
        return np.concatenate([*entries, np.full(steps, -1.0), np.ones(steps)])


def chain(partials: Partials, state: JointState, exact: JointDerivatives) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differentiate a constraint with respect to y, ydot and yddot, each (K, c, 1 + r), from its partials."""
    given = next(part for part in (partials.q, partials.qdot, partials.qddot) if part is not None)
    zeros = np.zeros((*given.shape[:2], state.y.shape[1]))
    by_y, by_ydot, by_yddot = zeros, zeros, zeros
    if partials.q is not None:
        by_y = by_y + partials.q @ state.gradient
    if partials.qdot is not None:
        by_y = by_y + partials.qdot @ exact.qdot_y
        by_ydot = by_ydot + partials.qdot @ state.gradient
    if partials.qddot is not None:
        by_y = by_y + partials.qddot @ exact.qddot_y
        by_ydot = by_ydot + partials.qddot @ exact.qddot_ydot
        by_yddot = by_yddot + partials.qddot @ state.gradient
    return by_y, by_ydot, by_yddot
