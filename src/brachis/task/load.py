"""Loading of a `Task` from a file or a mapping.

Dotted keys of a task look like ``spline.intervals`` and ``path.0.line.by``. Messages write the latter as
``path[0].line.by``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from brachis.common.files import (
    TASK_SUFFIXES,
    Kind,
    absolute_path,
    check_kind,
    is_task_file,
    locate_urdf,
    read_text,
)
from brachis.errors import InputError, NotInstalledError, TaskError, UrdfError
from brachis.task.fields import plain
from brachis.task.fitted import expand_csv_files
from brachis.task.limits_file import with_limits_of_file
from brachis.task.messages import show, validate
from brachis.task.models import Task
from brachis.task.scene import with_paths, with_scene_of_file
from brachis.task.settings import RobotSettings
from brachis.task.yaml_reader import read_yaml

_INDEX = re.compile(r"\[(\d+)\]")


def set_key(content: MutableMapping[str, Any], key: str, value: object) -> None:
    """Set a dotted key in the content of a task, in place.

    Mappings on the way to the key are created if they are absent or null. The key itself is checked by `load_task`,
    which lists the valid keys.

    Parameters
    ----------
    content : mutable mapping
        A task, not checked yet.
    key : str
        Names and, for lists, indices from 0, joined by dots.
    value : object
        The value, in the form of a task file.

    Raises
    ------
    TaskError
        The key goes through a value that has no keys, or past the end of a list.

    Examples
    --------
    >>> task = {"path": [{"line": {"by": [1.0, 0.0]}}]}
    >>> set_key(task, "path.0.line.by", [0.0, 1.0])
    >>> set_key(task, "spline.intervals", 40)
    >>> task
    {'path': [{'line': {'by': [0.0, 1.0]}}], 'spline': {'intervals': 40}}
    """
    names = _INDEX.sub(r".\1", key).split(".")
    if not all(names):
        raise TaskError(
            "this is not a valid key",
            found=repr(key),
            allowed="names and indices joined by dots, such as path.0.line.by",
        )
    place: Any = content
    for i, name in enumerate(names[:-1]):
        step = _step(place, name, names[:i], key)
        if isinstance(place, MutableMapping) and place.get(step) is None:
            place[step] = {}
        place = place[step]
    place[_step(place, names[-1], names[:-1], key)] = value


def _step(place: object, name: str, before: list[str], key: str) -> str | int:
    """Return the index into `place`: a name for a mapping, a number for a list."""
    if isinstance(place, MutableMapping):
        return name
    where = ".".join(before)
    if not isinstance(place, list):
        raise TaskError(
            f"{where} is a value without keys",
            where=key,
            found=show(place),
            hint=f"Set {where} itself",
        )
    if not name.isdecimal() or int(name) >= len(place):
        raise TaskError(
            f"{where} is a list of {len(place)}",
            where=key,
            found=f"{where}.{name}",
            allowed=f"0 to {len(place) - 1}" if place else "none: it is empty",
        )
    return int(name)


def read_assignment(text: str) -> tuple[str, object]:
    """Read ``key=value``, with the value in YAML.

    Raises
    ------
    TaskError
        The ``=`` is missing, or the value is not YAML.

    Examples
    --------
    >>> read_assignment("start.joints=[0.1, 0.2, 0.3]")
    ('start.joints', [0.1, 0.2, 0.3])
    """
    key, equals, value = text.partition("=")
    if not equals:
        raise TaskError(
            "this does not have the form key=value",
            found=repr(text),
            allowed="key=value, such as spline.intervals=40",
        )
    return key.strip(), read_yaml(value, f"value of {key.strip()}")


def with_keys(
    content: Mapping[str, Any], changes: Mapping[str, object]
) -> dict[str, Any]:
    """Return a copy of the unchecked content of a task with some dotted keys set."""
    changed: Any = plain(content)
    for key, value in changes.items():
        set_key(changed, key, value)
    return changed


Source = str | os.PathLike[str] | Mapping[str, object] | Task
"""The input from which a task is loaded: a task file, its content, or a task."""
LARGEST_TASK = 1_000_000
"""Maximum size of a task file, bytes. Reading YAML of this size takes about 20 s."""


def load_task(source: Source, *, changes: Mapping[str, object] | None = None) -> Task:
    """Return the task that a file or a mapping describes.

    Parameters
    ----------
    source : path-like, mapping or Task
        A YAML file, a mapping with the content of such a file (NumPy arrays are accepted as lists), or a task, which is
        returned unchanged unless there are changes.
    changes : mapping of str to object, optional
        Values by dotted key that replace those of `source`, such as ``{"spline.intervals": 40, "path.0.line.length":
        0.5}``.

    Returns
    -------
    Task
        The validated task. The path of the URDF is made absolute; it is relative to the folder of the file or, for a
        mapping, to the current folder. CSV files of waypoints and a limits file, relative to the same folder, are read.
        The task contains splines and limits instead, and no longer needs these files.

    Raises
    ------
    TaskError
        The file cannot be read or is not YAML, or the task is wrong. One message lists the mistakes, with a line for
        each of the first twenty: file, key, wrong value and allowed values. A wrong CSV file or limits file also raises
        this error; its message names the line or key.

    Examples
    --------
    >>> from brachis import load_task
    >>> task = load_task({
    ...     "brachis": 1,
    ...     "start": {"joints": [0.1, 0.2, 0.3]},
    ...     "task_space": ["x", "y"],
    ...     "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
    ...     "redundant_joints": ["joint_3"],
    ... })
    >>> task.spline.degree
    3
    """
    if isinstance(source, Task):
        return load_task(source.to_dict(), changes=changes) if changes else source
    if isinstance(source, Mapping):
        return task_from(source, "task", Path.cwd(), changes or {})
    if not isinstance(source, str | os.PathLike) or "\n" in str(source):
        raise TaskError(
            "a task cannot be loaded from this",
            found=show(source) if isinstance(source, str) else type(source).__name__,
            allowed="a file name, a mapping, or a Task; a URDF as text is for Robot.from_urdf(name, urdf_text=text)",
        )
    path = Path(source)
    check_kind(path, Kind.TASK, TaskError)
    hint = "Long lists of waypoints belong in a CSV file"
    text = read_text(
        path, where=str(path), folder=Path.cwd(), largest=LARGEST_TASK, hint=hint
    )
    try:
        content = read_yaml(text, str(path))
    except TaskError as error:
        if path.suffix.lower() in TASK_SUFFIXES:
            raise
        raise TaskError(
            "the file is not a task",
            where=str(path),
            found=str(error),
            allowed=f"a YAML file ({' or '.join(TASK_SUFFIXES)})",
            hint="Run brachis new to write a first task",
        ) from error
    task = task_from(content, str(path), path.absolute().parent, changes or {})
    if task.robot.urdf is None:
        raise TaskError(
            "this key is missing, but a task file needs it",
            where=f"{path}: robot.urdf",
            hint="Set it to the path of the URDF, relative to the task file",
        )
    return task


@contextmanager
def name_task_file(source: object, changes: Collection[str] = ()) -> Iterator[None]:
    """Add the name of the task file to later errors in its robot, path or postures.

    Errors in a URDF file, which name that file, and errors about a missing library stay unchanged.

    Parameters
    ----------
    source : object
        Source of the task. If this is not a task file, errors stay unchanged.
    changes : collection of str, optional
        Dotted keys that were set in the task.
    """
    try:
        yield
    except NotInstalledError:
        raise
    except InputError as error:
        if isinstance(error, UrdfError) and error.where != "robot.urdf":
            raise
        if isinstance(source, str | os.PathLike) and is_task_file(source):
            named = _name_source(str(Path(source)), changes)
            error.where = ": ".join(filter(None, (named, error.where)))
        raise


def _name_source(source: str, changes: Collection[str]) -> str:
    """Return the name of a task for messages, with the dotted keys that were set."""
    return f"{source} with {', '.join(changes)} set" if changes else source


def check_robot_settings(content: Mapping[str, object]) -> RobotSettings:
    """Return the ``robot`` section of a task, made from a mapping.

    Raises
    ------
    TaskError
        The mapping is wrong.
    """
    return validate(RobotSettings, content, "robot")


def task_from(
    content: object, source: str, folder: Path, changes: Mapping[str, object]
) -> Task:
    """Return the task with this content.

    Parameters
    ----------
    content : object
        Content in the form of a task file.
    source : str
        Name of the content in messages.
    folder : Path
        Folder to which file names in the content are relative.
    changes : mapping
        Dotted keys to set.

    Raises
    ------
    TaskError
        See `load_task`.
    """
    if not isinstance(content, Mapping):
        return validate(Task, content, source)  # which refuses the content
    if changes:
        content = with_keys(content, changes)
    source = _name_source(source, changes)
    try:
        content = with_limits_of_file(content, source, folder)
        content = with_scene_of_file(content, source, folder)
        task = validate(Task, content, source)
    except RecursionError:
        raise TaskError("the task contains itself", where=source) from None
    task = with_start(expand_csv_files(task, source, folder), source)
    return _with_absolute_files(task, folder)


def with_start(task: Task, source: str) -> Task:
    """Fill in the start of the path (for a joint path the start posture) from the first segment if it is missing.

    Raises
    ------
    TaskError
        Neither the task nor the segment states the start, and the start posture is free.
    """
    is_needed = task.start == "free" or task.begins_elsewhere
    if not is_needed or task.path_start is not None:
        return task
    place = task.start_place
    changes: dict[str, object] = {"path_start": place}
    if task.task_space == "joints" and place is not None:
        names = getattr(task.path[0].shape, "joints", None)
        posture = dict(zip(names, place, strict=True)) if names else place
        changes = {"start": {"joints": posture}}
    return validate(Task, task.model_copy(update=changes), source)


def _with_absolute_files(task: Task, folder: Path) -> Task:
    """Return the task in which the paths of URDF, SRDF and meshes, relative to `folder`, are absolute."""
    changes: dict[str, object] = {}
    if task.robot.urdf is not None:
        urdf = {"urdf": locate_urdf(task.robot.urdf, folder)}
        changes["robot"] = task.robot.model_copy(update=urdf)
    if task.scene:
        changes["scene"] = with_paths(task.scene, folder)
    if task.collisions.srdf is not None:
        srdf = {"srdf": absolute_path(task.collisions.srdf, folder)}
        changes["collisions"] = task.collisions.model_copy(update=srdf)
    return task.model_copy(update=changes)
