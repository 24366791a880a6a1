"""The path of a task: from where the start posture's tool is, or from the place that the task names."""

from __future__ import annotations

import numpy as np

from brachis.errors import StartError, write_apart
from brachis.path.build import build_path
from brachis.path.frame import PathFrame
from brachis.path.protocol import Path
from brachis.plausibility import place_hint, turn_hint
from brachis.robot import TaskMap
from brachis.task import Task

_ON_PATH = 1e-6


def path_of(task_map: TaskMap, task: Task) -> Path:
    """Build the path of a task.

    Parameters
    ----------
    task_map : TaskMap
    task : Task

    Returns
    -------
    Path

    Raises
    ------
    StartError
        The start posture's tool is not at the task's ``path_start``.
    PathError, UnknownNameError, InputError
        See `build_path`; or ``path_start`` does not fit the task space.
    """
    placement = task.path_placement
    frame = None if placement is None else PathFrame.of(placement, task_map.rows)
    given = None if task.path_start is None else task_map.read(task.path_start, "path_start")
    if given is not None and frame is not None:
        given = frame.to_world(given)
    if task.start == "free":
        assert given is not None  # noqa: S101  (the task model sees to it)
        return build_path(task.path, given, task_map.rows, frame)
    start = task_map.robot.posture(task.start.joints, "start.joints")
    if given is not None:
        check_on_path(task_map, start, given, "start")
    return build_path(task.path, task_map.value(start), task_map.rows, frame)


def check_on_path(task_map: TaskMap, posture: np.ndarray, target: np.ndarray, name: str) -> None:
    """Refuse a posture, (n,), whose tool is not at the path's beginning or end, `target`, (c,).

    Raises
    ------
    StartError
    """
    place = task_map.value(posture)
    miss = np.abs(task_map.difference(place, target))
    worst = int(np.argmax(miss))
    if miss[worst] > _ON_PATH:
        found, allowed = write_apart(miss[worst], _ON_PATH, digits=3)
        raise StartError(
            f"the {name} posture is off the path",
            where=f"{name}.joints",
            found=f"{found} {task_map.units[worst]} off in {task_map.rows[worst]}",
            allowed=f"at most {allowed} {task_map.units[worst]}",
            hint=_hint(task_map, place, target)
            or f"Choose a posture whose tool is at the path's {'beginning' if name == 'start' else 'end'}",
        )


def _hint(task_map: TaskMap, place: np.ndarray, target: np.ndarray) -> str | None:
    """Say what stated coordinates, (c,), that are not the tool's, (c,), look like."""
    axes = len(task_map.axes)
    found = place_hint(place[:axes], target[:axes], task_map.rows)
    if found is None and len(target) == axes + 9:
        return turn_hint(place[axes:].reshape(3, 3), target[axes:].reshape(3, 3))
    return found
