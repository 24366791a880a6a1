"""The chain of a model in the form that the kernel needs, at the zero posture: for kinematics and for torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from brachis.kernel import Chain


def chain_of(
    model: pin.Model, tool_frame: int, friction: np.ndarray | None = None
) -> Chain:
    """Describe the joints, the bodies and a frame of a serial model at its zero posture.

    The columns (v, w) of the world Jacobian are the joints' screws: w is an axis, and w x v a point on it.

    Parameters
    ----------
    model : pinocchio.Model
    tool_frame : int
        Index of the tool frame.
    friction : (n, 4) ndarray, optional
        Friction terms (see `Chain`); zeros if left out.
    """
    data = model.createData()
    zero = np.zeros(model.nq)
    columns = pin.computeJointJacobians(model, data, zero).reshape(6, model.nq)
    linear = columns[:3].T
    angular = columns[3:].T
    revolute = np.linalg.norm(angular, axis=1) > 0.5
    bodies = _bodies(model, data)[1:]
    tool = pin.updateFramePlacement(model, data, tool_frame)
    return Chain(
        revolute=revolute,
        axes=np.where(revolute[:, None], angular, linear),
        points=np.where(revolute[:, None], np.cross(angular, linear), 0.0),
        tool_position=np.array(tool.translation),
        tool_rotation=np.array(tool.rotation),
        masses=np.array([body.mass for body in bodies]),
        centers=np.array([body.lever for body in bodies]),
        inertias=_inertias(bodies),
        gravity=np.array(model.gravity.linear),
        friction=np.zeros((model.nq, 4)) if friction is None else friction,
    )


def chain_in_world(
    model: pin.Model, chain: Chain, carriers: int, world: tuple[int, np.ndarray]
) -> Chain:
    """Describe a chain that begins at a workpiece in the world frame, for torques.

    Seen from the workpiece, a carrier moves the world; in the world, it moves the bodies on the other side.

    Parameters
    ----------
    model : pinocchio.Model
    chain : Chain
        Result of `chain_of`.
    carriers : int
        Number of joints that carry the workpiece.
    world : tuple of int and (4, 4) ndarray
        Number of the joint before the world, and the world's placement in the joint's frame.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    seen = path_frame_in_world(data, world)
    bodies = _bodies(model, data)
    del bodies[carriers]  # the world
    bodies = [seen.act(body) for body in bodies]
    senses = np.where(np.arange(chain.n) < carriers, -1.0, 1.0)
    return replace(
        chain,
        axes=senses[:, None] * chain.axes @ seen.rotation.T,
        points=chain.points @ seen.rotation.T + seen.translation,
        carriers=carriers,
        masses=np.array([body.mass for body in bodies]),
        centers=np.array([body.lever for body in bodies]),
        inertias=_inertias(bodies),
    )


def path_frame_in_world(data: pin.Data, world: tuple[int, np.ndarray]) -> pin.SE3:
    """Return the placement in the world of the frame of the paths, for placed joints and `Robot.world`."""
    joint, placement = world
    return (data.oMi[joint] * pin.SE3(placement)).inverse()


def _bodies(model: pin.Model, data: pin.Data) -> list[pin.Inertia]:
    """Place the inertias of the bodies before, between and after the joints."""
    pairs = zip(data.oMi, model.inertias, strict=True)
    return [placement.act(inertia) for placement, inertia in pairs]


def _inertias(bodies: list[pin.Inertia]) -> np.ndarray:
    """Return moments of inertia as in `Chain`, (n, 6)."""
    return np.array([body.inertia[np.triu_indices(3)] for body in bodies])
