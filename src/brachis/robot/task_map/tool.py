"""Task maps of the tool: its pose; or rows of its position in the world, followed by an angle or the orientation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from brachis.kernel import Prescribed, rotation_vectors
from brachis.robot.joints import principal
from brachis.robot.task_map.protocol import ANGLES, POSE_ROWS, TaskMap


@dataclass(frozen=True, eq=False, repr=False)
class RowsAndOrientation(TaskMap):
    """Rows of the tool frame's position in the world frame, and its orientation.

    The rows are velocities along the world's axes and rotations about them. The task coordinates are the rows of the
    position, then the rotation matrix row by row (9). If a virtual joint rolls the tool, the rows prescribe only the
    direction of the tool's z axis.
    """

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Return the rows of the positions, then the rotation matrices row by row, (K, c)."""
        rows = super().of_placements(positions, rotations)
        return np.concatenate([rows, rotations.reshape(-1, 9)], axis=1)

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the displacement row by row, then the rotation vector, (..., m), in the world frame."""
        first, second = np.broadcast_arrays(first, second)
        count = len(self.axes)
        to = first[..., count:].reshape(-1, 3, 3)
        back = second[..., count:].reshape(-1, 3, 3).swapaxes(1, 2)
        turn = rotation_vectors(to @ back).reshape(*first.shape[:-1], 3)
        return np.concatenate([(first - second)[..., :count], turn], axis=-1)


@dataclass(frozen=True, eq=False, repr=False)
class Pose(RowsAndOrientation):
    """The tool frame's pose.

    Its 12 coordinates are the position (3) and the rotation matrix (9) in the world frame. Its rows are those of the
    body twist: displacements (m) along, and rotations (rad) about, the axes of the tool frame; see `twists`.
    """

    in_tool_axes: ClassVar[bool] = True

    rows: tuple[str, ...] = POSE_ROWS

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the translation and the rotation vector, (..., 6), in the frame of `second`."""
        moved = super().difference(first, second)
        rotation = second[..., 3:].reshape(*second.shape[:-1], 3, 3)
        vectors = moved.reshape(*moved.shape[:-1], 2, 3)
        return (vectors @ rotation).reshape(moved.shape)


@dataclass(frozen=True, eq=False, repr=False)
class RowsAndAngle(TaskMap):
    """Rows of the tool frame's position in the world frame and, as the last row, the angle about a world axis (rad).

    The tool turns about this axis alone. The angle is measured from the world's x axis, or from its y axis for roll, to
    the axis `tool_axis` of the tool frame, by the right-hand rule.

    Attributes
    ----------
    tool_axis : int
        Index of an axis of the tool frame (0, 1, 2).
    """

    tool_axis: int

    @cached_property
    def prescribed(self) -> Prescribed:
        """The rows of the position, and the angle."""
        first, second = self.plane
        heading = (self.tool_axis, first, second)
        return Prescribed(self.axes, 1, heading=heading, sign=self.sign)

    @property
    def world_axis(self) -> int:
        """Index of the world axis (0, 1, 2) about which the tool turns."""
        return ANGLES.index(self.rows[-1])

    @property
    def plane(self) -> tuple[int, int]:
        """Indices of the perpendicular world axes: first the axis from which the angle is measured."""
        first, second = (axis for axis in range(3) if axis != self.world_axis)
        return first, second

    @property
    def sign(self) -> float:
        """+1 if a positive angle turns the first axis of `plane` towards the second one, else -1."""
        return -1.0 if self.world_axis == 1 else 1.0

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Return the rows of the positions, then the angle in (-pi, pi]."""
        first, second = self.plane
        pointer = rotations[:, :, self.tool_axis]
        angle = np.arctan2(self.sign * pointer[:, second], pointer[:, first])
        return np.column_stack([super().of_placements(positions, rotations), angle])

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the displacement row by row, with the angle in [-pi, pi)."""
        delta = super().difference(first, second).copy()
        delta[..., -1] = principal(delta[..., -1])
        return delta
