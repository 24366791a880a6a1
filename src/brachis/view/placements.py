"""Where links and tool are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.robot import Robot


@dataclass(frozen=True, eq=False)
class Placements:
    """Frames of a robot in the world frame at K postures.

    Attributes
    ----------
    positions : (K, n + 2, 3) ndarray
        Of the world, of what every joint moves, and of the tool, m.
    quaternions : (K, n + 2, 4) ndarray
        w, x, y, z.
    """

    positions: np.ndarray
    quaternions: np.ndarray

    @property
    def tool(self) -> np.ndarray:
        """Positions of the tool, (K, 3), m."""
        return np.asarray(self.positions[:, -1])


def placements(robot: Robot, q: np.ndarray) -> Placements:
    """Forward kinematics of postures `q`, (K, n)."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    found = Placements(np.empty((len(q), robot.n + 2, 3)), np.empty((len(q), robot.n + 2, 4)))
    for k, posture in enumerate(q):
        pin.forwardKinematics(model, data, posture)
        tool = pin.updateFramePlacement(model, data, frame)
        for row, placement in enumerate((*data.oMi, tool)):
            found.positions[k, row] = placement.translation
            found.quaternions[k, row] = np.roll(pin.Quaternion(placement.rotation).coeffs(), 1)
    return found
