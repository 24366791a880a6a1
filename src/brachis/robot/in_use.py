"""What acts on a robot beside its URDF's links: payload, offset, mounting, friction, armature, slower limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.robot.robot import Robot
from brachis.robot.units import UNITS
from brachis.task import Placement

_NAMES = {"armature": "armature", "viscous": "viscous friction", "coulomb": "Coulomb friction"}


def in_use(robot: Robot) -> dict[str, str]:
    """Say in words, with units, what is in use; what is not, is left out.

    Friction is always said, with where it comes from: the URDF, unless the task says otherwise.
    """
    settings, said = robot.settings, {}
    if settings.payload is not None:
        moments = "a point mass" if settings.payload.inertia is None else "with moments of inertia"
        said["payload"] = (
            f"{settings.payload.mass:g} kg at {_vector(settings.payload.com)} m in the tool frame, {moments}"
        )
    for name, placement in (("tool offset", settings.tool_offset), ("mounting", settings.mounting)):
        if placement.model_dump() != Placement().model_dump():
            said[name] = f"at {_vector(placement.xyz)} m, roll, pitch, yaw {_vector(placement.rpy_deg)} deg"
    if settings.speed_override != 1.0:
        said["speed override"] = f"{100.0 * settings.speed_override:g} % of the joint velocity limits"
    factors = {kind: factor for kind, factor in settings.limits.scale if factor != 1.0}
    if factors:
        parts = ", ".join(f"{kind.replace('_', ' ')} {100.0 * factor:g} %" for kind, factor in factors.items())
        said["limits"] = f"{parts} of what is stated (limits.scale)"
    if robot.friction.armature.any():
        said["armature"] = _by_joint(robot, "armature")
    for kind, stated in robot.stated.friction.items():
        figures = getattr(robot.friction, kind)[: len(stated)]
        origin = "as the URDF states it" if np.array_equal(figures, stated) else "other than the URDF's"
        if figures.any():
            said[_NAMES[kind]] = f"{_by_joint(robot, kind)} ({origin})"
        else:
            said[_NAMES[kind]] = f"none ({origin})"
    return said


def _by_joint(robot: Robot, kind: str) -> str:
    """Write one term of the friction with its units, joint by joint unless it is the same at all."""
    figures, n = getattr(robot.friction, kind), len(robot.stated.bodies)
    rows = [f"{value:g} {UNITS[kind][unit]}" for value, unit in zip(figures[:n], robot.position_units[:n], strict=True)]
    if len(set(rows)) == 1 and n > 1:
        return f"{rows[0]} at every joint"
    return ", ".join(f"{name} {row}" for name, row in zip(robot.joint_names[:n], rows, strict=True))


def _vector(values: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:g}' for value in values)}]"
