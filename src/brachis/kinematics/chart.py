"""Joint motion along a path as a function of y = (s, sigma), in a chart around a known joint path.

The self-motion of the arm is measured by r linear functions of the joints,

    sigma = C(s) q - p(s),

whose rows C (r, n) are transversal to the self-motion along the reference q_ref(s): J_aug = [J; C] is regular there,
and as far around it as its least singular value stays away from zero. Where one C does for the whole path, it is
constant and p = 0. The decomposition of the paper is the case of rows of C that each select a joint, with the closed
form in place of Newton's method (`closed_form`). With xi = dz/ds and derivatives by s alone, e = C' q - p' and
e' = C'' q - p'':

    G = dq/dy       = J_aug^-1 [xi, 0; -e, I]
    qdot            = G ydot
    qddot           = G yddot + J_aug^-1 (xi_ds sdot^2 - Jdot qdot;  -2 C' qdot sdot - e' sdot^2)

and, by differentiating J_aug qdot and J_aug qddot,

    dqdot/dy        = J_aug^-1 (-V_q G + [xi_ds sdot, 0];  -C' G sdot - [C' qdot + e' sdot, 0])
    dqddot/dydot    = J_aug^-1 (-A_v G + [2 xi_ds sdot, 0];  -2 C' G sdot - [2 C' qdot + 2 e' sdot, 0])
    dqddot/dy       = J_aug^-1 (-A_q G - A_v dqdot/dy + [xi_dds sdot^2 + xi_ds sddot, 0];
                                -2 C' sdot dqdot/dy - (C'' sdot^2 + C' sddot) G
                                - [C' qddot + 2 C'' qdot sdot + e'' sdot^2 + e' sddot, 0])

with V_q, A_q, A_v the derivatives of task velocity and acceleration (`TaskMap`).

The linear functions of the joints that measure self-motion in a chart: sigma = C(s) q - p(s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.errors import UnreachableError
from brachis.ik.newton import Newton
from brachis.kinematics.joint_map import JointDerivatives, PathState
from brachis.path import Path, PathSample
from brachis.robot import TaskMap

ORDERS = 4
"""Value and three derivatives by s."""
DEGREE = 5


@dataclass(frozen=True, eq=False)
class ChartRows:
    """Rows C (r, n) and offsets p (r,), constant or B-splines of s.

    Attributes
    ----------
    coefficients : (B, r, n + 1) ndarray
        Of [C, p]: one where they are constant, else the control points of splines of degree 5.
    knots : (B + 6,) ndarray or None
        None where they are constant.
    """

    coefficients: np.ndarray
    knots: np.ndarray | None = None

    @classmethod
    def constant(cls, rows: np.ndarray) -> ChartRows:
        """Take the same rows, (r, n), along the whole path, and p = 0."""
        return cls(np.concatenate([rows, np.zeros((len(rows), 1))], axis=1)[None])

    @classmethod
    def along(cls, s: np.ndarray, rows: np.ndarray, reference: np.ndarray) -> ChartRows:
        """Lead splines through rows, (S, r, n), and C q_ref = p, with reference postures (S, n), at S places."""
        from scipy.interpolate import make_interp_spline

        offset = np.einsum("sij,sj->si", rows, reference)
        spline = make_interp_spline(
            s, np.concatenate([rows, offset[:, :, None]], axis=2), k=DEGREE
        )
        return cls(np.asarray(spline.c), np.asarray(spline.t))

    @classmethod
    def of_arrays(cls, coefficients: np.ndarray, knots: np.ndarray) -> ChartRows:
        """Read what `arrays` gave."""
        return cls(coefficients, knots if len(knots) else None)

    @property
    def r(self) -> int:
        """Number of rows."""
        return int(self.coefficients.shape[1])

    @property
    def closes(self) -> bool:
        """Whether postures that are the same at both ends of the path have the same sigma there."""
        return self.knots is None

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients and knots as they are saved: no knots where the rows are constant."""
        return self.coefficients, np.empty(0) if self.knots is None else self.knots

    @property
    def selected(self) -> tuple[int, ...]:
        """The joints that the rows select, ascending; none where they are other rows than unit rows."""
        rows = self.coefficients[0, :, :-1]
        unit = self.knots is None and bool(
            np.all((rows == 0.0) | (rows == 1.0)) and np.all(rows.sum(axis=1) == 1.0)
        )
        return tuple(int(joint) for joint in np.argmax(rows, axis=1)) if unit else ()

    def _orders(self, s: np.ndarray, orders: int) -> np.ndarray:
        """[C, p] and its derivatives, (orders, K, r, n + 1)."""
        if self.knots is None:
            values = np.zeros((orders, len(s), *self.coefficients.shape[1:]))
            values[0] = self.coefficients[0]
            return values
        from scipy.interpolate import BSpline

        spline = BSpline(self.knots, self.coefficients, DEGREE)
        return np.array([spline(s, nu=order) for order in range(orders)])

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C, (K, r, n), and p, (K, r), at path coordinates (K,)."""
        (values,) = self._orders(s, 1)
        return values[:, :, :-1], values[:, :, -1]

    def values(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Sigma, (K, r), in postures (K, n) at path coordinates (K,)."""
        rows, offset = self.at(s)
        return np.einsum("kij,kj->ki", rows, q) - offset

    def orders(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C and three derivatives by s, (4, K, r, n), and the derivatives of C q - p by s alone, (3, K, r)."""
        values = self._orders(s, ORDERS)
        rows = values[..., :-1]
        return rows, np.einsum("okij,kj->oki", rows[1:], q) - values[1:, ..., -1]


CHART = "chart"
"""Label in the place of a branch's."""
_NEAR = 0.8
"""rad or m; how far from the reference its own self-motion tells where a posture is."""
_PLACES = 33
"""Places along the reference at which its typical least singular value is taken."""
_SINGULAR = 1e-9
"""A reference with a smaller least singular value is singular all along; its chart has no margin anywhere."""


@dataclass(frozen=True)
class ChartState(PathState):
    """Motion of all joints along a path at K times; `inverse` is J_aug^-1, (K, n, n).

    Attributes
    ----------
    rows : (4, K, r, n) ndarray
        C and its derivatives by s.
    drift : (3, K, r) ndarray
        e, e' and e''.
    least : (K,) ndarray
        Least singular value of J_aug.
    singular : (K, n) ndarray
        Its right singular vector.
    """

    rows: np.ndarray
    drift: np.ndarray
    least: np.ndarray
    singular: np.ndarray


class ChartMap:
    """Robot, path and chart put together: the `JointMap` with y = (s, sigma).

    Parameters
    ----------
    task_map : TaskMap
        Of the robot.
    path : Path
    rows : ChartRows
        C and p.
    s : (S,) ndarray
        Path coordinates of the reference, from 0 to 1.
    reference : (S, n) ndarray
        Postures q_ref there, so near each other that straight lines join them.
    """

    def __init__(
        self,
        task_map: TaskMap,
        path: Path,
        rows: ChartRows,
        s: np.ndarray,
        reference: np.ndarray,
    ) -> None:
        self.robot = task_map.robot
        self.task_map, self.path, self.rows = task_map, path, rows
        self.s, self.reference = s, reference
        self.start = np.asarray(reference[0])
        self._newton = Newton(task_map)
        null_motion = self._inverse_at(s, reference)[:, :, task_map.m :]
        self._table = np.concatenate(
            [reference, rows.values(s, reference), null_motion.reshape(len(s), -1)],
            axis=1,
        )
        even = np.linspace(0.0, 1.0, _PLACES)
        augmented = self._augmented_at(even, self._between(even)[0])
        least = np.linalg.svd(augmented, compute_uv=False)[:, -1]
        self._typical = max(float(np.median(least)), _SINGULAR)
        self._start_margin = float(least[0]) / self._typical
        self._side = float(np.sign(np.linalg.det(augmented[0])))

    def _augmented_at(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """J_aug, (K, n, n), in postures (K, n) at path coordinates (K,)."""
        return np.concatenate(
            [self._newton.task_coordinates(q)[1], self.rows.at(s)[0]], axis=1
        )

    def _inverse_at(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """J_aug^-1, (K, n, n); a pseudo-inverse, as some are singular where a reference is not regular throughout."""
        return np.asarray(np.linalg.pinv(self._augmented_at(s, q), rcond=_SINGULAR))

    def _between(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Postures (K, n), sigma (K, r) and dq/dsigma (K, n, r) of the reference, by straight lines in between."""
        right = np.clip(np.searchsorted(self.s, s, side="right"), 1, len(self.s) - 1)
        part = ((s - self.s[right - 1]) / (self.s[right] - self.s[right - 1])).clip(
            0.0, 1.0
        )[:, None]
        n, r = self.robot.n, self.r
        table = (1.0 - part) * self._table[right - 1] + part * self._table[right]
        return (
            table[:, :n],
            table[:, n : n + r],
            table[:, n + r :].reshape(len(s), n, r),
        )

    @property
    def r(self) -> int:
        """Degree of redundancy."""
        return self.rows.r

    @property
    def redundant_joints(self) -> tuple[str, ...]:
        """Names of the joints that sigma selects; none where it is another measure of self-motion."""
        return tuple(self.robot.joint_names[joint] for joint in self.rows.selected)

    @property
    def branch_label(self) -> str:
        """What the margin is called."""
        return CHART

    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Value of y = (s, sigma), (1 + r,), in a posture, (n,); NaN where that is NaN."""
        return self.curves(np.array([s]), q[None])[0]

    def curves(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Values of y, (K, 1 + r), in postures (K, n) at path coordinates (K,)."""
        return np.column_stack([s, self.rows.values(s, q)])

    def postures(
        self,
        y: np.ndarray,
        sample: PathSample | None = None,
        *,
        near: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint positions, (K, n), where the curves are y, (K, 1 + r), at any times.

        Parameters
        ----------
        y : (K, 1 + r) ndarray
        sample : PathSample, optional
            The path at ``y[:, 0]`` if already known.
        near : (K, n) ndarray, optional
            Postures known to be near; without them the search begins at the reference.

        Returns
        -------
        (K, n) ndarray
            NaN where there is no answer near the reference.
        """
        s = y[:, 0]
        targets = (sample or self.path.sample(s)).target
        rows, offset = self.rows.at(s)
        wanted = y[:, 1:] + offset
        if near is not None:
            return self._newton.solve(targets, near, rows, wanted)
        reference, sigma, null_motion = self._between(s)
        aside = np.einsum("kij,kj->ki", null_motion, y[:, 1:] - sigma)
        near_enough = np.abs(aside).max(axis=1, initial=0.0) < _NEAR
        return self._newton.solve(
            targets,
            np.where(near_enough[:, None], reference + aside, reference),
            rows,
            wanted,
        )

    def state(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        *,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> ChartState:
        """See `JointMap`."""
        sample = self.path.sample(y[:, 0])
        q = self.postures(y, sample, near=near)
        if not np.isfinite(q).all():
            raise UnreachableError("the chart has no posture there")
        twists = self.task_map.twists(q)
        rows, drift = self.rows.orders(y[:, 0], q)
        augmented = np.concatenate([self.task_map.jacobian(twists), rows[0]], axis=1)
        if (np.sign(np.linalg.det(augmented)) != self._side).any():
            raise UnreachableError(
                "the motion leaves the sheet of postures that the chart is laid on"
            )
        try:
            inverse = np.linalg.inv(augmented)
        except np.linalg.LinAlgError as error:
            raise UnreachableError("the chart is singular") from error
        m, sdot = self.task_map.m, ydot[:, :1]
        right = np.zeros((len(q), self.robot.n, 1 + self.r))
        right[:, :m, 0], right[:, m:, 0] = sample.xi, -drift[0]
        right[:, m:, 1:] = np.eye(self.r)
        gradient = inverse @ right
        qdot = np.einsum("kij,kj->ki", gradient, ydot)
        bent = -2.0 * sdot * np.einsum("kij,kj->ki", rows[1], qdot) - drift[1] * sdot**2
        given = np.concatenate(
            [sample.xi_ds * sdot**2 - self.task_map.bias(twists, qdot), bent], axis=1
        )
        qddot = np.einsum("kij,kj->ki", gradient, yddot) + np.einsum(
            "kij,kj->ki", inverse, given
        )
        least = _least_singular(inverse)
        return ChartState(
            self,
            y,
            ydot,
            yddot,
            ydddot,
            q,
            qdot,
            qddot,
            gradient,
            sample,
            twists,
            inverse,
            rows,
            drift,
            *least,
        )

    def derivatives(self, state: ChartState) -> JointDerivatives:
        """Exact derivatives of a state; see the module's formulas."""
        task = self.task_map.derivatives(state.twists, state.qdot, state.qddot)
        sdot, sddot, gradient, sample = (
            state.ydot[:, :1],
            state.yddot[:, :1],
            state.gradient,
            state.path,
        )
        _, first, second, _ = state.rows
        _, e_ds, e_dds = state.drift
        along = sdot[:, :, None]

        by_s = np.einsum("kij,kj->ki", first, state.qdot)
        rows = -first @ gradient * along
        rows[:, :, 0] -= by_s + e_ds * sdot
        qdot_y = self._solved(
            state, -task.velocity_q @ gradient, rows, sample.xi_ds * sdot
        )

        rows = -2.0 * first @ gradient * along
        rows[:, :, 0] -= 2.0 * (by_s + e_ds * sdot)
        qddot_ydot = self._solved(
            state, -task.acceleration_qdot @ gradient, rows, 2.0 * sample.xi_ds * sdot
        )

        rows = (
            -2.0 * first @ qdot_y * along
            - (second * along**2 + first * sddot[:, :, None]) @ gradient
        )
        rows[:, :, 0] -= (
            np.einsum("kij,kj->ki", first, state.qddot) + e_dds * sdot**2 + e_ds * sddot
        )
        rows[:, :, 0] -= 2.0 * sdot * np.einsum("kij,kj->ki", second, state.qdot)
        right = -task.acceleration_q @ gradient - task.acceleration_qdot @ qdot_y
        qddot_y = self._solved(
            state, right, rows, sample.xi_dds * sdot**2 + sample.xi_ds * sddot
        )
        return JointDerivatives(qdot_y, qddot_y, qddot_ydot)

    def _solved(
        self, state: ChartState, task: np.ndarray, rows: np.ndarray, by_s: np.ndarray
    ) -> np.ndarray:
        """J_aug^-1 (task + [by_s, 0]; rows), with parts (K, m, c), (K, r, c) and (K, m)."""
        task[:, :, 0] += by_s
        return state.inverse @ np.concatenate([task, rows], axis=1)

    def start_margins(self) -> np.ndarray:
        """See `JointMap`."""
        return np.array([self._start_margin])

    def margins(self, state: ChartState) -> np.ndarray:
        """See `JointMap`: the least singular value of J_aug, (K, 1), as a part of its median along the reference."""
        return state.least[:, None] / self._typical

    def margin_gradient(self, state: ChartState) -> tuple[np.ndarray, np.ndarray]:
        """See `JointMap`: for singular vectors u and v of the least singular value it changes by u^T dJ_aug v."""
        v = state.singular
        u = state.least[:, None] * np.einsum("kji,kj->ki", state.inverse, v)
        m = self.task_map.m
        moved = self.task_map.velocity_slopes(state.twists, v)
        by_s = np.einsum("ki,kij,kj->k", u[:, m:], state.rows[1], v)
        by_q = np.einsum("ki,kij->kj", u[:, :m], moved)
        return by_q[:, None] / self._typical, by_s[:, None] / self._typical


def _least_singular(inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least singular values (K,) of matrices, and their right singular vectors (K, n), from the inverses (K, n, n)."""
    values, vectors = np.linalg.eigh(inverse @ np.swapaxes(inverse, 1, 2))
    return 1.0 / np.sqrt(values[:, -1]), vectors[:, :, -1]
