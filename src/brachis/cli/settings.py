"""The task that a command takes: its file, with the keys that ``--set`` changes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from brachis.task import Task, load_task, read_assignment


def changed_task(path: Path, changes: Sequence[str]) -> Task:
    """Load a task file, with keys set as ``spline.intervals=40``; of a key that is set twice the last value counts.

    Raises
    ------
    TaskError
        See `load_task` and `read_assignment`.
    """
    return load_task(path, changes=dict(read_assignment(text) for text in changes))
