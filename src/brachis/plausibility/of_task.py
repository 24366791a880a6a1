"""What a task asks for: places, limits of the tool, points, end time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from brachis.plausibility.remark import Remark
from brachis.robot import TaskMap
from brachis.robot.task_map.rows import YAW
from brachis.task import Task
from brachis.task.tool_limits import SpeedTable

_TURN = 2.0 * math.pi
_FAR_POSTURE = 2.0 * _TURN
_TOOL = (
    ("speed", 50.0, "m/s", "mm/s"),
    ("acceleration", 300.0, "m/s^2", "mm/s^2"),
    ("angular_speed", 60.0, "rad/s", "degrees per second"),
)
"""Delta robots move at 10 m/s, and accelerate with 15 g."""
_OPEN = 1e5
"""A limit beyond this is written for "no limit"."""


def of_task(task: Task) -> tuple[Remark, ...]:
    """Look at the limits of the tool, and at the points that the path was fitted to."""
    return (*_tool(task), *_points(task))


def of_places(
    task_map: TaskMap,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | None,
) -> tuple[Remark, ...]:
    """Look at what a task says about where the robot is.

    Parameters
    ----------
    task_map : TaskMap
    start, end : (n,) ndarray or None
        Postures, None where free.
    path_start : sequence of float or None
        As in the task.
    """
    remarks, robot = [], task_map.robot
    for key, posture in (("start.joints", start), ("end.joints", end)):
        given = np.zeros(robot.n) if posture is None else posture
        for name, unit, value in zip(robot.joint_names, robot.position_units, given, strict=True):
            if unit == "rad" and abs(value) > _FAR_POSTURE:
                found = f"{value:.6g} rad"
                remarks.append(Remark(f"{key}.{name}", "the position looks like degrees", found, "within two turns"))
    if path_start is not None and YAW in task_map.rows and abs(path_start[-1]) > _TURN:
        found = f"{path_start[-1]:.6g} rad"
        remarks.append(Remark("path_start", "yaw looks like degrees", found, "within one turn"))
    return tuple(remarks)


def of_end_time(t_end: float, least: float) -> tuple[Remark, ...]:
    """Look at a motion's end time, s, beside the `least` that the planner allows, s."""
    if t_end > 1.01 * least:
        return ()
    message = "the end time is the least that the planner knows, so that no limit holds the motion back"
    return (Remark("t_end", message, f"{t_end:.6g} s", "more; see the units of limits, lengths and masses"),)


def _tool(task: Task) -> Iterator[Remark]:
    """Look at the largest of every kind of limit; feed rates have units of their own."""
    limits = task.tool_limits
    speed = limits.speed.speed if isinstance(limits.speed, SpeedTable) else [limits.speed]
    given = {
        "speed": [*speed, *(part.speed for part in limits.process_speed)],
        "acceleration": [limits.acceleration],
        "angular_speed": [limits.angular_speed],
    }
    for kind, most, unit, meant in _TOOL:
        largest = max((value for value in given[kind] if value is not None and value < _OPEN), default=0.0)
        if largest > most:
            key = kind if kind != "speed" or largest in speed else "process_speed"
            usual = f"below {most:g} {unit}, or null for no limit"
            yield Remark(f"tool_limits.{key}", f"the limit looks like {meant}", f"{largest:.6g} {unit}", usual)


def _points(task: Task) -> Iterator[Remark]:
    for fit in task.fits:
        if fit.doubt:
            yield Remark(f"path: {fit.source}", fit.doubt, f"{fit.length:.4g} m", "a path within the robot's reach")
