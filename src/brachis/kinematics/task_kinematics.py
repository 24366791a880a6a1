"""Task velocity and acceleration of a batch of states and their derivatives.

Pinocchio gives the tool frame's Jacobian; all else follows from its columns J_i, twists (v, w) at the tool frame's
origin. Joints after joint i carry its axis relative to the tool, so that in the tool frame's own axes

    dJ_i/dq_k = [J_i, J_k] for i < k, else 0,        [X, Y] = (w_X x v_Y + v_X x w_Y, w_X x w_Y).

With V = J qdot, S_k the part of it that comes from the joints before joint k, a = J qddot + Jdot qdot and s_k its part:

    Jdot qdot = sum_k [S_k, J_k] qdot_k,             s_k = sum_{i<k} (J_i qddot_i + [S_i, J_i] qdot_i)
    dV/dq_k    = [S_k, J_k]
    da/dqdot_k = 2 [S_k, J_k] + [J_k, V]
    da/dq_k    = [s_k, J_k] + [[S_k, J_k], V - S_k]

(R. M. Murray, Z. Li, S. S. Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 3). For poses
these are the rows. Rows of a task space of positions, and yaw, are in world axes: the tool frame turns with w_k for
each joint k, and the classical acceleration of its origin is a_v + w x v. The formulas above hold in any axes that
stand still while the derivative is taken, so all is computed in the world's directions at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.ik.vectors import cross
from brachis.robot import Robot, TaskSpace


@dataclass(frozen=True)
class TaskDerivatives:
    """Derivatives of task velocity and acceleration for K states, each (K, m, n).

    Attributes
    ----------
    velocity_q : (K, m, n) ndarray
        V_q = d(J qdot)/dq.
    acceleration_q, acceleration_qdot : (K, m, n) ndarray
        A_q and A_v, of J qddot + Jdot qdot.
    """

    velocity_q: np.ndarray
    acceleration_q: np.ndarray
    acceleration_qdot: np.ndarray


class TaskKinematics:
    """First- and second-order task kinematics of a robot.

    Parameters
    ----------
    robot : Robot
    task_space : TaskSpace
    """

    def __init__(self, robot: Robot, task_space: TaskSpace) -> None:
        self.robot = robot
        self.task_space = task_space
        self._data = robot.model.createData()
        self._frame = robot.frame_id
        self._oriented = task_space.oriented
        self._axes = list(task_space.axes)
        self._yaw = None if task_space.yaw_axis is None else (task_space.yaw_world_axis, task_space.yaw_sign)

    def position(self, q: np.ndarray) -> np.ndarray:
        """Task coordinates (K, c) of K postures (K, n)."""
        return self.task_space.values(*self.robot.tool_placements(q))

    def twists(self, q: np.ndarray) -> np.ndarray:
        """Columns (6, K, n) of the tool frame's Jacobian: linear, then angular velocity.

        In the tool frame's axes for poses, in the world's for rows.
        """
        model, data, frame = self.robot.model, self._data, self._frame
        axes = pin.ReferenceFrame.LOCAL if self._oriented else pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        columns = np.empty((len(q), 6, self.robot.n))
        for k in range(len(q)):
            columns[k].flat = pin.computeFrameJacobian(model, data, q[k], frame, axes)  # (6,) for one joint
        return np.moveaxis(columns, 1, 0)

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Task Jacobian J (K, m, n) of K postures (K, n)."""
        return self.rows(self.twists(q))

    def rows(self, twists: np.ndarray) -> np.ndarray:
        """Select the task space's rows, (K, m, n), from twists (6, K, n)."""
        if self._oriented:
            return np.moveaxis(twists, 0, 1)
        chosen = twists[self._axes]
        if self._yaw is not None:
            axis, sign = self._yaw
            chosen = np.concatenate([chosen, sign * twists[3 + axis][None]])
        return np.moveaxis(chosen, 0, 1)

    def bias(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """Velocity-dependent task acceleration Jdot qdot, (K, m), from the `twists` at K postures."""
        before, _ = _sums(twists * qdot)
        acceleration = (_bracket(before, twists) * qdot).sum(axis=2, keepdims=True)
        if not self._oriented:
            velocity = (twists * qdot).sum(axis=2, keepdims=True)
            acceleration[:3] += cross(velocity[3:], velocity[:3])
        return self.rows(acceleration)[:, :, 0]

    def derivatives(self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> TaskDerivatives:
        """V_q, A_q and A_v of K states from the `twists` at their postures; see the module's formulas."""
        before, velocity = _sums(twists * qdot)
        velocity_q = _bracket(before, twists)
        parts, acceleration = _sums(twists * qddot + velocity_q * qdot)
        acceleration_q = _bracket(parts, twists) + _bracket(velocity_q, velocity - before)
        acceleration_qdot = 2.0 * velocity_q + _bracket(twists, velocity)
        if not self._oriented:
            turning, v, w = twists[3:], velocity[:3], velocity[3:]
            acceleration_qdot[:3] += cross(turning, v) + cross(w, twists[:3])
            acceleration_q[:3] += cross(velocity_q[3:], v) + cross(w, velocity_q[:3])
            classical = np.concatenate([acceleration[:3] + cross(w, v), acceleration[3:]])
            velocity_q = velocity_q + _turned(turning, velocity)
            acceleration_q += _turned(turning, classical)
        return TaskDerivatives(self.rows(velocity_q), self.rows(acceleration_q), self.rows(acceleration_qdot))


def _sums(parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add parts (6, K, n) over the joints before each one, (6, K, n), and over all, (6, K, 1)."""
    upto = np.cumsum(parts, axis=2)
    return upto - parts, upto[:, :, -1:]


def _bracket(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Lie bracket of twists (6, K, n or 1)."""
    v, w = first[:3], first[3:]
    return np.concatenate([cross(w, second[:3]) + cross(v, second[3:]), cross(w, second[3:])])


def _turned(turning: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rates (6, K, n) at which linear and angular parts (6, K, 1) change as their axes turn."""
    return np.concatenate([cross(turning, vectors[:3]), cross(turning, vectors[3:])])
