"""The path of a task: from where the start posture's tool is, or from the place that the task names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from brachis.errors import InputError, StartError
from brachis.path.build import build_path
from brachis.path.protocol import Path
from brachis.plausibility import place_hint
from brachis.robot import Robot, TaskSpace
from brachis.robot.task_space import AXES
from brachis.task import Task

_ON_PATH = 1e-6
_UNIT = 1e-2


def path_of(robot: Robot, task_space: TaskSpace, task: Task) -> Path:
    """Build the path of a task.

    Parameters
    ----------
    robot : Robot
    task_space : TaskSpace
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
    given = None if task.path_start is None else _coordinates(task_space, task.path_start)
    if task.start == "free":
        assert given is not None  # noqa: S101  (the task model sees to it)
        return build_path(task.path, given, task_space.rows)
    start = robot.posture(task.start.joints, "start.joints")
    if given is not None:
        check_on_path(robot, task_space, start, given, "start")
    return build_path(task.path, task_space.value(robot.tool_placement(start)), task_space.rows)


def check_on_path(robot: Robot, task_space: TaskSpace, posture: np.ndarray, target: np.ndarray, name: str) -> None:
    """Refuse a posture, (n,), whose tool is not at the path's beginning or end, `target`, (c,).

    Raises
    ------
    StartError
    """
    place = task_space.value(robot.tool_placement(posture))
    miss = np.abs(task_space.difference(place, target))
    worst = int(np.argmax(miss))
    if miss[worst] > _ON_PATH:
        raise StartError(
            f"the {name} posture is off the path",
            where=f"{name}.joints",
            found=f"{miss[worst]:.3g} {task_space.units[worst]} off in {task_space.rows[worst]}",
            allowed=f"at most {_ON_PATH:g} {task_space.units[worst]}",
            hint=place_hint(task_space, place, target)
            or f"Choose a posture whose tool is at the path's {'beginning' if name == 'start' else 'end'}",
        )


def _coordinates(task_space: TaskSpace, given: Sequence[float]) -> np.ndarray:
    """Task coordinates, (c,), of what the task says; a pose is given as a position and a quaternion."""
    rows = (*AXES, "qw", "qx", "qy", "qz") if task_space.oriented else task_space.rows
    if len(given) != len(rows):
        raise InputError(
            "has the wrong number of coordinates",
            where="path_start",
            found=len(given),
            allowed=f"{len(rows)}: {', '.join(rows)}",
        )
    values = np.array(given, dtype=float)
    if not task_space.oriented:
        return values
    size = float(np.linalg.norm(values[3:]))
    if abs(size - 1.0) > _UNIT:
        raise InputError("has no unit quaternion", where="path_start", found=f"a norm of {size:.6g}", allowed="1")
    w, x, y, z = values[3:] / size
    return task_space.value(pin.SE3(pin.Quaternion(w, x, y, z).matrix(), values[:3]))
