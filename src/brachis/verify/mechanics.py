"""Torques and tool placements from Pinocchio, with the friction formula written out again."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.robot import Robot


def torques(robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
    """Joint torques (K, n) from states (K, n): rnea, armature, viscous and Coulomb friction; Nm or N."""
    data = robot.model.createData()
    rigid = np.empty_like(q)
    for k in range(len(q)):
        rigid[k] = pin.rnea(robot.model, data, q[k], qdot[k], qddot[k])
    f = robot.friction
    return rigid + f.armature * qddot + f.viscous * qdot + f.coulomb * np.tanh(qdot / f.v_eps)


def tool_placements(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (K, 3) and rotations (K, 3, 3) of the tool frame in the world, from postures (K, n)."""
    data, frame = robot.model.createData(), robot.frame_id
    positions, rotations = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(robot.model, data, posture)
        placement = pin.updateFramePlacement(robot.model, data, frame)
        positions[k], rotations[k] = placement.translation, placement.rotation
    return positions, rotations
