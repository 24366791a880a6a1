"""The tool as task space: its pose, rows of its position in the world frame, or two such rows and yaw there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from brachis.errors import InputError
from brachis.kernel import Prescribed, rotation_vectors
from brachis.robot.joints import principal
from brachis.robot.task_map.protocol import POSE_ROWS, TaskMap
from brachis.task import ToolPose


@dataclass(frozen=True, eq=False, repr=False)
class Pose(TaskMap):
    """The tool frame's pose.

    It has 12 coordinates for its 6 rows: the position (3), then the rotation matrix row by row (9), both in the world
    frame. Its rows are those of the body twist: displacement (m) and rotation (rad) along and about the tool frame's
    own axes, as the formulas of `twists` give them.
    """

    rows: tuple[str, ...] = POSE_ROWS

    @cached_property
    def prescribed(self) -> Prescribed:
        """The pose."""
        return Prescribed()

    def read(self, stated: Sequence[float] | ToolPose, where: str) -> np.ndarray:
        """Return the coordinates, (12,), of a pose that a task states."""
        if not isinstance(stated, ToolPose):
            raise InputError(
                "the orientation is missing",
                where=where,
                found=list(stated),
                allowed="a position with an orientation (ToolPose)",
            )
        rotation = stated.rotation.as_matrix()
        return np.concatenate([stated.position, rotation.ravel()])

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
        turn = rotation_vectors((back @ to).reshape(-1, 3, 3))
        return np.concatenate([shift, turn.reshape(*shape, 3)], axis=-1)

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """Return the twists themselves."""
        return twists


@dataclass(frozen=True, eq=False, repr=False)
class WorldRows(TaskMap):
    """Rows of the tool frame's position in the world frame; task coordinates are the rows themselves."""

    in_tool_axes: ClassVar[bool] = False

    @cached_property
    def prescribed(self) -> Prescribed:
        """The rows of the position."""
        return Prescribed(self.axes)

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Return the rows of the positions, (K, m)."""
        return positions[:, list(self.axes)]

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """Return the rows of the linear velocity."""
        return twists[list(self.axes)]


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

    @cached_property
    def prescribed(self) -> Prescribed:
        """The rows of the position, and yaw."""
        return Prescribed(self.axes, self.tool_axis, self.sign)

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
