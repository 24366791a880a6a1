"""Two rows of the tool's position and the angle at which the tool stands in their plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.robot.joint_space import principal
from brachis.robot.task_map.world_rows import WorldRows


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
        yaw = np.arctan2(rotations[:, second, self.tool_axis], rotations[:, first, self.tool_axis])
        return np.column_stack([super().of_placements(positions, rotations), yaw])

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """See `TaskMap.difference`; yaw is in [-pi, pi)."""
        delta = super().difference(first, second).copy()
        delta[..., -1] = principal(delta[..., -1])
        return delta

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """See `TaskMap.rates`."""
        return np.concatenate([super().rates(twists), self.sign * twists[3 + self.world_axis, None]])
