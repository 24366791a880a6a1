"""The robot that a task describes, alone or together with a given robot; and a description of its settings in words."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from brachis.common.files import shipped_robots
from brachis.errors import InputError, TaskError, UrdfError, suggest
from brachis.robot.friction import Friction
from brachis.robot.joints import UNITS
from brachis.robot.limits import (
    resolve_limits,
    to_spec,
    without_joints,
)
from brachis.robot.robot import Robot
from brachis.robot.task_map.choice import with_tool_joints
from brachis.robot.urdf import read_chain
from brachis.task import (
    LIMIT_KINDS,
    FrictionSettings,
    LimitSpec,
    Placement,
    RobotSettings,
    check_robot_settings,
)
from brachis.task.fields import merge
from brachis.task.limit_kinds import LimitScale
from brachis.task.limit_models import map_by_joint, without_defaults


def robot_from_settings(
    settings: RobotSettings,
    *,
    urdf: str | os.PathLike[str] | None = None,
    urdf_text: str | None = None,
) -> Robot:
    """Build the robot of a task.

    Parameters
    ----------
    settings : RobotSettings
        The task's ``robot`` section.
    urdf : path, optional
        URDF file to use in place of the URDF that the task names.
    urdf_text : str, optional
        Text of the URDF, if it was saved with the task. In this case, nothing is read from disk.

    Raises
    ------
    TaskError
        No URDF is named; or the limits file was not read, because the task was not made by `load_task`.
    UrdfError, UnknownNameError, LimitError, InputError
        See `Robot.from_urdf`.
    """
    source = urdf if urdf is not None else settings.urdf
    if source is None and urdf_text is None:
        raise TaskError(
            "the URDF is missing", where="robot.urdf", allowed="path of a URDF file"
        )
    path = Path(source or "saved URDF")
    if urdf is None and urdf_text is None and not path.exists():
        robots = shipped_robots()
        raise UrdfError(
            "the file does not exist",
            where="robot.urdf",
            found=str(path),
            allowed=f"a URDF file, or the name of an included robot: {', '.join(robots)}",
            hint=suggest(path.name, robots),
        )
    named = settings.model_copy(update={"urdf": str(path.absolute())})
    return Robot.from_settings(named, str(path), urdf_text)


_FRAMES = ("tool_frame", "base_frame", "workpiece_frame", "locked_joints")
"""Settings that determine the joints of the chain."""
_PER_JOINT: dict[str, object] = {
    **{
        f"robot.limits.{entry.name}": entry.default
        for entry in fields(LimitSpec)
        if entry.name in LIMIT_KINDS
    },
    **{
        f"robot.friction.{kind}": field.default
        for kind, field in FrictionSettings.model_fields.items()
    },
}
"""Settings that may be one value, a list or a mapping by joint, with the value for joints that a mapping leaves out."""


def robot_for(
    robot: str | os.PathLike[str] | Robot | None, settings: RobotSettings
) -> Robot:
    """Return the robot for which a task is planned. The same robot can be built from its `Robot.settings`.

    Parameters
    ----------
    robot : path, Robot or None
        URDF file or robot to use in place of the URDF that the task names. The task's ``robot`` section also applies to
        a given robot: it is added to the robot's settings.
    settings : RobotSettings
        The task's ``robot`` section.

    Raises
    ------
    TaskError
        Robot and task contradict each other, or the URDF is missing.
    InputError
        See `Robot.from_urdf`.
    """
    if not isinstance(robot, Robot):
        return robot_from_settings(settings, urdf=robot)
    current = _current_settings(robot)
    combined = current if settings == current else _combine(robot, current, settings)
    if combined == current:
        return robot if current is robot.settings else replace(robot, settings=current)
    same = robot_from_settings(current, urdf_text=robot.urdf)
    if robot.tool_joints:
        same = with_tool_joints(same, robot.tool_joints)
    if same.model != robot.model:
        raise InputError(
            "the robot's model differs from its URDF and settings, so the task's robot section cannot be applied",
            where="robot",
            found="a model that was changed",
            hint="Remove the robot section of the task, or give the robot by its URDF",
        )
    return robot_from_settings(combined, urdf_text=robot.urdf)


def _current_settings(robot: Robot) -> RobotSettings:
    """Return settings that rebuild the robot, whose limits, friction and gravity may have been replaced."""
    settings = robot.settings
    names = robot.urdf_joints
    changes: dict[str, object] = {}
    limits = to_spec(robot.limits, names)
    made = resolve_limits(
        settings.limits,
        names,
        robot.urdf_limits[: len(names)],
        settings.speed_override,
    )
    if limits != to_spec(made, names):
        changes |= {"limits": limits, "speed_override": 1.0}
    every = range(len(names))
    friction = _to_settings(robot.friction, every)
    rubbing = Friction.of(names, robot.urdf_dynamics.friction, settings.friction)
    if friction != _to_settings(rubbing, every):
        changes["friction"] = friction
    gravity = tuple(float(component) for component in robot.model.gravity.linear)
    if gravity != settings.gravity:
        changes["gravity"] = gravity
    return settings.model_copy(update=changes) if changes else settings


def lock_joints(robot: Robot, positions: Mapping[str, float]) -> Robot:
    """Return the robot with joints held at positions, rad or m; other joints keep their limits and friction."""
    names = robot.urdf_joints
    moving = [i for i, name in enumerate(names) if name not in positions]
    settings = _current_settings(robot)
    changes: dict[str, object] = {
        "locked_joints": {**settings.locked_joints, **positions},
        "limits": to_spec(robot.limits, names),
        "speed_override": 1.0,
        "friction": _to_settings(robot.friction, moving),
    }
    locked = settings.model_copy(update=changes)
    return Robot.from_settings(locked, robot.source, robot.urdf)


def with_settings(robot: Robot, **changes: Any) -> Robot:
    """Return the robot with other settings, and with the same limits and friction."""
    gravity = tuple(robot.model.gravity.linear.tolist())
    settings = robot.settings.model_copy(update={"gravity": gravity, **changes})
    changed = Robot.from_settings(settings, robot.source, robot.urdf)
    if robot.tool_joints:
        changed = with_tool_joints(changed, robot.tool_joints)
    return replace(changed, limits=robot.limits, friction=robot.friction)


def replace_limits(robot: Robot, limits: LimitSpec) -> Robot:
    """Return the robot with other limits in place of its own; its factors apply to them unless they are replaced."""
    settings = robot.settings
    names = robot.urdf_joints
    unscaled = replace(settings.limits, scale=LimitScale())
    known = resolve_limits(unscaled, names, robot.urdf_limits[: len(names)])
    factors = limits.scale.model_dump(exclude_defaults=True)
    changes = without_defaults(limits)
    changes["scale"] = settings.limits.scale.model_copy(update=factors)
    spec = LimitSpec(**merge(vars(to_spec(known, names)), changes))
    changed = settings.model_copy(update={"limits": spec})
    same = Robot.from_settings(changed, robot.source, robot.urdf)
    return with_tool_joints(same, robot.tool_joints) if robot.tool_joints else same


def _to_settings(friction: Friction, joints: Sequence[int]) -> FrictionSettings:
    """Write the friction of some joints, given by their indices, as settings."""
    keys = ("armature", "viscous", "coulomb", "coulomb_velocity")
    columns = friction.table[list(joints)].T.tolist()
    return FrictionSettings.model_validate(dict(zip(keys, columns, strict=True)))


def _combine(
    robot: Robot, robot_settings: RobotSettings, task_settings: RobotSettings
) -> RobotSettings:
    """Merge the settings of the robot and of the task. The URDF always comes from the robot.

    In the task, a key counts as set if it is written. In the robot, a key counts as set if its value is not the
    default.
    """
    robot_keys = robot_settings.model_dump(exclude_defaults=True)
    written = task_settings.model_dump(exclude_unset=True, exclude={"urdf"})
    robot_frames, task_frames = (
        {key: keys[key] for key in _FRAMES if key in keys}
        for keys in (robot_keys, written)
    )
    frames = _merge("robot", robot_frames, task_frames, ())
    chain = read_chain(
        robot.urdf,
        robot.source,
        frames.get("tool_frame"),
        frames.get("base_frame"),
        tuple(frames.get("locked_joints", {}).items()),
        frames.get("workpiece_frame"),
    )
    if "limits" in written:
        moving = without_joints(task_settings.limits, chain.locked)
        scale = written["limits"]["scale"]
        written["limits"] = without_defaults(moving) | {"scale": scale}
    return check_robot_settings(_merge("robot", robot_keys, written, chain.joint_names))


def _merge(key: str, robot_value: Any, task_value: Any, names: Sequence[str]) -> Any:
    """Merge two values: both sides may set different keys or joints, or set the same key to the same value.

    Raises
    ------
    TaskError
        The two sides set different values.
    """
    if task_value == robot_value:
        return robot_value
    robot_entries, task_entries = robot_value, task_value
    if key in _PER_JOINT:
        absent = _PER_JOINT[key]
        robot_entries, task_entries = (
            map_by_joint(key, side, names, absent)
            for side in (robot_entries, task_entries)
        )
    if not (isinstance(robot_entries, Mapping) and isinstance(task_entries, Mapping)):
        raise TaskError(
            "the task and the robot given with it contradict each other",
            where=key,
            found=f"{task_value} in the task, {robot_value} in the robot",
            allowed="the same in both, or set in one of them",
        )
    merged = dict(robot_entries) | {
        name: _merge(f"{key}.{name}", robot_entries.get(name, value), value, names)
        for name, value in task_entries.items()
    }
    return robot_value if merged == robot_entries else merged


def in_use(robot: Robot, qddot: np.ndarray | None = None) -> dict[str, str]:
    """Describe a robot in words, with units: payload, placements, gravity, scaled limits, armature, friction.

    The description of friction says whether the values come from the URDF or from the task. Joints without an
    acceleration limit or without a torque limit are also named. If accelerations of a motion, (K, n), are given, the
    largest acceleration without a limit is named. Without masses, the torques are described as unknown.
    """
    settings = robot.settings
    payload = settings.payload
    used = {}
    if payload is not None:
        moments = (
            "with moments of inertia" if payload.inertia is not None else "a point mass"
        )
        used["payload"] = (
            f"{payload.mass:g} kg at {_vector(payload.com)} m in the tool frame, {moments}"
        )
    placements = {"tool offset": settings.tool_offset, "mounting": settings.mounting}
    for name, placement in placements.items():
        if placement != Placement():
            used[name] = (
                f"at {_vector(placement.xyz)} m, roll, pitch, yaw {_vector(placement.rpy_deg)} deg"
            )
    if settings.workpiece_frame is not None:
        used["paths"] = f"in the frame of {settings.workpiece_frame}"
    used["gravity"] = f"{_vector(robot.model.gravity.linear)} m/s^2"
    if settings.speed_override != 1.0:
        used["speed override"] = (
            f"{100.0 * settings.speed_override:g} % of the joint velocity limits"
        )
    factors = ", ".join(
        f"{kind.replace('_', ' ')} {100.0 * factor:g} %"
        for kind, factor in settings.limits.scale
        if factor != 1.0
    )
    if factors:
        used["limits"] = f"{factors} of what is stated (limits.scale)"
    unlimited = _without_limit(robot, "acceleration", qddot)
    if unlimited:
        used["acceleration limits"] = unlimited
    return used | _torques_in_use(robot)


def _torques_in_use(robot: Robot) -> dict[str, str]:
    """Describe armature, friction and missing torque limits, or say that torques are unknown."""
    bodies = robot.urdf_dynamics.without_mass
    if bodies:
        joints = ", ".join(body.joint for body in bodies)
        of_some = f" at {joints}" if len(bodies) < len(robot.urdf_joints) else ""
        return {"torques": f"unknown, the URDF has no masses{of_some}"}
    used = {}
    unlimited = _without_limit(robot, "torque")
    if unlimited:
        used["torque limits"] = unlimited
    titles = {"viscous": "viscous friction", "coulomb": "Coulomb friction"}
    if robot.friction.armature.any():
        titles["armature"] = "armature"
    for kind, title in titles.items():
        stated = robot.urdf_dynamics.friction[kind]
        figures = getattr(robot.friction, kind)[: len(stated)]
        shown = _by_joint(robot, kind) if figures.any() else "none"
        same = np.array_equal(figures, stated)
        origin = "as in the URDF" if same else "different from the URDF"
        used[title] = f"{shown} ({origin})"
    return used


def _without_limit(robot: Robot, kind: str, motion: np.ndarray | None = None) -> str:
    """Name the joints without a limit of this kind, and the largest figure of these joints in a motion, (K, n)."""
    names = robot.urdf_joints
    ends = robot.limits.both_ways(kind)[:, : len(names)]
    is_free = ~np.isfinite(ends).all(axis=0)
    if not is_free.any():
        return ""
    free = [
        name for name, is_unlimited in zip(names, is_free, strict=True) if is_unlimited
    ]
    of_some = "" if is_free.all() else f" for {', '.join(free)}"
    text = f"none{of_some} (robot.limits.{kind})"
    if motion is None:
        return text
    largest = np.abs(motion[:, : len(names)]).max(axis=0)
    units = np.array(robot.position_units[: len(names)])
    figures = []
    for unit, shown in UNITS[kind].items():
        joints = np.flatnonzero(is_free & (units == unit))
        if len(joints):
            joint = joints[np.argmax(largest[joints])]
            figures.append(f"{largest[joint]:.4g} {shown}, of {names[joint]}")
    return f"{text}; the largest is {', and '.join(figures)}"


def _by_joint(robot: Robot, kind: str) -> str:
    """Write one friction term with its units, joint by joint unless all joints have the same value."""
    names = robot.urdf_joints
    columns = zip(getattr(robot.friction, kind), robot.position_units, strict=True)
    rows = [f"{value:g} {UNITS[kind][unit]}" for value, unit in columns][: len(names)]
    if len(set(rows)) == 1 and len(rows) > 1:
        return f"{rows[0]} at every joint"
    return ", ".join(f"{name} {row}" for name, row in zip(names, rows, strict=True))


def _vector(values: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:g}' for value in values)}]"
