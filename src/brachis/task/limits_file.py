"""Joint limits from a separate file, for example the figures published by a manufacturer."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from brachis.common.files import check_kind, read_text
from brachis.errors import TaskError
from brachis.task.fields import (
    CheckedModel,
    Flag,
    Mistake,
    Model,
    Name,
    NonEmpty,
    Number,
    Positive,
    Version,
    merge,
    plain,
)
from brachis.task.limit_kinds import ROBOT_LIMITS, LimitScale
from brachis.task.limit_models import (
    FROM_URDF,
    LimitSpec,
    map_by_joint,
    without_defaults,
)
from brachis.task.messages import validate
from brachis.task.settings import RobotSettings
from brachis.task.yaml_reader import read_yaml


class LimitsFile(CheckedModel):
    """The content of a limits file."""

    brachis_limits: Version
    """Version of the format."""
    source: Name
    """Origin of the figures."""
    joints: NonEmpty[Name]
    """Names of the joints whose limits the file states."""
    limits: LimitSpec
    """Limits as in robot.limits, without scale. A list is in the order of `joints`; a single number applies to all."""

    def _mistakes(self) -> Iterator[Mistake]:
        if self.limits.scale != LimitScale():
            yield (
                "limits.scale",
                "a limits file cannot contain factors on limits",
                "robot.limits.scale in the task",
            )

    def by_kind(self, where: str) -> dict[str, Any]:
        """Return the joint limits by kind and joint, and the limits on the whole robot; `where` names the file."""
        return {
            kind: value
            if kind in ROBOT_LIMITS
            else map_by_joint(f"{where}: limits.{kind}", value, self.joints, FROM_URDF)
            for kind, value in without_defaults(self.limits).items()
        }


_ROS_KINDS = {
    "position": ("position", ("min_position", "max_position")),
    "velocity": ("velocity", ("max_velocity",)),
    "acceleration": ("acceleration", ("max_acceleration",)),
    "jerk": ("jerk", ("max_jerk",)),
    "effort": ("torque", ("max_effort",)),
}
"""For each kind of limit in ROS, its name in brachis and the keys of its values."""
_UR_JOINTS = {"shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"}
"""Names of joints in files of Universal Robots, in which the ending ``_joint`` of the URDF names may be missing."""
_SUFFIX = "_joint"


class RosJointLimits(CheckedModel):
    """Limits of one joint as in ROS, in SI units. A kind with neither figures nor ``has_...`` is not stated."""

    has_position_limits: Flag | None = None
    min_position: Number | None = None
    max_position: Number | None = None
    has_velocity_limits: Flag | None = None
    max_velocity: Number | None = None
    has_acceleration_limits: Flag | None = None
    max_acceleration: Number | None = None
    has_jerk_limits: Flag | None = None
    max_jerk: Number | None = None
    has_effort_limits: Flag | None = None
    max_effort: Number | None = None
    angle_wraparound: Flag = False

    def _mistakes(self) -> Iterator[Mistake]:
        for kind, (_, keys) in _ROS_KINDS.items():
            switch = f"has_{kind}_limits"
            has = getattr(self, switch)
            figures = {key: getattr(self, key) for key in keys}
            if has is None:
                has = set(figures.values()) != {None}
            for key, figure in figures.items() if has else ():
                if figure is None:
                    yield key, "this figure is missing", f"or {switch}: false"
                elif kind != "position" and figure <= 0.0:
                    yield key, "out of range", f"> 0, or {switch}: false"

    def by_kind(self) -> dict[str, Any]:
        """Return the stated limits by their kinds in brachis; None for a kind that is switched off."""
        stated: dict[str, Any] = {}
        for kind, (name, keys) in _ROS_KINDS.items():
            figures = tuple(getattr(self, key) for key in keys)
            if getattr(self, f"has_{kind}_limits") is False:
                stated[name] = None
            elif None not in figures:
                stated[name] = figures if kind == "position" else figures[0]
        return stated


class RosLimitsFile(Model):
    """The content of a ``joint_limits.yaml`` file of MoveIt, ros2_control or Universal Robots."""

    joint_limits: Annotated[dict[Name, RosJointLimits], Field(min_length=1)]
    """Limits of each joint: has_velocity_limits, max_velocity and so on."""
    default_velocity_scaling_factor: Annotated[Positive, Field(le=1)] = 1.0
    """Value of limits.scale.velocity if the task does not state that factor."""
    default_acceleration_scaling_factor: Annotated[Positive, Field(le=1)] = 1.0
    """Value of limits.scale.acceleration if the task does not state that factor."""

    @property
    def joints(self) -> dict[str, RosJointLimits]:
        """Limits by joint name in the URDF."""
        short = {
            name.removesuffix(_SUFFIX): limits
            for name, limits in self.joint_limits.items()
        }
        if set(short) == _UR_JOINTS:
            return {name + _SUFFIX: limits for name, limits in short.items()}
        return self.joint_limits

    def by_kind(self, _where: str) -> dict[str, Any]:
        """Return the limits by kind in brachis and by joint, and the factors on them."""
        stated: dict[str, Any] = {}
        for name, limits in self.joints.items():
            for kind, value in limits.by_kind().items():
                stated.setdefault(kind, {})[name] = value
        factors = {
            "velocity": self.default_velocity_scaling_factor,
            "acceleration": self.default_acceleration_scaling_factor,
        }
        if set(factors.values()) != {1.0}:
            stated["scale"] = factors
        return stated


def read_limits(path: str | os.PathLike[str]) -> LimitSpec:
    """Return the limits that a file states for each joint; limits that it does not state come from the URDF.

    Raises
    ------
    TaskError
        The file is missing, not YAML, or wrong; the message names the key.
    InputError
        A list of limits has the wrong length.
    UnknownNameError
        A limit is given for a joint that is not among the file's ``joints``.

    Examples
    --------
    >>> import brachis
    >>> limits = brachis.read_limits("robots/panda_limits.yaml")
    >>> limits.velocity["panda_joint1"]
    2.175
    """
    file = _read_file(Path(path), str(path), Path.cwd(), None)
    return LimitSpec(**file.by_kind(str(path)))


def with_limits_of_file(
    content: Mapping[str, Any], source: str, folder: Path
) -> Mapping[str, Any]:
    """Return the content of a task with the limits of its limits file merged into ``robot.limits``.

    Limits in the task override those in the file. If they name joints, they override only the limits of these joints.

    Parameters
    ----------
    content : mapping
        A task, not checked yet.
    source : str
        File name or other origin of the task, for messages.
    folder : Path
        Folder to which the path of the file is relative.
    """
    robot = content.get("robot")
    if not isinstance(robot, Mapping) or robot.get("limits_file") is None:
        return content
    try:
        settings = RobotSettings.model_validate(plain(robot))
    except ValidationError:
        return content  # the later check of the task reports the mistake
    task_limits = robot.get("limits") or {}
    if isinstance(task_limits, LimitSpec):
        task_limits = without_defaults(task_limits)
    name = str(settings.limits_file)
    path = folder / name
    file = _read_file(path, f"{source}: robot.limits_file", folder, name)
    robot_keys = {key: value for key, value in robot.items() if key != "limits_file"}
    limits = merge(file.by_kind(str(path)), task_limits)
    return {**content, "robot": {**robot_keys, "limits": limits}}


def _read_file(
    path: Path, where: str, folder: Path, found: str | None
) -> LimitsFile | RosLimitsFile:
    check_kind(path, "a limits file", TaskError)
    text = read_text(path, where=where, folder=folder, found=found, largest=100_000)
    content = read_yaml(text, str(path))
    if isinstance(content, Mapping) and "joint_limits" in content:
        return validate(RosLimitsFile, content, str(path))
    return validate(LimitsFile, content, str(path))
