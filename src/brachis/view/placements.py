"""Where links and tool are, and how fast the tool is."""

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
    tool_speed : (K,) ndarray
        m/s; zero where no velocities were given.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    tool_speed: np.ndarray

    @property
    def tool(self) -> np.ndarray:
        """Positions of the tool, (K, 3), m."""
        return np.asarray(self.positions[:, -1])


def placements(robot: Robot, q: np.ndarray, qdot: np.ndarray | None = None) -> Placements:
    """Forward kinematics of postures `q` and velocities `qdot`, (K, n)."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    found = Placements(np.empty((len(q), robot.n + 2, 3)), np.empty((len(q), robot.n + 2, 4)), np.zeros(len(q)))
    velocities = np.zeros_like(q) if qdot is None else qdot
    for k, (posture, velocity) in enumerate(zip(q, velocities, strict=True)):
        pin.forwardKinematics(model, data, posture, velocity)
        tool = pin.updateFramePlacement(model, data, frame)
        for row, frame_placement in enumerate((*data.oMi, tool)):
            found.positions[k, row] = frame_placement.translation
            x, y, z, w = pin.Quaternion(frame_placement.rotation).coeffs()
            found.quaternions[k, row] = w, x, y, z
        twist = pin.getFrameVelocity(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        found.tool_speed[k] = np.linalg.norm(twist.linear)
    return found
