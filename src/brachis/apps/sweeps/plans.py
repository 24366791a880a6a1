"""From a sweep file to the plans that it asks for, each known by all that decides its outcome."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

import brachis
from brachis.apps.sweeps.settings import SweepSettings
from brachis.common.arguments import file_name
from brachis.common.files import Kind, check_kind, read_text
from brachis.errors import BrachisError, TaskError, UnknownNameError
from brachis.problem.problem import Problem
from brachis.robot import Robot
from brachis.robot.from_task import robot_from_settings
from brachis.robot.urdf import read_file
from brachis.task import Task, with_keys
from brachis.task.fields import plain
from brachis.task.load import LARGEST_TASK, task_from
from brachis.task.messages import show, task_error
from brachis.task.yaml_reader import read_yaml


@dataclass(frozen=True)
class Plan:
    """What is sent to a worker; no file is needed there.

    Attributes
    ----------
    digest : str
        Of all that follows, 16 hexadecimal digits: plans that are alike are made once.
    task : Task
        With all files read.
    urdf : str
        Text of the URDF.
    version : str
        Of brachis.
    """

    digest: str
    task: Task
    urdf: str
    version: str


@dataclass(frozen=True)
class Row:
    """One row of the sweep's table.

    Attributes
    ----------
    changes : mapping
        What it sets of the varied keys.
    plan : Plan or BrachisError
        The error is why there is no plan.
    """

    changes: Mapping[str, Any]
    plan: Plan | BrachisError


@dataclass(frozen=True)
class SweepPlan:
    """A sweep before it is run.

    Attributes
    ----------
    settings : SweepSettings
    base : mapping
        The task, not checked yet.
    rows : tuple of Row
    """

    settings: SweepSettings
    base: Mapping[str, Any]
    rows: tuple[Row, ...]


def load_sweep(source: str | os.PathLike[str] | Mapping[str, Any]) -> SweepPlan:
    """Read a sweep, make its tasks, and check its keys.

    Parameters
    ----------
    source : path or mapping
        A sweep file, or its content; ``task`` may be a `Task` in a mapping.

    Returns
    -------
    SweepPlan

    Raises
    ------
    TaskError
        The sweep or its task is wrong; or a key is refused in all plans that set it. A value that is refused while
        others of the key are not becomes a row with that error.
    """
    content: object = source
    name, folder = "sweep", Path.cwd()
    if not isinstance(source, Mapping):
        path = file_name(source, "source")
        check_kind(path, Kind.SWEEP, TaskError)
        content, name, folder = (
            _yaml(path, Path.cwd()),
            str(path),
            path.absolute().parent,
        )
    if not isinstance(content, Mapping):
        raise TaskError(
            "a sweep is a mapping",
            found=show(content),
            allowed=", ".join(SweepSettings.model_fields),
            where=name,
        )
    if isinstance(content.get("task"), Task):
        content = {**content, "task": content["task"].to_dict()}
    try:
        settings = SweepSettings.model_validate(plain(content))
    except ValidationError as error:
        raise task_error(error, name, SweepSettings) from None
    base, task_name, task_folder = _base(settings, name, folder)
    base = with_keys(base, settings.fixed)
    rows = tuple(
        Row(changes, _plan(base, changes, task_name, task_folder))
        for changes in settings.changes()
    )
    _check_keys(settings, rows, name)
    return SweepPlan(settings, base, rows)


def _yaml(path: Path, folder: Path) -> object:
    return read_yaml(
        read_text(path, where=str(path), folder=folder, largest=LARGEST_TASK), str(path)
    )


def _base(
    settings: SweepSettings, name: str, folder: Path
) -> tuple[Mapping[str, Any], str, Path]:
    """Return the task that is varied, not checked yet, with what its messages name and its files are relative to."""
    if not isinstance(settings.task, str):
        assert isinstance(settings.task, dict)
        return settings.task, f"{name}: task", folder
    path = folder / settings.task
    content = _yaml(path, folder)
    if not isinstance(content, Mapping):
        raise TaskError("a task is a mapping", found=show(content), where=str(path))
    return content, str(path), path.parent


def _plan(
    base: Mapping[str, Any], changes: Mapping[str, Any], name: str, folder: Path
) -> Plan | BrachisError:
    try:
        task = task_from(with_keys(base, changes), name, folder, {})
        if task.robot.urdf is None:
            raise TaskError(
                "no robot", where=f"{name}: robot.urdf", hint="Give the URDF's path"
            )
        urdf = read_file(Path(task.robot.urdf))
    except BrachisError as error:
        return error
    # Plans are made side by side already; how many processes a single one may use must not tell them apart.
    task = task.model_copy(
        update={"search": task.search.model_copy(update={"jobs": 1})}
    )
    known = task.to_dict()
    known["robot"].pop("urdf", None)  # its text counts, not where it is
    said = json.dumps([known, urdf, brachis.__version__], sort_keys=True)
    return Plan(
        hashlib.sha256(said.encode()).hexdigest()[:16], task, urdf, brachis.__version__
    )


def _check_keys(settings: SweepSettings, rows: Sequence[Row], name: str) -> None:
    """Refuse keys with which no task is one, and names that the robot does not know.

    Raises
    ------
    TaskError
    """
    tried: dict[str, BrachisError | None] = {}
    refused: dict[str, str] = {}
    for key in settings.keys or ("task",):
        having = [row for row in rows if key in row.changes or not row.changes]
        sound = [row.plan for row in having if isinstance(row.plan, Plan)]
        for plan in sound:
            if plan.digest not in tried:
                tried[plan.digest] = _unknown_name(plan)
            if tried[plan.digest] is None:
                break
        errors = [tried[plan.digest] for plan in sound if plan.digest in tried]
        errors = errors or [
            row.plan for row in having if isinstance(row.plan, BrachisError)
        ]
        if all(errors):
            refused[key] = (
                f"refused in every plan that sets it ({len(having)}); the first: {errors[0]}"
            )
    if refused:
        # One wrong key refuses the plans of all others.
        key = next(
            (each for each in refused if each in refused[each]), next(iter(refused))
        )
        raise TaskError(refused[key], where=f"{name}: {key}")


def _unknown_name(plan: Plan) -> BrachisError | None:
    """Return why the robot does not know a joint or frame that the plan names.

    What else robot and path refuse depends on values, of which others may be sound.
    """
    try:
        Problem.of(robot_of(plan), plan.task)
    except UnknownNameError as error:
        return error
    except BrachisError:
        return None
    return None


def robot_of(plan: Plan) -> Robot:
    """Make the robot of a plan; reads no file."""
    return robot_from_settings(plan.task.robot, urdf_text=plan.urdf)
