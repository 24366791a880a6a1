"""What a robot was made with, as the ``robot`` part of a task."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from brachis.robot.limits import per_joint_values
from brachis.task import FROM_URDF, LimitSpec, RobotSettings, check_robot_settings


def settings_used(
    added: RobotSettings,
    path: str | os.PathLike[str],
    names: Sequence[str],
    tool_frame: str | None,
    base_frame: str | None,
    gravity: np.ndarray,
    locked_joints: Mapping[str, float] | None,
    limits: LimitSpec,
    friction: Mapping[str, object] | None,
) -> RobotSettings:
    """Keep the arguments of `Robot.from_urdf` as the ``robot`` part of a task; `added` has those that it checked."""
    by_name: dict[str, Any] = {
        each.name: _by_name(getattr(limits, each.name), names, each.default)
        for each in fields(limits)
    }
    content = {
        "urdf": str(Path(path).absolute()),
        "tool_frame": tool_frame,
        "base_frame": base_frame,
        "gravity": gravity,
        "locked_joints": dict(locked_joints or {}),
        "limits": replace(limits, **by_name),
        "friction": dict(friction or {}),
        **{
            name: getattr(added, name)
            for name in ("payload", "tool_offset", "mounting", "speed_override")
        },
    }
    made, default = check_robot_settings(content), RobotSettings()
    # What is as by default counts as left out where the settings meet those of another robot or task.
    stated = {
        key: value
        for key, value in content.items()
        if getattr(made, key) != getattr(default, key)
    }
    return check_robot_settings(stated)


def _by_name(value: object, names: Sequence[str], absent: object) -> object:
    """Return a limit that is given joint by joint as a mapping, without the joints that take the URDF's."""
    if not isinstance(value, tuple | dict):
        return value
    listed = per_joint_values("limits", value, names, FROM_URDF)
    kept = {
        name: entry
        for name, entry in zip(names, listed, strict=True)
        if not isinstance(entry, str)
    }
    return kept or absent
