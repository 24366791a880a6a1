"""Where the tool is, and how fast, in a batch of states."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.robot import Robot


def tool_motion(robot: Robot, q: np.ndarray, qdot: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose and speed of the tool frame in the world.

    Parameters
    ----------
    robot : Robot
    q, qdot : (K, n) ndarray

    Returns
    -------
    position : (K, 3) ndarray
        m.
    quaternion : (K, 4) ndarray
        w, x, y, z, of length 1, with signs such that neighbours are close.
    speed : (K,) ndarray
        m/s.
    """
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    position, quaternion, speed = np.empty((len(q), 3)), np.empty((len(q), 4)), np.empty(len(q))
    for k in range(len(q)):
        pin.forwardKinematics(model, data, q[k], qdot[k])
        placement = pin.updateFramePlacement(model, data, frame)
        position[k] = placement.translation
        quaternion[k] = np.roll(pin.Quaternion(placement.rotation).coeffs(), 1)
        speed[k] = np.linalg.norm(pin.getFrameVelocity(model, data, frame).linear)
    turned = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0
    quaternion[1:] *= np.cumprod(np.where(turned, -1.0, 1.0))[:, None]
    return position, quaternion, speed
