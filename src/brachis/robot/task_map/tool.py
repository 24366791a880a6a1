"""The tool as task space: its pose, rows of its position in the world frame, or two such rows and yaw in their plane.

Velocity and acceleration of the tool frame and their derivatives come from the columns of its Jacobian. The columns J_i
are twists (v, w) at the tool frame's origin. Joints after joint i carry its axis relative to the tool, so that in the
tool frame's own axes

    dJ_i/dq_k = [J_i, J_k] for i < k, else 0,        [X, Y] = (w_X x v_Y + v_X x w_Y, w_X x w_Y).

With V = J qdot, S_k the part of it that comes from the joints before joint k, a = J qddot + Jdot qdot and s_k its part:

    s_k = sum_{i<k} (J_i qddot_i + [S_i, J_i] qdot_i)
    dV/dq_k    = [S_k, J_k]
    da/dqdot_k = 2 [S_k, J_k] + [J_k, V]
    da/dq_k    = [s_k, J_k] + [[S_k, J_k], V - S_k]

(R. M. Murray, Z. Li, S. S. Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 3). They hold in
any axes that stand still while the derivative is taken. Rows of the position use the world's axes: there the tool frame
turns with w_k for each joint k, and the classical acceleration of its origin is a_v + w x v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pinocchio as pin

from brachis.common.arrays import cross
from brachis.errors import InputError
from brachis.robot.joints import principal
from brachis.robot.task_map.protocol import POSE_ROWS, TaskDerivatives, TaskMap
from brachis.task import ToolPose
from brachis.task.points.units import rotation_by


def _derive(
    twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> tuple[np.ndarray, np.ndarray, TaskDerivatives]:
    """V and a, (6, K, 1), of K states (K, n), and their derivatives, (6, K, n), from the `twists` at their postures."""
    before, velocity = _sums(twists * qdot)
    velocity_q = _bracket(before, twists)
    parts, acceleration = _sums(twists * qddot + velocity_q * qdot)
    derivatives = TaskDerivatives(
        velocity_q=velocity_q,
        acceleration_q=_bracket(parts, twists)
        + _bracket(velocity_q, velocity - before),
        acceleration_qdot=2.0 * velocity_q + _bracket(twists, velocity),
    )
    return velocity, acceleration, derivatives


def _turn(turning: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rates (6, K, n) at which linear and angular parts (6, K, 1) change as their axes turn, at `turning` (3, K, n)."""
    return np.concatenate([cross(turning, vectors[:3]), cross(turning, vectors[3:])])


def _sums(parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add parts (6, K, n) over the joints before each one, (6, K, n), and over all, (6, K, 1)."""
    upto = np.cumsum(parts, axis=2)
    return upto - parts, upto[:, :, -1:]


def _bracket(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Lie bracket of twists (6, K, n or 1)."""
    v = first[:3]
    w = first[3:]
    return np.concatenate(
        [cross(w, second[:3]) + cross(v, second[3:]), cross(w, second[3:])]
    )


@dataclass(frozen=True, eq=False, repr=False)
class Pose(TaskMap):
    """The tool frame's pose.

    It has 12 coordinates for its 6 rows: the position (3), then the rotation matrix row by row (9), both in the world
    frame. Its rows are those of the body twist: displacement (m) and rotation (rad) along and about the tool frame's
    own axes, as the formulas of `twists` give them.
    """

    frame: ClassVar[pin.ReferenceFrame] = pin.ReferenceFrame.LOCAL

    rows: tuple[str, ...] = POSE_ROWS

    def read(self, stated: Sequence[float] | ToolPose, where: str) -> np.ndarray:
        """Return the coordinates, (12,), of a pose that a task states."""
        if not isinstance(stated, ToolPose):
            raise InputError(
                "the orientation is missing",
                where=where,
                found=list(stated),
                allowed="a position with an orientation (ToolPose)",
            )
        convention, values = stated.convention_and_numbers
        rotation = rotation_by(convention, np.array(values))
        return np.concatenate([stated.position, rotation.as_matrix().ravel()])

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Return positions and rotation matrices row by row, (K, 12)."""
        return np.concatenate([positions, rotations.reshape(-1, 9)], axis=1)

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the translation and the rotation vector, (..., 6), in the frame of `second`."""
        first = np.asarray(first, dtype=float)
        first, second = np.broadcast_arrays(first, np.asarray(second, dtype=float))
        shape = first.shape[:-1]
        to = first[..., 3:].reshape(*shape, 3, 3)
        back = np.swapaxes(second[..., 3:].reshape(*shape, 3, 3), -1, -2)
        shift = np.einsum("...ij,...j->...i", back, first[..., :3] - second[..., :3])
        turn = [pin.log3(part) for part in (back @ to).reshape(-1, 3, 3)]
        return np.concatenate([shift, np.reshape(turn, (*shape, 3))], axis=-1)

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """Return the twists themselves."""
        return twists

    def velocity_slopes(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """Return dV/dq, (K, 6, n)."""
        before, _ = _sums(twists * qdot)
        return self.jacobian(_bracket(before, twists))

    def derivatives(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TaskDerivatives:
        """Return dV/dq, da/dq and da/dqdot, each (K, 6, n)."""
        return self._of_rows(_derive(twists, qdot, qddot)[2])


@dataclass(frozen=True, eq=False, repr=False)
class WorldRows(TaskMap):
    """Rows of the tool frame's position in the world frame; task coordinates are the rows themselves."""

    frame: ClassVar[pin.ReferenceFrame] = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Return the rows of the positions, (K, m)."""
        return positions[:, list(self.axes)]

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """Return the rows of the linear velocity."""
        return twists[list(self.axes)]

    def velocity_slopes(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """Return the slopes of the velocity in the world's axes, which stand still, (K, m, n)."""
        before, velocity = _sums(twists * qdot)
        return self.jacobian(_bracket(before, twists) + _turn(twists[3:], velocity))

    def derivatives(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TaskDerivatives:
        """Return the derivatives of velocity and classical acceleration in the world's axes, (K, m, n) each."""
        velocity, classical, tool = _derive(twists, qdot, qddot)
        v = velocity[:3]
        w = velocity[3:]
        turning = twists[3:]
        velocity_q = tool.velocity_q
        tool.acceleration_qdot[:3] += cross(turning, v) + cross(w, twists[:3])
        tool.acceleration_q[:3] += cross(velocity_q[3:], v) + cross(w, velocity_q[:3])
        classical[:3] += cross(w, v)
        return self._of_rows(
            TaskDerivatives(
                velocity_q=velocity_q + _turn(turning, velocity),
                acceleration_q=tool.acceleration_q + _turn(turning, classical),
                acceleration_qdot=tool.acceleration_qdot,
            )
        )


@dataclass(frozen=True, eq=False, repr=False)
class RowsAndYaw(WorldRows):
    """Two rows of the tool frame's position in the world frame and, last, yaw (rad).

    Yaw turns the first row's axis towards the second's; it is the direction of the tool-frame axis `tool_axis` within
    the plane of these two rows.

    Attributes
    ----------
    tool_axis : int
        Axis of the tool frame (0, 1, 2).
    """

    tool_axis: int

    @property
    def sign(self) -> float:
        """+1 where yaw turns about the positive world axis, -1 otherwise."""
        first, second = self.axes
        return 1.0 if (second - first) % 3 == 1 else -1.0

    @property
    def world_axis(self) -> int:
        """World axis (0, 1, 2) about which yaw turns."""
        return 3 - sum(self.axes)

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Return the rows of the positions, and yaw in (-pi, pi]."""
        first, second = self.axes
        yaw = np.arctan2(
            rotations[:, second, self.tool_axis], rotations[:, first, self.tool_axis]
        )
        return np.column_stack([super().of_placements(positions, rotations), yaw])

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the displacement row by row; yaw in [-pi, pi)."""
        delta = super().difference(first, second).copy()
        delta[..., -1] = principal(delta[..., -1])
        return delta

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """Return the rows of the linear velocity, and the angular one about the world axis of yaw."""
        return np.concatenate(
            [super().rates(twists), self.sign * twists[3 + self.world_axis, None]]
        )
