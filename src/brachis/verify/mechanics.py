"""Kinematics and torques from the text of the URDF, by the Newton-Euler equations, joint by joint.

Each joint's frame is placed in the previous joint's frame; vectors are in the joint's own frame. Let p be the vector
from the origin of the previous frame, z the joint's axis, omega the angular velocity, alpha the angular acceleration
and a the acceleration. From the base outwards:

    a' = a + alpha x p + omega x (omega x p)
    revolute     alpha' = alpha + z qddot + omega x z qdot,  omega' = omega + z qdot
    prismatic    a' = a' + 2 omega x z qdot + z qddot

The recursion begins with a = -gravity. The recursion returns to the base with the forces F = m a_com and the moments I
alpha + omega x I omega of all bodies; the payload is a separate body in addition to those of the URDF. The torque is
the moment, or force, along z, and

    armature qddot + viscous qdot + coulomb tanh(qdot / v_eps).

A chain that begins at a workpiece has the world in its middle. The recursion begins there: outwards to the tool as
above, and by the inverse equations to the workpiece, whose carriers hold the bodies between them and the workpiece.

The rate of the torque is computed by finite differences along the motion, but for the last three terms by their
derivatives.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.common.arrays import cross, rates
from brachis.robot import Robot
from brachis.robot.urdf_bodies import (
    Body,
    placement_matrix,
    symmetric_matrix,
    turns_about,
)


def tool_placements(
    robot: Robot, q: np.ndarray, joints: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (K, 3), m, and rotations (K, 3, 3) of the tool frame, with its offset, in postures q (K, n).

    If there are virtual joints, their positions are the deviation of the tool from the path, and the corresponding
    point on the path is returned. `joints` is the result of `joint_placements`.
    """
    origin, rotation = real_tool_placements(robot, *joints)
    count = len(robot.urdf_joints)
    away = dict(zip(robot.joint_names[count:], q.T[count:], strict=True))
    if not away:
        return origin, rotation
    still = np.zeros(len(q))
    x, y, z, side, lead, roll = (
        away.get(f"tool_{direction}", still)
        for direction in ("x", "y", "z", "side", "lead", "roll")
    )
    # The axes of the path in the tool frame.
    about_x, about_y, about_z = map(turns_about, np.eye(3), (side, -lead, -roll))
    rotation = rotation @ (about_z @ about_y @ about_x)
    return origin - np.einsum("kij,jk->ki", rotation, np.array([x, y, z])), rotation


def real_tool_placements(
    robot: Robot, rotations: np.ndarray, origins: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (K, 3), m, and rotations (K, 3, 3) of the tool frame, without virtual joints."""
    tool = robot.urdf_dynamics.tool @ placement_matrix(robot.settings.tool_offset)
    last = rotations[:, -1]
    return origins[:, -1] + last @ tool[:3, 3], last @ tool[:3, :3]


def joint_placements(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotations, (K, n + 1, 3, 3), and origins, (K, n + 1, 3), m, of the frame of the paths and all joints.

    The postures q are (K, n). Virtual joints of the tool are ignored.
    """
    bodies = robot.urdf_dynamics.bodies
    base = placement_matrix(robot.settings.base_placement)
    rotation = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    origin = np.zeros((len(q), 3))
    rotations = [rotation]
    origins = [origin]
    for number, (body, position) in enumerate(zip(bodies, q.T, strict=False)):
        placed = body.placement if number else base @ body.placement
        origin = origin + rotation @ placed[:3, 3]
        rotation = rotation @ placed[:3, :3]
        if body.sliding:
            origin = origin + (rotation @ body.axis) * position[:, None]
        else:
            rotation = rotation @ turns_about(body.axis, position)
        rotations.append(rotation)
        origins.append(origin)
    return np.stack(rotations, axis=1), np.stack(origins, axis=1)


def torques(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> np.ndarray:
    """Return joint torques (K, n), Nm or N, zero for virtual joints; without masses, there are no columns."""
    if not robot.has_masses:
        return q[:, :0]
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
    """Return rates of the joint torques (K, n), Nm/s or N/s, by finite differences along the motion."""

    def rigid(*states: np.ndarray) -> tuple[np.ndarray]:
        """Return the torques without armature and friction at neighbouring instants, (2 K, n)."""
        return (_rigid(robot, *states[:3]),)

    (rate,) = rates(rigid, (q, qdot, qddot, qdddot))
    f = robot.friction
    widths = np.clip(qdot / f.v_eps, -300.0, 300.0)  # beyond this the slope is zero
    slope = f.viscous + f.coulomb / f.v_eps * np.cosh(widths) ** -2
    return rate + f.armature * qdddot + slope * qddot


def _rigid(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> np.ndarray:
    """Return torques (K, n) without armature and friction."""
    tau = np.zeros_like(q)
    bodies = robot.urdf_dynamics.bodies
    carriers = robot.urdf_dynamics.carriers
    base = placement_matrix(robot.settings.base_placement)[:3, :3]
    world = base.T @ robot.world[1][:3, :3]
    upwards = world @ -np.array(robot.model.gravity.linear)
    motions = _motions(robot, (q, qdot, qddot), upwards, carriers)
    force = moment = np.zeros((3, len(q)))
    for joint in reversed(range(carriers, len(bodies))):
        body = bodies[joint]
        for carried in _carried_bodies(robot, joint):
            body_force, body_moment = _accelerating_wrench(carried, motions[joint])
            force = force + body_force
            moment = moment + body_moment
        tau[:, joint] = body.axis @ (force if body.sliding else moment)
        position = q[:, joint]
        if body.sliding:
            moment = moment + cross(body.axis[:, None] * position, force)
        else:
            force = _rotate(body.axis, position, force)
            moment = _rotate(body.axis, position, moment)
        rotation = body.placement[:3, :3]
        force = rotation @ force
        moment = rotation @ moment + cross(body.placement[:3, 3, None], force)
    _add_carriers(robot, (q, qdot, qddot), upwards, tau)
    return tau


def _accelerating_wrench(
    body: Body, motion: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return force and moment about the frame's origin, (3, K) each, of a body whose frame has omega, alpha and a."""
    omega, alpha, acceleration = motion
    com = body.com[:, None]
    force = body.mass * _accelerate(com, omega, alpha, acceleration)
    momentum = body.inertia @ omega
    moment = body.inertia @ alpha + cross(omega, momentum)
    return force, moment + cross(com, force)


def _add_carriers(
    robot: Robot,
    states: tuple[np.ndarray, np.ndarray, np.ndarray],
    upwards: np.ndarray,
    tau: np.ndarray,
) -> None:
    """Write the torques of the joints that carry the workpiece into `tau`, (K, n)."""
    bodies = robot.urdf_dynamics.bodies[: robot.urdf_dynamics.carriers]
    q = states[0]
    motions = _carrier_motions(robot, states, upwards)
    force = moment = np.zeros((3, len(q)))
    for joint, body in enumerate(bodies):
        body_force, body_moment = _accelerating_wrench(body, motions[joint])
        rotation = body.placement[:3, :3].T
        moment = moment + body_moment
        force = force + body_force
        moment = rotation @ (moment - cross(body.placement[:3, 3, None], force))
        force = rotation @ force
        tau[:, joint] = -body.axis @ (force if body.sliding else moment)
        position = q[:, joint]
        if body.sliding:
            moment = moment - cross(body.axis[:, None] * position, force)
        else:
            force = _rotate(body.axis, -position, force)
            moment = _rotate(body.axis, -position, moment)


def _carrier_motions(
    robot: Robot,
    states: tuple[np.ndarray, np.ndarray, np.ndarray],
    upwards: np.ndarray,
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Compute omega, alpha and a, (3, K) each, of the bodies from the workpiece to the world.

    These are the equations of `_motions`, solved for the frame before each joint.
    """
    q, qdot, qddot = states
    omega = alpha = np.zeros((3, len(q)))
    acceleration = np.tile(upwards[:, None], len(q))
    motions = []
    for joint in reversed(range(robot.urdf_dynamics.carriers)):
        body = robot.urdf_dynamics.bodies[joint]
        axis = body.axis[:, None]
        velocity = axis * qdot[:, joint]
        joint_acceleration = axis * qddot[:, joint]
        if body.sliding:
            coriolis = 2.0 * cross(omega, velocity)
            acceleration = acceleration - coriolis - joint_acceleration
            back = -axis * q[:, joint]
            acceleration = _accelerate(back, omega, alpha, acceleration)
        else:
            omega = omega - velocity
            alpha = alpha - joint_acceleration - cross(omega, velocity)
            omega, alpha, acceleration = (
                _rotate(body.axis, q[:, joint], vectors)
                for vectors in (omega, alpha, acceleration)
            )
        back = -body.placement[:3, :3].T @ body.placement[:3, 3]
        acceleration = _accelerate(back[:, None], omega, alpha, acceleration)
        omega, alpha, acceleration = (
            body.placement[:3, :3] @ vectors for vectors in (omega, alpha, acceleration)
        )
        motions.append((omega, alpha, acceleration))
    return motions[::-1]


def tool_accelerations(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return acceleration, m/s^2, and angular acceleration, rad/s^2, of the tool frame in its own axes, (3, K) each.

    Virtual joints do not move the tool. If qdot is zero, accelerations depend on qddot as velocities depend on qdot. To
    get the velocities, pass zeros as qdot, and qdot as qddot.
    """
    motion = _motions(robot, (q, qdot, qddot), np.zeros(3))[-1]
    tool = robot.urdf_dynamics.tool @ placement_matrix(robot.settings.tool_offset)
    return _accelerate(tool[:3, 3, None], *motion), motion[1]


def _motions(
    robot: Robot,
    states: tuple[np.ndarray, np.ndarray, np.ndarray],
    base_acceleration: np.ndarray,
    first: int = 0,
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Compute omega, alpha and the acceleration of the joints' frames, (3, K) each, from the joint `first` on.

    The list has an entry for every joint. `base_acceleration`, (3,), is in the axes of the body before joint `first`.
    """
    q, qdot, qddot = states
    omega = alpha = np.zeros((3, len(q)))
    acceleration = np.tile(base_acceleration[:, None], len(q))
    motions = [(omega, alpha, acceleration)] * first
    for joint, body in enumerate(robot.urdf_dynamics.bodies[first:], first):
        axis = body.axis[:, None]
        offset = body.placement[:3, 3, None]
        rotation = body.placement[:3, :3].T
        acceleration = rotation @ _accelerate(offset, omega, alpha, acceleration)
        omega = rotation @ omega
        alpha = rotation @ alpha
        joint_velocity = axis * qdot[:, joint]
        joint_acceleration = axis * qddot[:, joint]
        if body.sliding:
            moved = _accelerate(axis * q[:, joint], omega, alpha, acceleration)
            acceleration = (
                moved + 2.0 * cross(omega, joint_velocity) + joint_acceleration
            )
        else:
            omega, alpha, acceleration = (
                _rotate(body.axis, -q[:, joint], vectors)
                for vectors in (omega, alpha, acceleration)
            )
            alpha = alpha + joint_acceleration + cross(omega, joint_velocity)
            omega = omega + joint_velocity
        motions.append((omega, alpha, acceleration))
    return motions


def _carried_bodies(robot: Robot, joint: int) -> list[Body]:
    """List the bodies that a joint carries: those of its link and, at the end of the chain, the payload."""
    bodies = robot.urdf_dynamics.bodies
    body = bodies[joint]
    payload = robot.settings.payload
    if payload is None or joint < len(bodies) - 1:
        return [body]
    tool = robot.urdf_dynamics.tool
    rotation = tool[:3, :3]
    inertia = np.zeros((3, 3))
    if payload.inertia is not None:
        inertia = symmetric_matrix(payload.inertia.model_dump())
    com = rotation @ payload.com + tool[:3, 3]
    turned = rotation @ inertia @ rotation.T
    return [body, replace(body, mass=payload.mass, com=com, inertia=turned)]


def _accelerate(
    point: np.ndarray, omega: np.ndarray, alpha: np.ndarray, acceleration: np.ndarray
) -> np.ndarray:
    """Compute the acceleration, (3, K), of a point fixed in a frame that moves with omega, alpha and a."""
    return acceleration + cross(alpha, point) + cross(omega, cross(omega, point))


def _rotate(axis: np.ndarray, angles: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rotate vectors (3, K) about a unit vector by angles (K,), rad (Rodrigues' formula)."""
    along = axis[:, None]
    cosine = np.cos(angles)
    parallel = along * (axis @ vectors) * (1.0 - cosine)
    return vectors * cosine + cross(along, vectors) * np.sin(angles) + parallel
