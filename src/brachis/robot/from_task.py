"""The robot that a task file describes.

A robot that is given together with a task that has a ``robot`` part of its own.

What acts on a robot beside its URDF's links: payload, offset, mounting, friction, armature, slower limits.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from brachis.errors import InputError, TaskError
from brachis.robot.friction import Friction
from brachis.robot.joints import UNITS
from brachis.robot.limits import (
    MAGNITUDES,
    Limits,
    per_joint_values,
    resolve_limits,
    to_spec,
    without_joints,
)
from brachis.robot.robot import ROLL_JOINT, Robot
from brachis.robot.task_map.choice import with_free_roll
from brachis.robot.urdf import read_chain
from brachis.task import FrictionSettings, LimitSpec, Placement, RobotSettings
from brachis.task.fields import Model


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
        The task's ``robot`` part.
    urdf : path, optional
        URDF file to use in place of the one that the task names.
    urdf_text : str, optional
        Text of the URDF, where it has been kept beside the task; nothing is read from disk then.

    Raises
    ------
    TaskError
        No URDF is named; or a file of limits that was not read, because `load_task` did not make the task.
    UrdfError, UnknownNameError, LimitError, InputError
        See `Robot.from_urdf`.
    """
    source = urdf if urdf is not None else settings.urdf
    if source is None and urdf_text is None:
        raise TaskError(
            "no URDF is named", where="robot.urdf", allowed="path of a URDF file"
        )
    if settings.limits_file is not None:
        found, hint = (
            settings.limits_file,
            "Make the task with brachis.load_task, or give robot.limits",
        )
        raise TaskError(
            "the file of limits was not read",
            where="robot.limits_file",
            found=found,
            hint=hint,
        )
    return Robot.from_urdf(
        source if source is not None else "saved URDF",
        urdf_text=urdf_text,
        tool_frame=settings.tool_frame,
        base_frame=settings.base_frame,
        gravity=settings.gravity,
        locked_joints=settings.locked_joints,
        limits=settings.limits,
        friction=settings.friction.model_dump(),
        payload=settings.payload,
        tool_offset=settings.tool_offset,
        mounting=settings.mounting,
        speed_override=settings.speed_override,
    )


_FRAMES = ("tool_frame", "base_frame", "locked_joints")
"""Settings that decide which joints the chain has."""
_PER_JOINT = (
    *(f"robot.limits.{kind}" for kind in (*MAGNITUDES, "position")),
    *(f"robot.friction.{kind}" for kind in FrictionSettings.model_fields),
)
"""Settings with a value for each joint, which may be written as one value, a list or a mapping."""


def robot_for(
    robot: str | os.PathLike[str] | Robot | None, settings: RobotSettings
) -> Robot:
    """Return the robot that a task is planned for; its `Robot.settings` make it again.

    Parameters
    ----------
    robot : path, Robot or None
        URDF file to use in place of the one that the task names, or a robot to use in place of it. What the task's
        ``robot`` part sets beside the URDF holds for a robot too: it is added to what the robot was made with.
    settings : RobotSettings
        The task's ``robot`` part.

    Raises
    ------
    TaskError
        Robot and task contradict each other; or no URDF is named.
    InputError
        See `Robot.from_urdf`.
    """
    if not isinstance(robot, Robot):
        return robot_from_settings(settings, urdf=robot)
    given = _stated(robot)
    wanted = _combined(robot, given, settings)
    if wanted == given:
        return robot if given is robot.settings else replace(robot, settings=given)
    same = robot_from_settings(given, urdf_text=robot.urdf)
    if (with_free_roll(same) if robot.rolls_freely else same).model != robot.model:
        raise InputError(
            "the robot's model is not the one of its URDF and settings, so the task's robot part cannot be added",
            where="robot",
            found="a model that was changed",
            hint="Leave the robot part of the task away, or give the robot by its URDF",
        )
    return robot_from_settings(wanted, urdf_text=robot.urdf)


def _stated(robot: Robot) -> RobotSettings:
    """Return settings that make the robot; they spell out limits, friction and gravity that were replaced later."""
    settings = robot.settings
    names = _own_joints(robot)
    n = len(names)
    changes: dict[str, object] = {}
    made = resolve_limits(
        settings.limits, names, robot.stated_limits[:n], settings.speed_override
    )
    if not _same(made, robot.limits, n):
        changes |= {"limits": to_spec(robot.limits, names), "speed_override": 1.0}
    if not _same(
        Friction.of(names, robot.stated.friction, **settings.friction.model_dump()),
        robot.friction,
        n,
    ):
        changes["friction"] = _friction(robot.friction, names)
    gravity = tuple(float(component) for component in robot.model.gravity.linear)
    if gravity != settings.gravity:
        changes["gravity"] = gravity
    return settings.model_copy(update=changes) if changes else settings


def _own_joints(robot: Robot) -> list[str]:
    """Joints of the URDF; the virtual one by which a tool rolls is not among them."""
    return [
        name
        for name in robot.joint_names
        if not (robot.rolls_freely and name == ROLL_JOINT)
    ]


def _same(first: Limits | Friction, second: Limits | Friction, n: int) -> bool:
    """Compare what is stated joint by joint at the first n joints, and all else as it is."""

    def same(one: Any, other: Any) -> bool:
        if isinstance(one, np.ndarray):
            return np.array_equal(one[:n], other[:n])
        return (
            bool(one[:n] == other[:n]) if isinstance(one, tuple) else bool(one == other)
        )

    return all(
        same(getattr(first, each.name), getattr(second, each.name))
        for each in fields(first)
    )


def _friction(friction: Friction, names: Sequence[str]) -> FrictionSettings:
    """Spell friction out joint by joint."""
    columns = {
        "armature": friction.armature,
        "viscous": friction.viscous,
        "coulomb": friction.coulomb,
        "coulomb_velocity": friction.v_eps,
    }
    return FrictionSettings(
        **{key: tuple(values[: len(names)].tolist()) for key, values in columns.items()}
    )


def _combined(
    robot: Robot, given: RobotSettings, asked: RobotSettings
) -> RobotSettings:
    """Put the settings of the robot and of the task together; the URDF is the robot's."""
    asked = asked.model_copy(update={"urdf": given.urdf})
    defaults = RobotSettings(urdf=given.urdf)
    if asked == given:
        return given
    frames = _merged(
        "robot", _only(given, _FRAMES), _only(asked, _FRAMES), RobotSettings(), ()
    )
    names = _own_joints(robot)
    limits = [getattr(asked.limits, each.name) for each in fields(asked.limits)]
    limited = {name for limit in limits if isinstance(limit, Mapping) for name in limit}
    if frames != _only(given, _FRAMES) or not limited <= set(names):
        chosen = {name: getattr(frames, name) for name in _FRAMES}
        chain = read_chain(robot.urdf, robot.source, **chosen)
        names = list(chain.joint_names)
        if "limits" in asked.model_fields_set:
            asked = asked.model_copy(
                update={"limits": without_joints(asked.limits, chain.locked)}
            )
    combined: RobotSettings = _merged("robot", given, asked, defaults, names)
    return combined


def _only(settings: RobotSettings, names: Sequence[str]) -> RobotSettings:
    """Keep some of the settings, and leave the others at their defaults."""
    return RobotSettings(
        **{
            name: getattr(settings, name)
            for name in names
            if name in settings.model_fields_set
        }
    )


def _list_set_fields(asked: LimitSpec, default: LimitSpec) -> list[str]:
    """List the fields that a task may have written: a limit that is as by default counts as left out."""
    pairs = ((each.name, getattr(asked, each.name)) for each in fields(asked))
    return [
        name
        for name, value in pairs
        if isinstance(value, Model) or value != getattr(default, name)
    ]


def _merged(
    key: str, given: Any, asked: Any, default: Any, names: Sequence[str]
) -> Any:
    """Take what is set on one side or, alike, on both.

    In the task a key that is written counts as set, in the robot a value that differs from the default.
    """
    if asked == given:
        return given
    if isinstance(given, Model | LimitSpec) and default is not None:
        written = (
            asked.model_fields_set
            if isinstance(asked, Model)
            else _list_set_fields(asked, default)
        )
        parts = {
            name: _merged(
                f"{key}.{name}",
                getattr(given, name),
                getattr(asked, name),
                getattr(default, name),
                names,
            )
            for name in written
        }
        return (
            given.model_copy(update=parts)
            if isinstance(given, Model)
            else replace(given, **parts)
        )
    if given == default:
        return asked
    own, other = given, asked
    if key in _PER_JOINT:
        own, other = (
            dict(zip(names, per_joint_values(key, side, names, default), strict=True))
            for side in (given, asked)
        )
    if not (isinstance(own, Mapping) and isinstance(other, Mapping)):
        raise TaskError(
            "the task and the robot that is given with it contradict each other",
            where=key,
            found=f"{asked} in the task, {given} in the robot",
            allowed="the same in both, or set in one of them",
        )
    absent = default if key in _PER_JOINT else None
    said = {name: value for name, value in other.items() if value != absent}
    merged = dict(own) | {
        name: _merged(f"{key}.{name}", own.get(name, absent), value, absent, ())
        for name, value in said.items()
    }
    return (
        given
        if merged == own
        else {name: value for name, value in merged.items() if value != absent}
    )


_NAMES = {
    "armature": "armature",
    "viscous": "viscous friction",
    "coulomb": "Coulomb friction",
}


def in_use(robot: Robot) -> dict[str, str]:
    """Say in words, with units, what is in use; what is not, is left out.

    Friction is always said, with where it comes from: the URDF, unless the task says otherwise.
    """
    settings, said = robot.settings, {}
    if settings.payload is not None:
        moments = (
            "a point mass"
            if settings.payload.inertia is None
            else "with moments of inertia"
        )
        said["payload"] = (
            f"{settings.payload.mass:g} kg at {_vector(settings.payload.com)} m in the tool frame, {moments}"
        )
    for name, placement in (
        ("tool offset", settings.tool_offset),
        ("mounting", settings.mounting),
    ):
        if placement.model_dump() != Placement().model_dump():
            said[name] = (
                f"at {_vector(placement.xyz)} m, roll, pitch, yaw {_vector(placement.rpy_deg)} deg"
            )
    if settings.speed_override != 1.0:
        said["speed override"] = (
            f"{100.0 * settings.speed_override:g} % of the joint velocity limits"
        )
    factors = {kind: factor for kind, factor in settings.limits.scale if factor != 1.0}
    if factors:
        parts = ", ".join(
            f"{kind.replace('_', ' ')} {100.0 * factor:g} %"
            for kind, factor in factors.items()
        )
        said["limits"] = f"{parts} of what is stated (limits.scale)"
    if robot.friction.armature.any():
        said["armature"] = _by_joint(robot, "armature")
    for kind, stated in robot.stated.friction.items():
        figures = getattr(robot.friction, kind)[: len(stated)]
        origin = (
            "as the URDF states it"
            if np.array_equal(figures, stated)
            else "other than the URDF's"
        )
        if figures.any():
            said[_NAMES[kind]] = f"{_by_joint(robot, kind)} ({origin})"
        else:
            said[_NAMES[kind]] = f"none ({origin})"
    return said


def _by_joint(robot: Robot, kind: str) -> str:
    """Write one term of the friction with its units, joint by joint unless it is the same at all."""
    figures, n = getattr(robot.friction, kind), len(robot.stated.bodies)
    rows = [
        f"{value:g} {UNITS[kind][unit]}"
        for value, unit in zip(figures[:n], robot.position_units[:n], strict=True)
    ]
    if len(set(rows)) == 1 and n > 1:
        return f"{rows[0]} at every joint"
    return ", ".join(
        f"{name} {row}" for name, row in zip(robot.joint_names[:n], rows, strict=True)
    )


def _vector(values: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:g}' for value in values)}]"
