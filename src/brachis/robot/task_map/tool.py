"""The tool's pose.

Rows of the tool's position in the world frame.

Twists are in the world's axes: the tool frame turns with w_k for each joint k, and the classical acceleration of its
origin is a_v + w x v. The formulas of `twists` hold in any axes that stand still while the derivative is taken, so all
is computed in the world's directions at once.

Two rows of the tool's position and the angle at which the tool stands in their plane.

Velocity and acceleration of the tool frame and their derivatives, from the columns of its Jacobian.

The columns J_i are twists (v, w) at the tool frame's origin. Joints after joint i carry its axis relative to the tool,
so that in the tool frame's own axes

    dJ_i/dq_k = [J_i, J_k] for i < k, else 0,        [X, Y] = (w_X x v_Y + v_X x w_Y, w_X x w_Y).

With V = J qdot, S_k the part of it that comes from the joints before joint k, a = J qddot + Jdot qdot and s_k its part:

    Jdot qdot = sum_k [S_k, J_k] qdot_k,             s_k = sum_{i<k} (J_i qddot_i + [S_i, J_i] qdot_i)
    dV/dq_k    = [S_k, J_k]
    da/dqdot_k = 2 [S_k, J_k] + [J_k, V]
    da/dq_k    = [s_k, J_k] + [[S_k, J_k], V - S_k]

(R. M. Murray, Z. Li, S. S. Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 3). They hold in
any axes that stand still while the derivative is taken.
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


@dataclass(frozen=True)
class ToolMotion:
    """Motion of the tool frame in K states, and its derivatives.

    Attributes
    ----------
    velocity, acceleration : (6, K, 1) ndarray
        V and a.
    velocity_q, acceleration_q, acceleration_qdot : (6, K, n) ndarray
        dV/dq, da/dq and da/dqdot.
    """

    velocity: np.ndarray
    acceleration: np.ndarray
    velocity_q: np.ndarray
    acceleration_q: np.ndarray
    acceleration_qdot: np.ndarray


def tool_motion(twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> ToolMotion:
    """Derive the motion of K states (K, n) from the `twists` (6, K, n) at their postures; see the module's formulas."""
    before, velocity = _sums(twists * qdot)
    velocity_q = _bracket(before, twists)
    parts, acceleration = _sums(twists * qddot + velocity_q * qdot)
    acceleration_q = _bracket(parts, twists) + _bracket(velocity_q, velocity - before)
    acceleration_qdot = 2.0 * velocity_q + _bracket(twists, velocity)
    return ToolMotion(
        velocity, acceleration, velocity_q, acceleration_q, acceleration_qdot
    )


def velocity_slopes(
    twists: np.ndarray, qdot: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """V, (6, K, 1), and dV/dq, (6, K, n), from the `twists` (6, K, n) at K postures and speeds (K, n)."""
    before, velocity = _sums(twists * qdot)
    return velocity, _bracket(before, twists)


def tool_bias(twists: np.ndarray, qdot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """V and Jdot qdot, both (6, K), from the `twists` (6, K, n) at K postures."""
    before, velocity = _sums(twists * qdot)
    return velocity[:, :, 0], (_bracket(before, twists) * qdot).sum(axis=2)


def turned(turning: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rates (6, K, n) at which linear and angular parts (6, K, 1) change as their axes turn, at `turning` (3, K, n)."""
    return np.concatenate([cross(turning, vectors[:3]), cross(turning, vectors[3:])])


def _sums(parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add parts (6, K, n) over the joints before each one, (6, K, n), and over all, (6, K, 1)."""
    upto = np.cumsum(parts, axis=2)
    return upto - parts, upto[:, :, -1:]


def _bracket(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Lie bracket of twists (6, K, n or 1)."""
    v, w = first[:3], first[3:]
    return np.concatenate(
        [cross(w, second[:3]) + cross(v, second[3:]), cross(w, second[3:])]
    )


_POSITIONS = 3
_NEARLY_HALF_A_TURN = 3.0  # rad


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
        """See `TaskMap.read`."""
        if not isinstance(stated, ToolPose):
            allowed = "a position with an orientation (ToolPose)"
            raise InputError(
                "has no orientation", where=where, found=list(stated), allowed=allowed
            )
        convention, values = stated.convention_and_numbers
        rotation = rotation_by(convention, np.array(values))
        return np.concatenate([stated.position, rotation.as_matrix().ravel()])

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """See `TaskMap.of_placements`."""
        return np.concatenate([positions, rotations.reshape(-1, 9)], axis=1)

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """See `TaskMap.difference`: the translation and the rotation vector, in the frame of `second`."""
        first, second = np.broadcast_arrays(
            np.asarray(first, dtype=float), np.asarray(second, dtype=float)
        )
        shape = first.shape[:-1]
        to = first[..., _POSITIONS:].reshape(*shape, 3, 3)
        back = np.swapaxes(second[..., _POSITIONS:].reshape(*shape, 3, 3), -1, -2)
        shift = np.einsum(
            "...ij,...j->...i", back, first[..., :_POSITIONS] - second[..., :_POSITIONS]
        )
        turn = _rotation_vectors((back @ to).reshape(-1, 3, 3))
        return np.concatenate([shift, turn.reshape(*shape, 3)], axis=-1)

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """See `TaskMap.rates`."""
        return twists

    def bias(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """See `TaskMap.bias`."""
        return tool_bias(twists, qdot)[1].T

    def velocity_slopes(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """See `TaskMap.velocity_slopes`."""
        return self.jacobian(velocity_slopes(twists, qdot)[1])

    def derivatives(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TaskDerivatives:
        """See `TaskMap.derivatives`."""
        tool = tool_motion(twists, qdot, qddot)
        parts = (tool.velocity_q, tool.acceleration_q, tool.acceleration_qdot)
        return TaskDerivatives(*(self.jacobian(part) for part in parts))


def _rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors (K, 3) of rotation matrices (K, 3, 3); of one near half a turn by SciPy, through quaternions."""
    twice = rotations - np.swapaxes(rotations, 1, 2)
    axes = 0.5 * np.stack([twice[:, 2, 1], twice[:, 0, 2], twice[:, 1, 0]], axis=1)
    sine, cosine = (
        np.linalg.norm(axes, axis=1),
        0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0),
    )
    angles = np.arctan2(sine, cosine)
    vectors = (
        axes
        * np.divide(angles, sine, out=np.ones_like(sine), where=sine > 0.0)[:, None]
    )
    far = angles > _NEARLY_HALF_A_TURN
    if far.any():
        from scipy.spatial.transform import Rotation

        vectors[far] = Rotation.from_matrix(rotations[far]).as_rotvec()
    return np.asarray(vectors)


@dataclass(frozen=True, eq=False, repr=False)
class WorldRows(TaskMap):
    """Rows of the tool frame's position in the world frame; task coordinates are the rows themselves."""

    frame: ClassVar[pin.ReferenceFrame] = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """See `TaskMap.of_placements`."""
        return positions[:, list(self.axes)]

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """See `TaskMap.difference`."""
        return np.asarray(first - second, dtype=float)

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """See `TaskMap.rates`."""
        return twists[list(self.axes)]

    def bias(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """See `TaskMap.bias`."""
        velocity, acceleration = tool_bias(twists, qdot)
        acceleration[:3] += cross(velocity[3:], velocity[:3])
        return self.rates(acceleration).T

    def velocity_slopes(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """See `TaskMap.velocity_slopes`."""
        velocity, slopes = velocity_slopes(twists, qdot)
        return self.jacobian(slopes + turned(twists[3:], velocity))

    def derivatives(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TaskDerivatives:
        """See `TaskMap.derivatives`."""
        tool = tool_motion(twists, qdot, qddot)
        turning, v, w = twists[3:], tool.velocity[:3], tool.velocity[3:]
        acceleration_qdot, acceleration_q = tool.acceleration_qdot, tool.acceleration_q
        acceleration_qdot[:3] += cross(turning, v) + cross(w, twists[:3])
        acceleration_q[:3] += cross(tool.velocity_q[3:], v) + cross(
            w, tool.velocity_q[:3]
        )
        classical = np.concatenate(
            [tool.acceleration[:3] + cross(w, v), tool.acceleration[3:]]
        )
        acceleration_q += turned(turning, classical)
        velocity_q = tool.velocity_q + turned(turning, tool.velocity)
        return TaskDerivatives(
            *(
                self.jacobian(part)
                for part in (velocity_q, acceleration_q, acceleration_qdot)
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
        """See `TaskMap.of_placements`; yaw is in (-pi, pi]."""
        first, second = self.axes
        yaw = np.arctan2(
            rotations[:, second, self.tool_axis], rotations[:, first, self.tool_axis]
        )
        return np.column_stack([super().of_placements(positions, rotations), yaw])

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """See `TaskMap.difference`; yaw is in [-pi, pi)."""
        delta = super().difference(first, second).copy()
        delta[..., -1] = principal(delta[..., -1])
        return delta

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """See `TaskMap.rates`."""
        return np.concatenate(
            [super().rates(twists), self.sign * twists[3 + self.world_axis, None]]
        )
