"""Joint motion along a path as a function of y = (s, q_r): the joint space decomposition.

The non-redundant joints follow from the closed form, q_nr = IK(z(s), q_r). With J = [J_r | J_nr] the task Jacobian
and xi = dz/ds, velocities and accelerations follow from J qdot = xi sdot and
J qddot + Jdot qdot = xi_ds sdot^2 + xi sddot:

    G = dq/dy:        G_r = (0, I),  G_nr = J_nr^-1 [xi, -J_r]
    qdot            = G ydot
    qddot_nr        = J_nr^-1 (xi_ds sdot^2 + xi sddot - J_r qddot_r - Jdot qdot)
    dqdot/dydot     = G
    dqdot_nr/dy     = J_nr^-1 ([xi_ds sdot, 0] - V_q G)
    dqddot/dyddot   = G
    dqddot_nr/dydot = J_nr^-1 ([2 xi_ds sdot, 0] - A_v G)
    dqddot_nr/dy    = J_nr^-1 ([xi_dds sdot^2 + xi_ds sddot, 0] - A_q G - A_v dqdot/dy)

with V_q, A_q, A_v the derivatives of task velocity and acceleration (`TaskMap`). Rows of redundant joints are
constant: their derivatives vanish.
"""

from __future__ import annotations

import numpy as np

from brachis.errors import UnreachableError
from brachis.ik import IKSolver, margin_gradient
from brachis.kinematics.joint_map import JointDerivatives, JointState, PathState
from brachis.path import Path, PathSample
from brachis.robot import TaskMap
from brachis.robot.joints import TURN, complement, difference, in_turn_of

_SURE = 0.25
"""A step that differs from its prediction by more than this part of a turn is not counted."""


class ClosedFormMap:
    """Robot, path, closed form and branch, put together: the `JointMap` with y = (s, q_r).

    Parameters
    ----------
    task_map : TaskMap
        Of the robot.
    path : Path
    solver : IKSolver
    redundant : tuple of int
        Indices of the redundant joints, ascending.
    branch : int
        Index into ``solver.branches``.
    start : (n,) ndarray
        Start posture; turns of its angles by 2 pi are chosen to begin nearest to it.
    """

    def __init__(
        self,
        task_map: TaskMap,
        path: Path,
        solver: IKSolver,
        redundant: tuple[int, ...],
        branch: int,
        start: np.ndarray,
    ) -> None:
        self.robot = robot = task_map.robot
        self.task_map = task_map
        self.path = path
        self.solver = solver
        self.redundant = list(redundant)
        self.nonredundant = complement(robot.n, redundant)
        self.branch = branch
        self.start = start
        self._turning = robot.revolute[self.nonredundant]
        self._turns = [
            joint
            for joint, turning in zip(self.nonredundant, self._turning, strict=True)
            if turning
        ]
        limits = robot.limits
        ranged = np.isfinite(limits.position_lower) | np.isfinite(limits.position_upper)
        self._ranged = ranged[self._turns]

    @property
    def r(self) -> int:
        """Degree of redundancy."""
        return len(self.redundant)

    @property
    def redundant_joints(self) -> tuple[str, ...]:
        """Names of the redundant joints."""
        return tuple(self.robot.joint_names[joint] for joint in self.redundant)

    @property
    def branch_label(self) -> str:
        """Label of the branch."""
        return self.solver.branches[self.branch]

    def branch_margins(self, q: np.ndarray) -> np.ndarray:
        """Margins of the branch, (K, b), in postures (K, n)."""
        return self.solver.branch_margins(q, self.branch)

    def branch_margin_gradient(self, q: np.ndarray) -> np.ndarray:
        """Differentiate `branch_margins` with respect to q, (K, b, n)."""
        return margin_gradient(self.solver, q, self.branch)

    def start_margins(self) -> np.ndarray:
        """See `JointMap`."""
        return np.asarray(self.branch_margins(self.start[None])[0])

    def margins(self, state: JointState) -> np.ndarray:
        """See `JointMap`."""
        return self.branch_margins(state.q)

    def margin_gradient(self, state: JointState) -> tuple[np.ndarray, None]:
        """See `JointMap`."""
        return self.branch_margin_gradient(state.q), None

    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Value of y = (s, q_r), (1 + r,), in a posture, (n,)."""
        return np.append(s, q[self.redundant])

    def postures(
        self,
        y: np.ndarray,
        sample: PathSample | None = None,
        *,
        near: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint positions at K successive times, continuous from the start posture on.

        Of the alternatives in the branch the one nearest to its predecessor is taken.

        Parameters
        ----------
        y : (K, 1 + r) ndarray
            In the order of time, beginning at the start.
        sample : PathSample, optional
            The path at ``y[:, 0]`` if already known.
        near : (K, n) ndarray, optional
            Postures known to be near; they choose among the alternatives, and the times may be any.

        Returns
        -------
        (K, n) ndarray
            NaN in the non-redundant joints where the branch has no answer.
        """
        sample = sample or self.path.sample(y[:, 0])
        answers = self.solver.solve_branch(sample.target, y[:, 1:], self.branch)
        if self.solver.alternatives == 1:
            answers = answers[:, 0]
        else:
            answers = (
                self._tracked(answers)
                if near is None
                else self._nearest(answers, near[:, self.nonredundant])
            )
        turning = self._turning
        if turning.any() and np.all(np.isfinite(answers)):
            turns = np.vstack(
                [self.start[self.nonredundant][None, turning], answers[:, turning]]
            )
            answers[:, turning] = np.unwrap(turns, axis=0)[1:]
        q = np.empty((len(y), self.robot.n))
        q[:, self.redundant] = y[:, 1:]
        q[:, self.nonredundant] = answers
        return q

    def _nearest(self, answers: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Choose from answers (K, A, m) those nearest to postures (K, m), modulo 2 pi."""
        gap = difference(answers, near[:, None], self._turning)
        distance = np.linalg.norm(gap, axis=2)
        choice = np.argmin(np.where(np.isfinite(distance), distance, np.inf), axis=1)
        return answers[np.arange(len(answers)), choice]

    def _tracked(self, answers: np.ndarray) -> np.ndarray:
        """Choose from answers (K, A, m) at successive times a joint path, each nearest to its predecessor."""
        joint_path = np.empty((len(answers), len(self.nonredundant)))
        previous = self.start[self.nonredundant]
        for k in range(len(answers)):
            joint_path[k] = self._nearest(answers[k : k + 1], previous[None])[0]
            if np.isfinite(joint_path[k]).all():
                previous = joint_path[k]
        return joint_path

    def state(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        *,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> PathState:
        """Joint motion at K times.

        Parameters
        ----------
        y, ydot, yddot, ydddot : (K, 1 + r) ndarray
            Path coordinate and redundant joints, and their time derivatives.
        t : (K,) ndarray, optional
            The times, ascending from the start on, s. Turns by 2 pi are then chosen so that angles follow their own
            velocities from the start posture on. Without `t` and `near`, successive times must be so close that no
            joint turns by pi in between.
        near : (K, n) ndarray, optional
            Postures known to be near; turns of angles follow these, and the times may be any.

        Raises
        ------
        UnreachableError
            The branch has no answer at one of the times, J_nr is singular there, or the times are so far apart that
            the turns of a joint with a range cannot be counted.
        """
        sample = self.path.sample(y[:, 0])
        q = self.postures(y, sample, near=near)
        if not np.all(np.isfinite(q)):
            raise UnreachableError("the target is out of the branch's reach")
        twists = self.task_map.twists(q)
        jacobian = self.task_map.jacobian(twists)
        try:
            inverse = np.linalg.inv(jacobian[:, :, self.nonredundant])
        except np.linalg.LinAlgError as error:
            raise UnreachableError("J_nr is singular") from error
        gradient = self._gradient(sample, jacobian, inverse)
        qdot = np.einsum("kij,kj->ki", gradient, ydot)
        # What the redundant joints and the path leave to the non-redundant ones.
        wanted = sample.xi_ds * ydot[:, :1] ** 2 - self.task_map.bias(twists, qdot)
        qddot = np.einsum("kij,kj->ki", gradient, yddot)
        qddot[:, self.nonredundant] += np.einsum("kij,kj->ki", inverse, wanted)
        if near is not None:
            q = in_turn_of(q, near, np.isin(np.arange(self.robot.n), self._turns))
        elif (
            t is not None and self._ranged.any()
        ):  # otherwise no limit asks which turn an angle is in
            self._follow(q, qdot, qddot, t)
        return PathState(
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
        )

    def _follow(
        self, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, t: np.ndarray
    ) -> None:
        """Choose turns of angles, in place, that follow their velocities; the quintic's rule predicts each step."""
        turns, h = self._turns, np.diff(t)[:, None]
        v, a = qdot[:, turns], qddot[:, turns]
        predicted = 0.5 * h * (v[1:] + v[:-1]) - h**2 / 12.0 * np.diff(a, axis=0)
        gap = (predicted - np.diff(q[:, turns], axis=0)) / TURN
        counted = np.round(gap)
        unsure = np.abs(gap - counted) > _SURE
        if np.any(unsure & self._ranged):
            raise UnreachableError(
                "a joint turns too far between collocation points to count its turns"
            )
        first = np.round((self.start[turns] - q[0, turns]) / TURN)
        q[:, turns] += TURN * (
            first + np.vstack([np.zeros(len(turns)), np.cumsum(counted, axis=0)])
        )

    def _gradient(
        self, sample: PathSample, jacobian: np.ndarray, inverse: np.ndarray
    ) -> np.ndarray:
        """G = dq/dy, (K, n, 1 + r)."""
        gradient = np.zeros((len(jacobian), self.robot.n, 1 + self.r))
        gradient[:, self.redundant, np.arange(1, 1 + self.r)] = 1.0
        columns = np.concatenate(
            [sample.xi[:, :, None], -jacobian[:, :, self.redundant]], axis=2
        )
        gradient[:, self.nonredundant] = inverse @ columns
        return gradient

    def derivatives(self, state: PathState) -> JointDerivatives:
        """Exact derivatives of a state; see the module's formulas."""
        task = self.task_map.derivatives(state.twists, state.qdot, state.qddot)
        sdot, sddot = state.ydot[:, :1], state.yddot[:, :1]
        sample, zeros = state.path, np.zeros_like(state.gradient)
        qdot_y, qddot_y, qddot_ydot = zeros, zeros.copy(), zeros.copy()
        right = -task.velocity_q @ state.gradient
        right[:, :, 0] += sample.xi_ds * sdot
        qdot_y[:, self.nonredundant] = state.inverse @ right
        right = -task.acceleration_qdot @ state.gradient
        right[:, :, 0] += 2.0 * sample.xi_ds * sdot
        qddot_ydot[:, self.nonredundant] = state.inverse @ right
        right = -task.acceleration_q @ state.gradient - task.acceleration_qdot @ qdot_y
        right[:, :, 0] += sample.xi_dds * sdot**2 + sample.xi_ds * sddot
        qddot_y[:, self.nonredundant] = state.inverse @ right
        return JointDerivatives(qdot_y, qddot_y, qddot_ydot)
