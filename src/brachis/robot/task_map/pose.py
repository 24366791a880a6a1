"""The tool's pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pinocchio as pin

from brachis.cam.conventions import rotation_by
from brachis.errors import InputError
from brachis.robot.task_map.protocol import TaskDerivatives, TaskMap
from brachis.robot.task_map.rows import POSE_ROWS
from brachis.robot.task_map.twists import tool_bias, tool_motion, velocity_slopes
from brachis.task import ToolPose

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
            raise InputError("has no orientation", where=where, found=list(stated), allowed=allowed)
        convention, values = stated.convention_and_numbers
        rotation = rotation_by(convention, np.array(values))
        return np.concatenate([stated.position, rotation.as_matrix().ravel()])

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """See `TaskMap.of_placements`."""
        return np.concatenate([positions, rotations.reshape(-1, 9)], axis=1)

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """See `TaskMap.difference`: the translation and the rotation vector, in the frame of `second`."""
        first, second = np.broadcast_arrays(np.asarray(first, dtype=float), np.asarray(second, dtype=float))
        shape = first.shape[:-1]
        to = first[..., _POSITIONS:].reshape(*shape, 3, 3)
        back = np.swapaxes(second[..., _POSITIONS:].reshape(*shape, 3, 3), -1, -2)
        shift = np.einsum("...ij,...j->...i", back, first[..., :_POSITIONS] - second[..., :_POSITIONS])
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

    def derivatives(self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> TaskDerivatives:
        """See `TaskMap.derivatives`."""
        tool = tool_motion(twists, qdot, qddot)
        parts = (tool.velocity_q, tool.acceleration_q, tool.acceleration_qdot)
        return TaskDerivatives(*(self.jacobian(part) for part in parts))


def _rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors (K, 3) of rotation matrices (K, 3, 3); of one near half a turn by SciPy, through quaternions."""
    twice = rotations - np.swapaxes(rotations, 1, 2)
    axes = 0.5 * np.stack([twice[:, 2, 1], twice[:, 0, 2], twice[:, 1, 0]], axis=1)
    sine, cosine = np.linalg.norm(axes, axis=1), 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0)
    angles = np.arctan2(sine, cosine)
    vectors = axes * np.divide(angles, sine, out=np.ones_like(sine), where=sine > 0.0)[:, None]
    far = angles > _NEARLY_HALF_A_TURN
    if far.any():
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  (a fifth of a second that most need not wait)

        vectors[far] = Rotation.from_matrix(rotations[far]).as_rotvec()
    return np.asarray(vectors)
