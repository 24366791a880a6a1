"""What a command takes: a task file with the keys that ``--set`` changes, a URDF or the name of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from brachis import robots
from brachis.errors import UnknownNameError
from brachis.task import Task, load_task, read_assignment


def changed_task(path: Path, changes: Sequence[str]) -> Task:
    """Load a task file, with keys set as ``spline.intervals=40``; of a key that is set twice the last value counts.

    Raises
    ------
    TaskError
        See `load_task` and `read_assignment`.
    """
    return load_task(path, changes=dict(read_assignment(text) for text in changes))


def urdf_of(given: Path) -> Path:
    """Return the URDF file, where a name is given that of the robot that comes with brachis.

    Raises
    ------
    UnknownNameError
        It is neither a file nor such a name.
    """
    if given.exists() or given.suffix or len(given.parts) > 1:
        return given
    if str(given) not in robots.names():
        raise UnknownNameError("URDF file, and no robot,", str(given), robots.names())
    return robots.path_of(str(given))
