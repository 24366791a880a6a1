"""Conversion of MJCF files, the format of MuJoCo, to the text of a URDF.

MuJoCo compiles the files, because Pinocchio 4.1 misreads some of them. Pinocchio reads the ranges of slides as degrees.
It ignores the placement of the first body, all other bodies of the world, sites of fixed bodies and the forces of
actuators. It supports neither ``limited`` nor ``include``.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from brachis.errors import BrachisWarning, NotInstalledError, UrdfError
from brachis.robot.urdf_writer import write_urdf

_REMARK = re.compile(r"<\?.*?\?>|<!--.*?-->", re.DOTALL)
_ROOT = re.compile(r"[\ufeff\s]*<mujoco\b")


def is_mjcf(text: str) -> bool:
    """Return whether a text is XML whose root is ``<mujoco>``."""
    return _ROOT.match(_REMARK.sub("", text)) is not None


def urdf_of_mjcf(path: Path) -> str:
    """Read an MJCF file and the files that it includes, and write it as a URDF.

    Joint positions are those of the file, including ``ref``. The torque limit of a joint is the smaller side of
    ``actuatorfrcrange``, or the sum of the forces of its actuators if this sum is less.

    Raises
    ------
    UrdfError
        MuJoCo refuses the file.
    NotInstalledError
        MuJoCo is not installed.

    Warns
    -----
    BrachisWarning
        The file contains elements that a URDF cannot express, such as tendons or equality constraints.
    """
    try:
        import mujoco
    except ImportError as error:
        raise NotInstalledError("an MJCF file", "mujoco", "mjcf") from error
    try:
        compiled = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise UrdfError(
            "MuJoCo cannot read the MJCF file", where=str(path), found=str(error)
        ) from error
    text = ", ".join(_list_omitted(compiled))
    if text:
        text = f"{path}: left out, because a URDF has no counterpart: {text}"
        warnings.warn(text, BrachisWarning, stacklevel=2)
    return write_urdf(_model_of(compiled))


def _list_omitted(compiled: Any) -> list[str]:
    """List the elements of the file that a URDF cannot express, with their numbers."""
    is_on_joint = compiled.actuator_trntype <= _ON_JOINT
    counts = {
        "collision shapes": np.count_nonzero(
            compiled.geom_contype | compiled.geom_conaffinity
        ),
        "equality constraints": compiled.neq,
        "tendons": compiled.ntendon,
        "flexible bodies": compiled.nflex,
        "joint springs": np.count_nonzero(compiled.jnt_stiffness),
        "gravity compensation of bodies": np.count_nonzero(compiled.body_gravcomp),
        "actuators that act on no joint": np.count_nonzero(~is_on_joint),
        "control laws of actuators": np.count_nonzero(compiled.actuator_biastype),
        "torque limits of 0": np.count_nonzero(_effort_limits(compiled) == 0.0),
    }
    gravity = compiled.opt.gravity.tolist()
    if gravity != [0.0, 0.0, -9.81]:
        counts[f"gravity {gravity} m/s^2, which robot.gravity can set"] = 1
    return [f"{kind} ({count})" for kind, count in counts.items() if count]


def _model_of(compiled: Any) -> pin.Model:
    """Return the tree of bodies, joints and sites, without shapes."""
    model = pin.Model()
    model.name = compiled.names.partition(b"\0")[0].decode()
    efforts = _effort_limits(compiled)
    # For every body: the joint that moves it, its frame, and its placement in the joint's frame.
    bodies: list[tuple[int, int, pin.SE3]] = []
    for i in range(compiled.nbody):
        body = compiled.body(i)
        joint, frame, placement = (
            bodies[body.parentid[0]] if i else (0, 0, pin.SE3.Identity())
        )
        placement *= _pose(body.pos, body.quat)
        first = body.jntadr[0]
        for number in range(first, first + body.jntnum[0]):
            if number > first:
                model.appendBodyToJoint(joint, _NEGLIGIBLE, pin.SE3.Identity())
            anchor = pin.SE3(np.eye(3), compiled.jnt_pos[number])
            shifted = placement * anchor
            joint = _add_joint(
                model, compiled.joint(number), joint, shifted, efforts[number]
            )
            frame = model.addJointFrame(joint, frame)
            placement = anchor.inverse()
        spread = _pose(body.ipos, body.iquat)
        inertia = pin.Inertia(body.mass[0], np.zeros(3), np.diag(body.inertia))
        model.appendBodyToJoint(joint, inertia, placement * spread)
        name = body.name or f"body_{i}"
        frame = model.addBodyFrame(name, joint, placement, frame)
        bodies.append((joint, frame, placement))
    for i in range(compiled.nsite):
        site = compiled.site(i)
        joint, frame, placement = bodies[site.bodyid[0]]
        placed = placement * _pose(site.pos, site.quat)
        name = site.name or f"site_{i}"
        model.addFrame(pin.Frame(name, joint, frame, placed, pin.FrameType.OP_FRAME))
    return model


def _pose(position: np.ndarray, quaternion: np.ndarray) -> pin.SE3:
    """Return a placement. In MuJoCo, quaternions begin with the real part."""
    return pin.XYZQUATToSE3(np.append(position, np.roll(quaternion, -1)))


def _add_joint(
    model: pin.Model, joint: Any, parent: int, placement: pin.SE3, effort: float
) -> int:
    """Add a joint and return its number. At the joint position ``ref``, bodies are where the file places them."""
    name = joint.name or f"joint_{joint.id}"
    if joint.type[0] < _SLIDE:  # free and ball joints
        return int(model.addJoint(parent, pin.JointModelFreeFlyer(), placement, name))
    back = -joint.qpos0[0] * joint.axis
    kind = pin.JointModelRevoluteUnaligned(joint.axis)
    shift = pin.SE3(pin.exp3(back), np.zeros(3))
    if joint.type[0] == _SLIDE:
        kind = pin.JointModelPrismaticUnaligned(joint.axis)
        shift = pin.SE3(np.eye(3), back)
    ends = joint.range if joint.limited[0] else np.array([-np.inf, np.inf])
    largest = (np.array([effort]), np.array([np.inf]))
    placed = placement * shift
    number = model.addJoint(parent, kind, placed, name, *largest, ends[:1], ends[1:])
    model.damping[-1] = joint.damping[0]
    model.friction[-1] = joint.frictionloss[0]
    model.armature[-1] = joint.armature[0]
    return int(number)


_NEGLIGIBLE = pin.Inertia.FromSphere(1e-9, 1e-3)
"""Negligible inertia of the link between two joints of one body. A mass of 0 would look like a missing mass."""
_ON_JOINT = 1
"""Largest code that MuJoCo uses for a transmission to a joint."""
_SLIDE = 2
"""MuJoCo's code for a prismatic joint; free and ball joints have smaller codes."""


def _effort_limits(compiled: Any) -> np.ndarray:
    """Return the largest force or torque of every joint, (njnt,), N or Nm; infinite if it is not limited."""
    forces = _smaller_side(compiled.actuator_forcerange, compiled.actuator_forcelimited)
    controls = _smaller_side(compiled.actuator_ctrlrange, compiled.actuator_ctrllimited)
    gains = np.abs(compiled.actuator_gainprm[:, 0])
    is_motor = (compiled.actuator_gaintype == 0) & (compiled.actuator_biastype == 0)
    is_motor &= gains > 0.0
    forces[is_motor] = np.minimum(forces, controls * gains)[is_motor]
    efforts = forces * np.abs(compiled.actuator_gear[:, 0])
    is_on_joint = compiled.actuator_trntype <= _ON_JOINT
    joints = compiled.actuator_trnid[is_on_joint, 0]
    summed = np.zeros(compiled.njnt)
    np.add.at(summed, joints, efforts[is_on_joint])
    summed[~np.isin(np.arange(compiled.njnt), joints)] = np.inf
    ranges = _smaller_side(compiled.jnt_actfrcrange, compiled.jnt_actfrclimited)
    return np.minimum(summed, ranges)


def _smaller_side(ranges: np.ndarray, limited: np.ndarray) -> np.ndarray:
    """Return the smaller magnitude of the ends of ranges, (N, 2); infinite for a range that is not a limit."""
    return np.where(limited, np.abs(ranges).min(axis=1), np.inf)
