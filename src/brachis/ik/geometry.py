"""Screw axes of a chain, taken from the Pinocchio model; the closed forms match and compute with these alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.robot import Robot


@dataclass(frozen=True)
class ChainGeometry:
    """A serial chain as screw axes at the zero posture, in the world frame.

    Attributes
    ----------
    joint_names : tuple of str
    revolute : (n,) bool ndarray
        True for a revolute, False for a prismatic joint.
    axes : (n, 3) ndarray
        Unit direction of rotation or of translation.
    points : (n, 3) ndarray
        A point on each axis of rotation, m (zero for prismatic joints).
    tool_position : (3,) ndarray
        Tool frame origin at the zero posture, m.
    tool_rotation : (3, 3) ndarray
        Tool frame orientation at the zero posture.
    """

    joint_names: tuple[str, ...]
    revolute: np.ndarray
    axes: np.ndarray
    points: np.ndarray
    tool_position: np.ndarray
    tool_rotation: np.ndarray

    @classmethod
    def of(cls, robot: Robot) -> ChainGeometry:
        """Read the screws off the world Jacobian at the zero posture: columns (v, w), a point is w x v."""
        zero = np.zeros(robot.n)
        data = robot.model.createData()
        columns = pin.computeJointJacobians(robot.model, data, zero).reshape(6, robot.n)
        linear, angular = columns[:3].T, columns[3:].T
        revolute = np.linalg.norm(angular, axis=1) > 0.5  # noqa: PLR2004  (unit or zero)
        placement = robot.tool_placement(zero)
        return cls(
            joint_names=robot.joint_names,
            revolute=revolute,
            axes=np.where(revolute[:, None], angular, linear),
            points=np.where(revolute[:, None], np.cross(angular, linear), 0.0),
            tool_position=np.array(placement.translation),
            tool_rotation=np.array(placement.rotation),
        )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    def forward(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tool position and world directions of all joint axes, by the product of exponentials.

        Parameters
        ----------
        q : (K, n) ndarray
            Real, or complex for complex-step derivatives.

        Returns
        -------
        position : (K, 3) ndarray
            World frame, m.
        directions : (K, n, 3) ndarray
            World direction of every joint's axis.
        """
        count = len(q)
        rotation = np.broadcast_to(np.eye(3, dtype=q.dtype), (count, 3, 3))
        offset = np.zeros((count, 3), dtype=q.dtype)
        directions = np.empty((count, self.n, 3), dtype=q.dtype)
        for i in range(self.n):
            directions[:, i] = rotation @ self.axes[i]
            if self.revolute[i]:
                turn = _rotations(self.axes[i], q[:, i])
                offset = offset + np.einsum("kij,kj->ki", rotation, self.points[i] - turn @ self.points[i])
                rotation = rotation @ turn
            else:
                offset = offset + directions[:, i] * q[:, i, None]
        return offset + rotation @ self.tool_position, directions


def _rotations(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotation matrices (K, 3, 3) about one unit axis (Rodrigues' formula)."""
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + np.sin(angle)[:, None, None] * cross + (1.0 - np.cos(angle))[:, None, None] * (cross @ cross)
