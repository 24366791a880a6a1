"""What a command takes: a motion or its folder, a task file with what ``--set`` changes, a URDF or a robot's name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import brachis
from brachis.common.files import is_file, is_folder
from brachis.errors import ResultFileError, TaskError, UnknownNameError

if TYPE_CHECKING:
    from brachis.task import Task

_MOTIONS = ("result.npz", "unverified.npz")
"""Names of a motion in the folder of ``brachis plan --out``."""


def motion_file(result: Path) -> Path:
    """Return the file of a motion: the one named, or the one in the folder named.

    Raises
    ------
    ResultFileError
        The folder holds no motion.
    """
    if not is_folder(result):
        return result
    for name in _MOTIONS:
        if is_file(result / name):
            return result / name
    raise ResultFileError(
        "is a folder without a motion",
        where=str(result),
        allowed=" or ".join(_MOTIONS),
        hint="Run brachis plan --out",
    )


def task_space_of(text: str | None) -> str | list[str] | None:
    """Read ``--task-space``: a word, or a list of rows."""
    from brachis.robot.task_map.protocol import AXES, YAW

    if text is None:
        return None
    rows = [row.strip() for row in text.split(",") if row.strip()]
    return rows[0] if len(rows) == 1 and rows[0] not in (*AXES, YAW) else rows


def changed_task(
    path: Path, changes: Sequence[str] | None, *, strict: bool | None = None
) -> Task:
    """Load a task file with keys set as in ``spline.intervals=40``, and with ``strict`` if it is given.

    If a key is set twice, the last value counts.
    """
    from brachis.task import read_assignment

    robots = brachis.robots
    if robots.is_robot(str(path)) and path.suffix == "":
        name = robots.path_of(str(path)).parent.name
        raise TaskError(
            "is a robot",
            where=name,
            allowed="a task file",
            hint=f"brachis new {name} writes a first task for it",
        )
    keys = dict(read_assignment(text) for text in changes or ())
    if strict is not None:
        keys["strict"] = strict
    return brachis.load_task(path, changes=keys)


def urdf_of(given: Path) -> Path:
    """Return the URDF file; of a robot that comes with brachis, given by its name, its file.

    Raises
    ------
    UnknownNameError
        There is neither a file nor a robot of this name.
    """
    if is_file(given) or is_folder(given) or given.suffix or len(given.parts) > 1:
        return given
    robots = brachis.robots
    if str(given) not in robots.names():
        raise UnknownNameError("URDF file or robot", str(given), robots.names())
    return robots.path_of(str(given))
