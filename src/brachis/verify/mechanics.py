"""Kinematics and torques from what the URDF's text states, by Newton's and Euler's equations, joint by joint.

Each joint's frame is placed in the one before; vectors are in the joint's own frame. From the base outwards, with x the
way from the last origin, z the joint's axis, angular velocity w, angular acceleration e, acceleration a:

    a' = a + e x x + w x (w x x)
    revolute     e' = e + z qddot + w x z qdot,  w' = w + z qdot
    prismatic    a' = a' + 2 w x z qdot + z qddot

beginning with a = -gravity, and back again with the forces F = m a_com and the moments I e + w x I w of all bodies; the
payload is a body of its own beside those of the URDF. The torque is the moment, or force, along z, and

    armature qddot + viscous qdot + coulomb tanh(qdot / v_eps).

Its rate is taken by differences along the motion, that of the last three terms by their derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import cross
from brachis.robot import Robot
from brachis.task import Placement

_Z = np.array([0.0, 0.0, 1.0])
_STEP = 1e-3
"""Of the differences, in rad or m."""
_FAR = 300.0
"""Velocities, in widths of the Coulomb friction, beyond which its slope is zero."""


@dataclass(frozen=True, eq=False)
class _Weight:
    """A rigid body in the frame of the joint that carries it: mass (kg), centre (3, 1) m, inertia (3, 3) kg m^2."""

    mass: float
    com: np.ndarray
    inertia: np.ndarray

    def resistance(
        self, motion: tuple[np.ndarray, ...]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Force, and moment about the joint's origin, (3, K), that its motion takes: w, e and a of the frame."""
        spin, gain, acceleration = motion
        force = self.mass * (
            acceleration + cross(gain, self.com) + cross(spin, cross(spin, self.com))
        )
        return force, self.inertia @ gain + cross(spin, self.inertia @ spin) + cross(
            self.com, force
        )


def tool_placements(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (K, 3), m, and rotations (K, 3, 3) of the tool frame, with its offset, in postures q (K, n)."""
    offset, count = _matrix(robot.settings.tool_offset), len(q)
    tool = robot.urdf_dynamics.tool @ offset
    roll = (
        q[:, -1] if robot.rolls_freely else np.zeros(count)
    )  # about the tool frame's z axis
    x, y, z = (
        tool[:3, :3] @ _turned(_Z, roll, np.tile(axis[:, None], count))
        for axis in np.eye(3)
    )
    origin = np.tile(tool[:3, 3:], count)
    for joint, body in reversed(list(enumerate(robot.urdf_dynamics.bodies))):
        if body.sliding:
            origin = origin + body.axis[:, None] * q[:, joint]
        else:
            x, y, z, origin = (
                _turned(body.axis, q[:, joint], part) for part in (x, y, z, origin)
            )
        x, y, z, origin = (body.placement[:3, :3] @ part for part in (x, y, z, origin))
        origin = origin + body.placement[:3, 3, None]
    base = _matrix(robot.settings.mounting)
    rotations = np.stack([base[:3, :3] @ part for part in (x, y, z)], axis=1)
    return (base[:3, :3] @ origin + base[:3, 3, None]).T, np.moveaxis(rotations, 2, 0)


def torques(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> np.ndarray:
    """Joint torques (K, n) from states (K, n), Nm or N; that of a free roll of the tool is zero."""
    f = robot.friction
    return (
        _rigid(robot, q, qdot, qddot)
        + f.armature * qddot
        + f.viscous * qdot
        + f.coulomb * np.tanh(qdot / f.v_eps)
    )


def torque_rates(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, qdddot: np.ndarray
) -> np.ndarray:
    """Rates of the joint torques (K, n): differences along the motion, friction by its derivative; Nm/s or N/s.

    Differences of fourth order, over a step in which no joint goes far, nor changes its speed or acceleration much.
    """
    rates = [
        np.abs(part).max(axis=1) ** (1.0 / order)
        for order, part in enumerate((qdot, qddot, qdddot), 1)
    ]
    step = _STEP / np.maximum(np.max(rates, axis=0), 1.0)[:, None]

    def change(h: np.ndarray) -> np.ndarray:
        ahead, behind = (
            _rigid(
                robot,
                q + t * qdot + t**2 / 2.0 * qddot + t**3 / 6.0 * qdddot,
                *_on(t, qdot, qddot, qdddot),
            )
            for t in (h, -h)
        )
        return (ahead - behind) / (2.0 * h)

    f = robot.friction
    sliding = np.cosh(np.clip(qdot / f.v_eps, -_FAR, _FAR)) ** -2
    friction = f.armature * qdddot + (f.viscous + f.coulomb / f.v_eps * sliding) * qddot
    return (4.0 * change(step) - change(2.0 * step)) / 3.0 + friction


def _on(
    t: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, qdddot: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration after times t, (K, 1), s, under a jerk that stays."""
    return qdot + t * qddot + t**2 / 2.0 * qdddot, qddot + t * qdddot


def _rigid(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> np.ndarray:
    """Torques (K, n) without armature and friction."""
    tau, bodies = np.zeros_like(q), robot.urdf_dynamics.bodies
    motions = _motions(robot, q, qdot, qddot)
    force, moment = np.zeros((3, len(q))), np.zeros((3, len(q)))
    for joint in reversed(range(len(bodies))):
        body = bodies[joint]
        for weight in _weights(robot, joint):
            push, turn = weight.resistance(motions[joint])
            force, moment = force + push, moment + turn
        tau[:, joint] = body.axis @ (force if body.sliding else moment)
        if body.sliding:
            moment = moment + cross(body.axis[:, None] * q[:, joint], force)
        else:
            force, moment = (
                _turned(body.axis, q[:, joint], part) for part in (force, moment)
            )
        force, moment = (body.placement[:3, :3] @ part for part in (force, moment))
        moment = moment + cross(body.placement[:3, 3, None], force)
    return tau


def _motions(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> list[tuple[np.ndarray, ...]]:
    """Angular velocity, angular acceleration, and acceleration less gravity of every joint's frame, (3, K) each."""
    still = np.zeros((3, len(q)))
    upwards = _matrix(robot.settings.mounting)[:3, :3].T @ -np.array(
        robot.model.gravity.linear
    )
    spin, gain, acceleration = still, still, np.tile(upwards[:, None], len(q))
    motions: list[tuple[np.ndarray, ...]] = []
    for joint, body in enumerate(robot.urdf_dynamics.bodies):
        way, axis = body.placement[:3, 3, None], body.axis[:, None]
        acceleration = acceleration + cross(gain, way) + cross(spin, cross(spin, way))
        spin, gain, acceleration = (
            body.placement[:3, :3].T @ part for part in (spin, gain, acceleration)
        )
        rate, push = axis * qdot[:, joint], axis * qddot[:, joint]
        if body.sliding:
            way = axis * q[:, joint]
            acceleration = (
                acceleration
                + cross(gain, way)
                + cross(spin, cross(spin, way) + 2.0 * rate)
                + push
            )
        else:
            spin, gain, acceleration = (
                _turned(body.axis, -q[:, joint], part)
                for part in (spin, gain, acceleration)
            )
            gain, spin = gain + push + cross(spin, rate), spin + rate
        motions.append((spin, gain, acceleration))
    return motions


def _weights(robot: Robot, joint: int) -> list[_Weight]:
    """List what a joint carries: its own body and, at the end of the chain, the payload."""
    body, payload = robot.urdf_dynamics.bodies[joint], robot.settings.payload
    weights = [_Weight(body.mass, body.com[:, None], body.inertia)]
    if payload is not None and joint == len(robot.urdf_dynamics.bodies) - 1:
        tool, given = robot.urdf_dynamics.tool, payload.inertia
        inertia = np.zeros((3, 3))
        if given is not None:
            inertia = np.diag([given.ixx, given.iyy, given.izz])
            for (row, column), product in {
                (0, 1): given.ixy,
                (0, 2): given.ixz,
                (1, 2): given.iyz,
            }.items():
                inertia[row, column] = inertia[column, row] = product
        com = tool[:3, :3] @ payload.com + tool[:3, 3]
        weights.append(
            _Weight(payload.mass, com[:, None], tool[:3, :3] @ inertia @ tool[:3, :3].T)
        )
    return weights


def _matrix(placement: Placement) -> np.ndarray:
    """Placement as a (4, 4) matrix."""
    matrix = np.eye(4)
    for axis, angle in zip(
        np.eye(3), np.radians(placement.rpy_deg), strict=True
    ):  # about fixed axes: x, y, z
        matrix[:3, :3] = _turned(axis, np.full(3, angle), matrix[:3, :3])
    matrix[:3, 3] = placement.xyz
    return matrix


def _turned(axis: np.ndarray, angles: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Turn vectors (3, K) about a unit vector by angles (K,), rad (Rodrigues)."""
    along, sine, cosine = axis[:, None], np.sin(angles), np.cos(angles)
    return np.asarray(
        vectors * cosine
        + cross(along, vectors) * sine
        + along * (axis @ vectors) * (1.0 - cosine)
    )
