"""What a command takes: a motion or its folder, a task file with what ``--set`` changes, a URDF, names of robots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from brachis import robots
from brachis.common.files import is_file, is_folder
from brachis.errors import ResultFileError, TaskError, UnknownNameError
from brachis.robot.task_map.protocol import AXES, YAW
from brachis.task import Task, load_task, read_assignment

_MOTIONS = ("result.npz", "unverified.npz")
"""What ``brachis plan --out`` calls a motion in its folder."""


def motion_file(result: Path) -> Path:
    """Return the file of a motion: the one named, or the one in the folder named.

    Raises
    ------
    ResultFileError
        There is none in the folder.
    """
    if not is_folder(result):
        return result
    for name in _MOTIONS:
        if is_file(result / name):
            return result / name
    problem, hint = "is a folder in which there is no motion", "Run brachis plan --out"
    raise ResultFileError(
        problem, where=str(result), allowed=" or ".join(_MOTIONS), hint=hint
    )


def task_space_of(text: str) -> str | list[str]:
    """Read a word or a list of rows, as ``--task-space`` has them."""
    rows = [row.strip() for row in text.split(",") if row.strip()]
    return rows[0] if len(rows) == 1 and rows[0] not in (*AXES, YAW) else rows


def changed_task(
    path: Path, changes: Sequence[str] | None, *, strict: bool | None = None
) -> Task:
    """Load a task file, with keys set as ``spline.intervals=40``, and ``strict`` where it is given.

    Of a key that is set twice the last value counts.
    """
    if robots.is_robot(str(path)) and path.suffix == "":
        name = robots.path_of(str(path)).parent.name
        hint = f"brachis new {name} writes a first task for it"
        raise TaskError("is a robot", where=name, allowed="a task file", hint=hint)
    keys = dict(read_assignment(text) for text in changes or ())
    if strict is not None:
        keys["strict"] = strict
    return load_task(path, changes=keys)


def urdf_of(given: Path) -> Path:
    """Return the URDF file, where a name is given that of the robot that comes with brachis.

    Raises
    ------
    UnknownNameError
        It is neither a file nor such a name.
    """
    if is_file(given) or is_folder(given) or given.suffix or len(given.parts) > 1:
        return given
    if str(given) not in robots.names():
        raise UnknownNameError("URDF file, and no robot,", str(given), robots.names())
    return robots.path_of(str(given))
