"""The Pinocchio model of a chain, with what the task adds to it: mounting, payload, tool offset."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from brachis.errors import InputError, UrdfError
from brachis.robot.urdf import UrdfChain
from brachis.robot.urdf_bodies import check_bodies
from brachis.task import Payload, Placement, RobotSettings

_SLACK = 1e-3
"""Of moments of inertia: figures from CAD are rounded."""


def build_model(
    chain: UrdfChain, gravity: np.ndarray, settings: RobotSettings, where: str
) -> pin.Model:
    """Make the model of a chain.

    Parameters
    ----------
    chain : UrdfChain
    gravity : (3,) ndarray
        World frame, m/s^2.
    settings : RobotSettings
        Of these the mounting, the payload and the tool offset.
    where : str
        Name of the URDF, for messages.

    Returns
    -------
    pinocchio.Model
        ``model.armature`` is zero; see `Friction`.

    Raises
    ------
    UrdfError
        Pinocchio cannot build the model; the chain is not serial; the model does not weigh what the URDF says.
    InputError
        The payload's inertia is none of a body.
    """
    model = _of_urdf(chain.xml, chain.locked, where)
    names = tuple(str(name) for name in list(model.names)[1:])
    if names != chain.joint_names or model.nq != model.nv:
        raise UrdfError(
            "the chain is not serial",
            where=where,
            found=list(names),
            allowed=list(chain.joint_names),
        )
    check_bodies(model, chain.stated.bodies, where)
    model.gravity.linear = gravity
    model.armature = np.zeros(model.nv)
    _mount(model, _se3(settings.mounting))
    tool = model.frames[model.getFrameId(chain.tool_frame, pin.FrameType.BODY)]
    if settings.payload is not None:
        model.appendBodyToJoint(
            tool.parentJoint, _inertia(settings.payload), tool.placement
        )
    tool.placement = tool.placement * _se3(settings.tool_offset)
    return model


def _of_urdf(xml: str, locked: Mapping[str, float], where: str) -> pin.Model:
    """Let Pinocchio parse the plain URDF and lock the joints off the chain."""
    try:
        full = pin.buildModelFromXML(xml)
        return _locked(
            full,
            {
                name: value
                for name, value in locked.items()
                if full.existJointName(name)
            },
        )
    except (ValueError, RuntimeError) as error:
        raise UrdfError(
            "Pinocchio cannot build the model", where=where, found=str(error)
        ) from error


def _locked(full: pin.Model, locked: Mapping[str, float]) -> pin.Model:
    """Hold joints at positions, rad or m."""
    reference = pin.neutral(full)
    for name, value in locked.items():
        reference[full.idx_qs[full.getJointId(name)]] = value
    return pin.buildReducedModel(
        full, [full.getJointId(name) for name in locked], reference
    )


def _mount(model: pin.Model, placement: pin.SE3) -> None:
    """Place the URDF's root link in the world: the first joint, and the frames before it."""
    model.jointPlacements[1] = placement * model.jointPlacements[1]
    for frame in list(model.frames)[1:]:  # the first one is the world itself
        if frame.parentJoint == 0:
            frame.placement = placement * frame.placement


def _se3(placement: Placement) -> pin.SE3:
    return pin.SE3(
        pin.rpy.rpyToMatrix(*np.radians(placement.rpy_deg)), np.array(placement.xyz)
    )


def _inertia(payload: Payload) -> pin.Inertia:
    """Inertia of a payload in the tool frame."""
    matrix, given = np.zeros((3, 3)), payload.inertia
    if given is not None:
        matrix = np.array(
            [
                [given.ixx, given.ixy, given.ixz],
                [given.ixy, given.iyy, given.iyz],
                [given.ixz, given.iyz, given.izz],
            ]
        )
        moments = np.linalg.eigvalsh(matrix)
        if (
            moments[0] < -_SLACK * moments[-1]
            or moments[0] + moments[1] < (1.0 - _SLACK) * moments[-1]
        ):
            raise InputError(
                "is none of a rigid body",
                where="robot.payload.inertia",
                found="principal moments "
                + ", ".join(f"{moment:.4g}" for moment in moments)
                + " kg m^2",
                allowed="moments >= 0, none above the sum of the other two, about the centre of mass",
            )
    return pin.Inertia(payload.mass, np.array(payload.com), matrix)
