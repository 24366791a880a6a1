"""Task velocity and acceleration of a batch of states and their derivatives, through Pinocchio.

For a task space of rows these are the tool frame origin's velocity and classical acceleration in world axes
(LOCAL_WORLD_ALIGNED), and for yaw the angular velocity and acceleration about the plane's normal. For poses they are
the tool frame's spatial velocity and acceleration in its own axes (LOCAL), where the acceleration is the plain time
derivative of the velocity, the body twist.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.robot import Robot, TaskSpace

_LOCAL = pin.ReferenceFrame.LOCAL
_WORLD_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


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
        frame = robot.model.frames[self._frame]
        self._joint, self._placement = frame.parentJoint, frame.placement
        self._oriented = task_space.oriented
        self._axes = list(task_space.axes)
        self._yaw = None if task_space.yaw_axis is None else (task_space.yaw_world_axis, task_space.yaw_sign)

    def position(self, q: np.ndarray) -> np.ndarray:
        """Task coordinates (K, m) of K postures (K, n)."""
        return self.task_space.values(*self.robot.tool_placements(q))

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Task Jacobian J (K, m, n) of K postures (K, n)."""
        model, data, frame = self.robot.model, self._data, self._frame
        axes = _LOCAL if self._oriented else _WORLD_ALIGNED
        full = np.empty((len(q), 6, self.robot.n))
        for k in range(len(q)):
            full[k].flat = pin.computeFrameJacobian(model, data, q[k], frame, axes)  # (6,) for one joint
        return self._rows(full[:, :3], full[:, 3:])

    def bias(self, q: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """Velocity-dependent task acceleration Jdot qdot (K, m)."""
        model, data, frame, zero = self.robot.model, self._data, self._frame, np.zeros(self.robot.n)
        acceleration = pin.getFrameAcceleration if self._oriented else pin.getFrameClassicalAcceleration
        axes = _LOCAL if self._oriented else _WORLD_ALIGNED
        full = np.empty((len(q), 6, 1))
        for k in range(len(q)):
            pin.forwardKinematics(model, data, q[k], qdot[k], zero)
            full[k, :, 0] = acceleration(model, data, frame, axes).vector
        return self._rows(full[:, :3], full[:, 3:])[:, :, 0]

    def derivatives(self, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> TaskDerivatives:
        """V_q, A_q and A_v of K states (K, n)."""
        if self._oriented:
            return self._pose_derivatives(q, qdot, qddot)
        model, data = self.robot.model, self._data
        linear = np.empty((3, len(q), 3, self.robot.n))
        angular = np.zeros((3, len(q), 3, self.robot.n))
        shape = linear.shape[2:]
        for k in range(len(q)):
            pin.computeForwardKinematicsDerivatives(model, data, q[k], qdot[k], qddot[k])
            parts = pin.getPointClassicAccelerationDerivatives(
                model, data, self._joint, self._placement, _WORLD_ALIGNED
            )
            linear[0, k], linear[1, k], linear[2, k] = (part.reshape(shape) for part in parts[:3])
            if self._yaw is not None:
                spatial = pin.getFrameAccelerationDerivatives(model, data, self._frame, _WORLD_ALIGNED)
                angular[0, k], angular[1, k], angular[2, k] = (part[3:].reshape(shape) for part in spatial[:3])
        return TaskDerivatives(*(self._rows(linear[i], angular[i]) for i in range(3)))

    def _pose_derivatives(self, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> TaskDerivatives:
        """V_q, A_q and A_v of the tool frame's body twist."""
        model, data, frame = self.robot.model, self._data, self._frame
        full = np.empty((3, len(q), 6, self.robot.n))
        for k in range(len(q)):
            pin.computeForwardKinematicsDerivatives(model, data, q[k], qdot[k], qddot[k])
            parts = pin.getFrameAccelerationDerivatives(model, data, frame, _LOCAL)
            full[0, k], full[1, k], full[2, k] = parts[:3]
        return TaskDerivatives(*full)

    def _rows(self, linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
        """Select the task space's rows from (K, 3, n) linear and angular parts."""
        if self._oriented:
            return np.concatenate([linear, angular], axis=1)
        rows = linear[:, self._axes]
        if self._yaw is None:
            return rows
        axis, sign = self._yaw
        return np.concatenate([rows, sign * angular[:, [axis]]], axis=1)
