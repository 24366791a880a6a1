"""The Pinocchio model of a chain, with the mounting, payload and tool offset of the task."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.errors import InputError, UrdfError
from brachis.robot.urdf import LINK, UrdfChain
from brachis.robot.urdf_bodies import check_inertia, symmetric_matrix
from brachis.task import Payload, RobotSettings


def build_model(chain: UrdfChain, settings: RobotSettings, where: str) -> pin.Model:
    """Build the model of a chain.

    Parameters
    ----------
    chain : UrdfChain
    settings : RobotSettings
        Settings of the robot; only gravity, mounting, payload and tool offset are used.
    where : str
        Name of the URDF, for messages.

    Returns
    -------
    pinocchio.Model
        ``model.armature`` is zero; see `Friction`.

    Raises
    ------
    UrdfError
        Pinocchio cannot build the model.
    InputError
        No rigid body can have the inertia of the payload, or the tool stands still.
    """
    try:
        full = pin.buildModelFromXML(chain.xml)
        reference = pin.neutral(full)
        locked = [
            full.getJointId(name) for name in chain.locked if full.existJointName(name)
        ]
        for joint in locked:
            reference[full.idx_qs[joint]] = chain.locked[full.names[joint]]
        model = pin.buildReducedModel(full, locked, reference)
    except (ValueError, RuntimeError) as error:
        raise UrdfError(
            "Pinocchio cannot build the model", where=where, found=str(error)
        ) from error
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name = frame.name.removeprefix(LINK)
    model.gravity.linear = np.array(settings.gravity)
    model.armature = np.zeros(model.nv)
    base = settings.base_placement.transform
    model.jointPlacements[1] = base * model.jointPlacements[1]
    for frame in list(model.frames)[1:]:  # the first one is the world itself
        if frame.parentJoint == 0:
            frame.placement = base * frame.placement
    tool = model.frames[model.getFrameId(chain.tool_frame, pin.FrameType.BODY)]
    if settings.payload is not None:
        if chain.dynamics.carriers == len(chain.joint_names):
            raise InputError(
                "the tool does not move, so that a payload has no effect",
                where="robot.payload",
                found=f"tool_frame {chain.tool_frame}",
                hint="State the mass of the workpiece in the URDF",
            )
        inertia = _inertia(settings.payload)
        model.appendBodyToJoint(tool.parentJoint, inertia, tool.placement)
    tool.placement = tool.placement * settings.tool_offset.transform
    return model


def _inertia(payload: Payload) -> pin.Inertia:
    """Return the inertia of a payload in the tool frame."""
    matrix = np.zeros((3, 3))
    if payload.inertia is not None:
        matrix = symmetric_matrix(payload.inertia.model_dump())
        problem = "the payload has a non-physical inertia"
        check_inertia(matrix, problem, "robot.payload.inertia", InputError)
    return pin.Inertia(payload.mass, np.array(payload.com), matrix)
