"""Torques from Pinocchio and their rates, with the friction formula written out again."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.robot import Robot

_STEP = 1e-3
"""Of the differences, in rad or m."""
_FAR = 300.0
"""Velocities, in widths of the Coulomb friction, beyond which its slope is zero."""


def torques(robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
    """Joint torques (K, n) from states (K, n): rnea, armature, viscous and Coulomb friction; Nm or N."""
    f = robot.friction
    return _rigid(robot, q, qdot, qddot) + f.armature * qddot + f.viscous * qdot + f.coulomb * np.tanh(qdot / f.v_eps)


def torque_rates(robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, qdddot: np.ndarray) -> np.ndarray:
    """Rates of the joint torques (K, n): differences of rnea along the motion, friction by its derivative; Nm/s or N/s.

    Differences of fourth order, over a step in which no joint goes far, nor changes its speed or acceleration much.
    """
    rates = [np.abs(part).max(axis=1) ** (1.0 / order) for order, part in enumerate((qdot, qddot, qdddot), 1)]
    step = _STEP / np.maximum(np.max(rates, axis=0), 1.0)[:, None]

    def change(h: np.ndarray) -> np.ndarray:
        ahead, behind = (
            _rigid(robot, q + t * qdot + t**2 / 2.0 * qddot + t**3 / 6.0 * qdddot, *_on(t, qdot, qddot, qdddot))
            for t in (h, -h)
        )
        return (ahead - behind) / (2.0 * h)

    f = robot.friction
    sliding = np.cosh(np.clip(qdot / f.v_eps, -_FAR, _FAR)) ** -2
    friction = f.armature * qdddot + (f.viscous + f.coulomb / f.v_eps * sliding) * qddot
    return (4.0 * change(step) - change(2.0 * step)) / 3.0 + friction


def _on(t: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, qdddot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration after times t, (K, 1), s, under a jerk that stays."""
    return qdot + t * qddot + t**2 / 2.0 * qdddot, qddot + t * qdddot


def _rigid(robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
    """Torques (K, n) without armature and friction."""
    data = robot.model.createData()
    rigid = np.empty_like(q)
    for k in range(len(q)):
        rigid[k] = pin.rnea(robot.model, data, q[k], qdot[k], qddot[k])
    return rigid
