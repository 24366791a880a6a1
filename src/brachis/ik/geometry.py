"""Screw axes of a chain, taken from the Pinocchio model; the closed forms match and compute with these alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from brachis.arrays import cross
from brachis.robot import Robot


@dataclass(frozen=True)
class PosedScrews:
    """Screw axes of a chain at K postures, in the world frame; components along the first axis (see `vectors`).

    Attributes
    ----------
    axes : (3, n, K) ndarray
        Unit directions of rotation or translation.
    points : (3, n, K) ndarray
        A point on each axis of rotation, m; without meaning for prismatic joints.
    tool_position : (3, K) ndarray
        m.
    tool_rotation : (3, 3, K) ndarray
    revolute : (n,) bool ndarray
    """

    axes: np.ndarray
    points: np.ndarray
    tool_position: np.ndarray
    tool_rotation: np.ndarray
    revolute: np.ndarray

    def jacobian_columns(self, joints: Sequence[int]) -> np.ndarray:
        """Columns (6, len(joints), K) of the tool's Jacobian: linear, then angular velocity, in world axes."""
        chosen = list(joints)
        axes, turns = self.axes[:, chosen], self.revolute[chosen][:, None]
        lever = self.tool_position[:, None] - self.points[:, chosen]
        return np.concatenate([np.where(turns, cross(axes, lever), axes), np.where(turns, axes, 0.0)])


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

    @cached_property
    def _generators(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """For each axis the matrices (3, 3) of Rodrigues' formula that sine and 1 - cosine of the angle go with.

        They act from the left on the columns' index of rotation matrices (3, 3, K or 1): one product for all samples.
        """
        skews = [np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]) for x, y, z in self.axes]
        return [(skew, skew @ skew) for skew in skews]

    def posed(self, q: np.ndarray) -> PosedScrews:
        """Screw axes and tool placement at K postures, by the product of exponentials.

        Parameters
        ----------
        q : (K, n) ndarray
            Real, or complex for complex-step derivatives.
        """
        return self._moved(q.T, np.ones(self.n, dtype=bool))

    def held(self, joints: Sequence[int], q_held: np.ndarray) -> PosedScrews:
        """Screw axes and tool placement where some joints are held at given positions and all others are zero.

        Parameters
        ----------
        joints : sequence of int
            The joints that are held, ascending.
        q_held : (K, h) ndarray
            Their positions, rad or m.
        """
        moving = np.zeros(self.n, dtype=bool)
        moving[list(joints)] = True
        q = np.zeros((self.n, len(q_held)))
        q[moving] = q_held.T
        return self._moved(q, moving)

    def _moved(self, q: np.ndarray, moving: np.ndarray) -> PosedScrews:
        """Move joints one after the other; q is (n, K), and `moving` says which of them move at all."""
        count = q.shape[1]
        axes, points = (np.empty((3, self.n, count), dtype=q.dtype) for _ in range(2))
        rotation, offset = np.eye(3, dtype=q.dtype)[:, :, None], np.zeros((3, 1), dtype=q.dtype)
        placed = 0
        for i in np.flatnonzero(moving).tolist():
            here = slice(placed, i + 1)
            axes[:, here] = self.axes[here] @ rotation
            points[:, here] = self.points[here] @ rotation + offset[:, None]
            if self.revolute[i]:
                first, second = self._generators[i]
                rotation = rotation + (first @ rotation) * np.sin(q[i]) + (second @ rotation) * (1.0 - np.cos(q[i]))
                offset = points[:, i] - (self.points[i, None] @ rotation)[:, 0]
            else:
                offset = offset + axes[:, i] * q[i]
            placed = i + 1
        axes[:, placed:] = self.axes[placed:] @ rotation
        points[:, placed:] = self.points[placed:] @ rotation + offset[:, None]
        position = (self.tool_position[None] @ rotation)[:, 0] + offset
        tool = self.tool_rotation.T @ rotation
        return PosedScrews(
            axes, points, np.broadcast_to(position, (3, count)), np.broadcast_to(tool, (3, 3, count)), self.revolute
        )
