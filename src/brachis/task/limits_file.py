"""Joint limits from a file of their own, such as those that the maker of a robot publishes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from brachis.errors import TaskError, UnknownNameError
from brachis.task.fields import Model, Name, plain
from brachis.task.limit_models import LimitSpec
from brachis.task.messages import show, task_error
from brachis.task.text_file import read_text
from brachis.task.yaml_reader import read_yaml

_LARGEST = 100_000
"""Bytes."""
_OF_ALL = "total_power"
"""The limit that is one number for the whole robot."""


class LimitsFile(Model):
    """What a limits file says."""

    brachis_limits: Literal[1] = Field(description="Version of the format.")
    source: Name = Field(description="Where the figures are from.")
    joints: Annotated[tuple[Name, ...], Field(min_length=1)] = Field(description="The joints that the file limits.")
    limits: LimitSpec = Field(
        description="As robot.limits, without scale; a list is in the order of joints, one number holds for all."
    )


def read_limits(path: str | os.PathLike[str]) -> LimitSpec:
    """Return the limits that a file states, joint by joint; kinds and joints that it leaves out are the URDF's.

    Raises
    ------
    TaskError
        The file is missing, no YAML, or wrong; the message names its key.
    UnknownNameError
        A limit is given for a joint that is not among the file's ``joints``.

    Examples
    --------
    >>> import brachis
    >>> limits = brachis.read_limits("robots/panda_limits.yaml")
    >>> limits.velocity["panda_joint1"]
    2.175
    """
    return LimitSpec(**_by_joint(Path(path), str(path), Path.cwd(), None))


def with_limits_of_file(content: Mapping[str, Any], source: str, folder: Path) -> Mapping[str, Any]:
    """Return a task as it is written with the limits of the file that it names in its ``robot.limits``.

    What the task itself says counts, joint by joint where it names joints. Joints that the task locks are left out.

    Parameters
    ----------
    content : mapping
        A task, not checked yet.
    source : str
        File name, or what else the task came from, for messages.
    folder : Path
        What the file's path is relative to.
    """
    robot = content.get("robot")
    if not isinstance(robot, Mapping) or not isinstance(robot.get("limits_file"), str | os.PathLike):
        return content
    file, own, locked = Path(robot["limits_file"]), robot.get("limits") or {}, robot.get("locked_joints")
    if isinstance(own, LimitSpec):
        own = {each.name: getattr(own, each.name) for each in fields(own) if getattr(own, each.name) != each.default}
    if not isinstance(own, Mapping):
        return content
    stated = _by_joint(folder / file, f"{source}: robot.limits_file", folder, str(file))
    merged = {
        kind: {name: limit for name, limit in each.items() if name not in (locked or ())}
        if isinstance(each, Mapping)
        else each
        for kind, each in stated.items()
    }
    for kind, value in own.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(kind), Mapping)
        merged[kind] = {**merged[kind], **value} if both else value
    rest = {key: value for key, value in robot.items() if key != "limits_file"}
    return {**content, "robot": {**rest, "limits": merged}}


def _by_joint(path: Path, where: str, folder: Path, found: str | None) -> dict[str, Any]:
    """Read and check a file; its limits by kind and joint, and the one of all joints together."""
    text = read_text(path, where=where, folder=folder, found=found, largest=_LARGEST)
    content = read_yaml(text, str(path))
    if not isinstance(content, Mapping):
        allowed = ", ".join(LimitsFile.model_fields)
        raise TaskError("a limits file is a mapping", found=show(content), allowed=allowed, where=str(path))
    try:
        file = LimitsFile.model_validate(plain(content))
    except ValidationError as error:
        raise task_error(error, str(path), LimitsFile) from None
    if file.limits.scale != LimitSpec().scale:
        raise TaskError(
            "factors on limits belong to the task",
            where=f"{path}: limits.scale",
            allowed="robot.limits.scale of the task",
        )
    kinds = [each for each in fields(LimitSpec) if each.name != "scale"]
    stated = {each.name: getattr(file.limits, each.name) for each in kinds}
    return {
        each.name: stated[each.name]
        if each.name == _OF_ALL
        else _spread(stated[each.name], file.joints, f"{path}: limits.{each.name}")
        for each in kinds
        if stated[each.name] != each.default
    }


def _spread(value: object, joints: tuple[str, ...], where: str) -> dict[str, Any]:
    """Give every joint of the file its limit."""
    if isinstance(value, Mapping):
        for name in value:
            if name not in joints:
                raise UnknownNameError("joint of the limits file", name, joints, where=where)
        return dict(value)
    if isinstance(value, tuple):
        if len(value) != len(joints):
            allowed = f"{len(joints)}, one for each of {', '.join(joints)}"
            raise TaskError("has the wrong number of values", where=where, found=len(value), allowed=allowed)
        return dict(zip(joints, value, strict=True))
    return dict.fromkeys(joints, value)
