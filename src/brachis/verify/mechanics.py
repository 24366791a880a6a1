"""Torques from Pinocchio, with the friction formula written out again."""

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
