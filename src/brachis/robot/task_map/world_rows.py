"""Rows of the tool's position in the world frame.

Twists are in the world's axes: the tool frame turns with w_k for each joint k, and the classical acceleration of its
origin is a_v + w x v. The formulas of `twists` hold in any axes that stand still while the derivative is taken, so all
is computed in the world's directions at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pinocchio as pin

from brachis.arrays import cross
from brachis.robot.task_map.protocol import TaskDerivatives, TaskMap
from brachis.robot.task_map.twists import tool_bias, tool_motion, turned, velocity_slopes


@dataclass(frozen=True, eq=False, repr=False)
class WorldRows(TaskMap):
    """Rows of the tool frame's position in the world frame; task coordinates are the rows themselves."""

    frame: ClassVar[pin.ReferenceFrame] = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:  # noqa: ARG002
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

    def derivatives(self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> TaskDerivatives:
        """See `TaskMap.derivatives`."""
        tool = tool_motion(twists, qdot, qddot)
        turning, v, w = twists[3:], tool.velocity[:3], tool.velocity[3:]
        acceleration_qdot, acceleration_q = tool.acceleration_qdot, tool.acceleration_q
        acceleration_qdot[:3] += cross(turning, v) + cross(w, twists[:3])
        acceleration_q[:3] += cross(tool.velocity_q[3:], v) + cross(w, tool.velocity_q[:3])
        classical = np.concatenate([tool.acceleration[:3] + cross(w, v), tool.acceleration[3:]])
        acceleration_q += turned(turning, classical)
        velocity_q = tool.velocity_q + turned(turning, tool.velocity)
        return TaskDerivatives(*(self.jacobian(part) for part in (velocity_q, acceleration_q, acceleration_qdot)))
