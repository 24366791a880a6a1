"""The nonlinear program: minimum end time of spline trajectories along a path.

    minimise    t_E
    over        x = (t_E, s, q_r1, ..., q_rr [, h])
    subject to  lower <= rows(x) <= upper,   x_lower <= x <= x_upper

See `layout` for the variables and rows. With y = (s, q_r) and basis matrices B, B', B'' in normalised time,

    dy/dc = B,  dydot/dc = B' / t_E,  dyddot/dc = B'' / t_E^2,  dydot/dt_E = -ydot / t_E,  dyddot/dt_E = -2 yddot / t_E
    dy/dh = dB/dh c,  dydot/dh = dB'/dh c / t_E,  dyddot/dh = dB''/dh c / t_E^2

and a limit with partials (p_q, p_v, p_a) has d/dy = p_q G + p_v dqdot/dy + p_a dqddot/dy,
d/dydot = p_v G + p_a dqddot/dydot and d/dyddot = p_a G, with G and the rest from `kinematics.decomposition`.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from brachis.kinematics import Decomposition, JointState
from brachis.limits import Bound, Limit, Role, branch_margin, moved
from brachis.limits.branch_margin import MARGIN
from brachis.nlp.chain import by_time, chain, timed
from brachis.nlp.curves import TiedSpline, Windows
from brachis.nlp.grid import FixedGrid, FreeGrid, Grid
from brachis.nlp.layout import Layout
from brachis.nlp.motion import Motion


class Transcription:
    """The NLP as functions of x; see the module for its mathematics, variables and rows.

    Parameters
    ----------
    decomposition : Decomposition
    limits : sequence of Limit
        Of robot, process and scene; safeguards of the decomposition are added.
    degree : int
    knots : (N + 2 d + 1,) ndarray
        Clamped knot vector in normalised time.
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
    grid : Grid
        Knots and collocation points.
    limits : tuple of Limit
        Those given, then the safeguards.
    end, start_free
        As given.
    """

    def __init__(
        self,
        decomposition: Decomposition,
        limits: Sequence[Limit],
        *,
        degree: int,
        knots: np.ndarray,
        derivatives_at_rest: int,
        tau: np.ndarray,
        end: np.ndarray | None = None,
        start_free: bool = False,
    ) -> None:
        self.decomposition = decomposition
        self.limits = (*limits, *safeguards_of(decomposition, MARGIN))
        self._derivatives_at_rest = derivatives_at_rest
        self.end, self.start_free = end, start_free
        self._lay_out(FixedGrid(knots, degree, tau))

    def _lay_out(self, grid: Grid) -> None:
        """Set the grid and all that depends on it."""
        self.grid = grid
        self.splines = self._make_splines()
        layout = Layout.of(grid, self.splines, self.limits)
        self.slices, self._lengths, self._places = layout.slices, layout.lengths, layout.places
        self.x_lower, self.x_upper = layout.x_lower, layout.x_upper
        self.lower, self.upper = layout.lower, layout.upper
        self.jacobian_rows, self.jacobian_columns = layout.jacobian_rows, layout.jacobian_columns
        self._entries: tuple[Windows, list[np.ndarray]] | None = None
        self._last: tuple[bytes, JointState] | None = None
        self.evaluations = {"states": 0, "jacobians": 0}

    def _over(self, grid: Grid) -> Transcription:
        other = copy.copy(self)
        other._lay_out(grid)  # noqa: SLF001  (its own class)
        return other

    def resampled(self, tau: np.ndarray) -> Transcription:
        """Return the same problem over its present knots, fixed, with other collocation points; x keeps its meaning.

        Parameters
        ----------
        tau : (K,) ndarray
            In normalised time, ascending, from 0 to 1.
        """
        return self.with_knots(self.knots, tau)

    def with_knots(self, knots: np.ndarray, tau: np.ndarray) -> Transcription:
        """Return the same problem over other fixed knots, with collocation points `tau`.

        Where `knots` contain the present ones, ``variables_from(before.motion(x).over(knots))`` is the same motion.
        """
        return self._over(FixedGrid(knots, self.degree, tau))

    def with_free_knots(self, shortest: float) -> Transcription:
        """Return the same problem with interval lengths as variables, each at least `shortest` mean intervals."""
        knots, degree = self.knots, self.degree
        return self._over(FreeGrid(knots, degree, self.tau, shortest / (len(knots) - 2 * degree - 1)))

    def frozen(self, x: np.ndarray) -> tuple[Transcription, np.ndarray]:
        """Return the problem with its knots fixed where they are at x, and the same motion as its point x."""
        grid = self.grid.frozen(x[self._lengths])
        if grid is self.grid:
            return self, x
        other = self._over(grid)
        return other, other.variables_from(self.motion(x))

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
    def tau(self) -> np.ndarray:
        """Collocation points in normalised time, (K,); see `Grid`."""
        return self.grid.tau

    def _make_splines(self) -> tuple[TiedSpline, ...]:
        """s, then the redundant joints."""
        start, end = self.decomposition.start, self.end
        pairs: list[tuple[float | None, float | None]] = [(0.0, 1.0)]
        pairs += [
            (None if self.start_free else start[joint], None if end is None else end[joint])
            for joint in self.decomposition.redundant
        ]
        return tuple(
            TiedSpline.resting(self.knots, self.degree, derivatives=self._derivatives_at_rest, start=first, end=last)
            for first, last in pairs
        )

    def with_margin(self, margin: float) -> Transcription:
        """Return the same problem with another least branch margin; x keeps its meaning."""
        own = tuple(limit for limit in self.limits if limit.role is not Role.SAFEGUARD)
        return self._under((*own, *safeguards_of(self.decomposition, margin)))

    def relaxed(self, limit: Limit, bound: Bound, amount: float) -> Transcription:
        """Return the same problem with a figure of one of its limits giving way by `amount`, in the figure's unit."""
        return self._under(moved(self.limits, limit, bound, amount))

    def _under(self, limits: tuple[Limit, ...]) -> Transcription:
        other = copy.copy(self)
        other.limits = limits
        other._lay_out(self.grid)  # noqa: SLF001  (its own class)
        return other

    @property
    def _safeguards(self) -> list[Limit]:
        return [limit for limit in self.limits if limit.role is Role.SAFEGUARD]

    @property
    def guards(self) -> tuple[float, ...]:
        """Least values of the safeguards in force: branch margins."""
        return tuple(float(bound) for limit in self._safeguards for bound in limit.lower)

    def guard_slack(self, x: np.ndarray) -> float:
        """Smallest distance of a safeguard from its bound; infinite where there is none.

        Raises
        ------
        UnreachableError
            See `state`.
        """
        state = self.state(x)
        slacks = [(limit.values(state) - limit.lower).min() for limit in self._safeguards]
        return float(min(slacks, default=np.inf))

    @property
    def variables(self) -> int:
        """Number of variables."""
        return len(self.x_lower)

    def motion(self, x: np.ndarray) -> Motion:
        """Curves that belong to x."""
        h = x[self._lengths]
        # Should the lengths add up to a little more or less than 1, so much longer or shorter is the motion.
        span = self.grid.tau_at(h)[-1]
        return Motion(float(x[0] * span), self.grid.knots_at(h), self.degree, self._control_points(x))

    def _control_points(self, x: np.ndarray) -> np.ndarray:
        """Control points (1 + r, N + d)."""
        parts = zip(self.splines, self.slices, strict=True)
        return np.array([spline.control_points(x[part]) for spline, part in parts])

    def variables_from(self, motion: Motion) -> np.ndarray:
        """Point x nearest to given curves over the same knots, or over as many where these are free."""
        free = [spline.free_from(c) for spline, c in zip(self.splines, motion.control_points, strict=True)]
        return np.concatenate([[motion.t_end], *free, self.grid.lengths_of(motion.knots)])

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
            h = x[self._lengths]
            y, ydot, yddot = self.grid.windows(h).curves(self._control_points(x))
            ydot, yddot = ydot / x[0], yddot / x[0] ** 2
            self._last = (key, self.decomposition.state(y, ydot, yddot, t=self.grid.tau_at(h) * x[0]))
        return self._last[1]

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (c,).

        Raises
        ------
        UnreachableError
            See `state`.
        """
        state = self.state(x)
        values = [limit.values(state).ravel() for limit in self.limits]
        totals = np.full(len(self.grid.total), x[self._lengths].sum())
        return np.concatenate([*values, np.diff(x[self.slices[0]]), totals])

    def violation(self, x: np.ndarray) -> np.ndarray:
        """How far the limits are exceeded at every collocation point, (K, c); negative inside.

        Safeguards are left out: falling a little short of one harms nobody.

        Raises
        ------
        UnreachableError
            See `state`.
        """
        return self._violation(self.state(x))

    def violation_at(self, x: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """As `violation`, at other normalised times `tau`, (K,); 2 pi lifts follow the nearest collocation point."""
        motion, known, at = self.motion(x), self.state(x), self.grid.tau_at(x[self._lengths])
        place = np.clip(np.searchsorted(at, tau), 0, len(at) - 1)
        near = known.q[place] + known.qdot[place] * ((tau - at[place]) * motion.t_end)[:, None]
        return self._violation(self.decomposition.state(*motion.at(tau * motion.t_end), near=near))

    def _violation(self, state: JointState) -> np.ndarray:
        own = [limit for limit in self.limits if limit.role is not Role.SAFEGUARD]
        return np.concatenate([limit.violation(limit.values(state)) for limit in own], axis=1)

    def time_scaling_ratios(self, x: np.ndarray) -> np.ndarray:
        """Ratios, (K, c), to the limits that a longer time relieves; see `Limit.ratio`.

        Raises
        ------
        UnreachableError
            See `state`.
        """
        state = self.state(x)
        scaling = [limit for limit in self.limits if limit.time_scaling]
        return np.concatenate([limit.ratio(limit.values(state)) for limit in scaling], axis=1)

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
        bases = [timed(basis, x[0]) for basis in self._bases(x)]
        slopes = np.hstack(timed(self.grid.slopes(x[self._lengths], self._control_points(x)), x[0]))
        entries: list[np.ndarray] = []
        for limit in self.limits:
            by = chain(limit.partials(state), state, exact)
            entries.append(by_time(by, state).ravel() / -x[0])
            for j, (places, basis) in enumerate(zip(self._places, bases, strict=True)):
                parts = (part[places.point, :, j] * values[:, None] for part, values in zip(by, basis, strict=True))
                entries.append(sum(parts, start=np.zeros(())).ravel())
            entries.append((np.concatenate(by, axis=2)[self.grid.point] @ slopes[:, :, None]).ravel())
        steps = self.splines[0].free - 1
        ones = np.ones(len(self.grid.lower))
        return np.concatenate([*entries, np.full(steps, -1.0), np.ones(steps), ones])

    def _bases(self, x: np.ndarray) -> list[np.ndarray]:
        """Basis functions of every curve's free variables, (3, z) each; computed anew where the windows change."""
        windows = self.grid.windows(x[self._lengths])
        if self._entries is None or self._entries[0] is not windows:
            self._entries = windows, [places.entries(windows.values) for places in self._places]
        return self._entries[1]


def safeguards_of(decomposition: Decomposition, margin: float) -> tuple[Limit, ...]:
    """Build what keeps the motion where the decomposition can be computed."""
    built = branch_margin.build(decomposition, margin)
    return () if built is None else (built,)
