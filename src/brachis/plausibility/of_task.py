"""What a task asks for: places, limits of the tool, points, end time."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.plausibility.figure import Figure, remarks
from brachis.plausibility.remark import Remark
from brachis.robot import TaskMap
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.rows import YAW
from brachis.task import Task, ToolPose
from brachis.task.tool_limits import SpeedTable

if TYPE_CHECKING:
    from brachis.path import Path

_TURN = 2.0 * math.pi
_WINDING = 5.0
"""Turns of a joint without a range that a path of joints may ask for: in degrees, 30 are nearly as many."""
_ROUNDED = 1e-3
_STATIONS = 401
_EIGHTHS, _ROUNDING = 16, 2e-3
"""Angles in rad up to two turns are looked for, within so many rad: 3.14 is half a turn, 5.5 is not seven eighths."""
_OPEN = 1e5
"""A limit beyond this is written for "no limit"."""


def of_task(task: Task) -> tuple[Remark, ...]:
    """Look at speeds and accelerations of the tool, and at the points that the path was fitted to."""
    return (*remarks(_tool(task)), *_angles(task), *_points(task))


def of_places(
    task_map: TaskMap,
    path: Path,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | ToolPose | None,
) -> tuple[Remark, ...]:
    """Look at what a task says about where the robot is, in postures or along a path of joints.

    Parameters
    ----------
    task_map : TaskMap
    path : Path
    start, end : (n,) ndarray or None
        Postures, None where free.
    path_start : sequence of float, ToolPose or None
        As in the task.
    """
    return tuple(remarks(_places(task_map, path, start, end, path_start)))


def _places(
    task_map: TaskMap,
    path: Path,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | ToolPose | None,
) -> Iterator[Figure]:
    robot = task_map.robot
    along = path.sample(np.linspace(0.0, 1.0, _STATIONS)).target if isinstance(task_map, JointSpace) else None
    ranged = np.isfinite(robot.limits.position_lower) & np.isfinite(robot.limits.position_upper)
    for key, postures in (("start.joints", start), ("path", along), ("end.joints", end)):
        if postures is None:
            continue
        columns = zip(robot.joint_names, robot.revolute, postures.reshape(-1, robot.n).T, ranged, strict=True)
        for name, turns, values, within in columns:
            if turns:
                most = 2.0 if within else (1.0 if along is None else _WINDING)
                usual, value = most * _TURN, float(values[np.argmax(np.abs(values))])
                looks, shown = "the position looks like degrees", f"{value:.6g}"
                aside = f"; {shown} degrees are {math.radians(value):.6g} rad"
                yield Figure(f"{key}.{name}", looks, abs(value), usual + _ROUNDED, "rad", aside, shown)
    if YAW in task_map.rows:
        yaw = path.sample(np.linspace(0.0, 1.0, _STATIONS)).target[:, -1]
        begins = abs(path_start[-1]) if isinstance(path_start, tuple) else 0.0
        yield Figure("path_start", "yaw looks like degrees", begins, _TURN, "rad")
        yield Figure("path", "the turn of yaw looks like degrees", float(np.ptp(yaw)), 2.0 * _TURN, "rad")


def of_end_time(t_end: float, least: float) -> tuple[Remark, ...]:
    """Look at a motion's end time, s, beside the `least` that the planner allows, s."""
    if t_end > 1.01 * least:
        return ()
    message = "the end time is the least that the planner knows, so that no limit holds the motion back"
    return (Remark("t_end", message, f"{t_end:.6g} s", "more; see the units of limits, lengths and masses"),)


def _tool(task: Task) -> Iterator[Figure]:
    """Look at the largest of every kind of limit; feed rates have units of their own."""
    limits, ends = task.tool_limits, task.boundary
    meant_at_ends = "degrees per second" if task.task_space == "joints" else "mm/s"
    speeds = limits.speed.speed if isinstance(limits.speed, SpeedTable) else [limits.speed]
    processes = [part.speed for part in limits.process_speed]
    # Delta robots move at 10 m/s, and accelerate with 15 g.
    for where, values, most, unit, meant in (
        ("tool_limits.speed", speeds, 50.0, "m/s", "mm/s"),
        ("tool_limits.process_speed", processes, 50.0, "m/s", "mm/s"),
        ("tool_limits.acceleration", [limits.acceleration], 300.0, "m/s^2", "mm/s^2"),
        ("tool_limits.angular_speed", [limits.angular_speed], 60.0, "rad/s", "degrees per second"),
        ("boundary.start_speed", [ends.start_speed], 50.0, task.speed_unit, meant_at_ends),
        ("boundary.end_speed", [ends.end_speed], 50.0, task.speed_unit, meant_at_ends),
    ):
        largest = max((value for value in values if value is not None and value < _OPEN), default=0.0)
        limit = where.startswith("tool_limits")
        what, aside = ("limit", ", or null for no limit") if limit else ("speed", "")
        yield Figure(where, f"the {what} looks like {meant}", largest, most, unit, aside)


def _angles(task: Task) -> Iterator[Remark]:
    """Look for eighths of a turn in rad where degrees belong."""
    robot = {key: getattr(task.robot, key).model_dump() for key in ("mounting", "tool_offset")}
    path = [segment.model_dump(exclude={"bspline", "spline"}) for segment in task.path]
    for key, degrees in _in_degrees("", {"robot": robot, "path": path}):
        eighths = round(degrees / (0.125 * _TURN))
        if 1 <= abs(eighths) <= _EIGHTHS and abs(degrees - 0.125 * _TURN * eighths) < _ROUNDING:
            usual = f"{math.degrees(degrees):.4g} deg for that angle"
            yield Remark(key, "the angle looks like rad", f"{degrees:.6g} deg", usual)


def _in_degrees(key: str, content: object) -> Iterator[tuple[str, float]]:
    """Yield all numbers below keys that end in ``_deg``, with their dotted keys."""
    if isinstance(content, Mapping):
        for name, value in content.items():
            yield from _in_degrees(f"{key}.{name}" if key else name, value)
    elif isinstance(content, list | tuple):
        for number, value in enumerate(content):
            yield from _in_degrees(f"{key}[{number}]", value)
    elif isinstance(content, float) and re.search(r"_deg(\[\d\])?$", key):
        yield key, content


def _points(task: Task) -> Iterator[Remark]:
    for fit in task.fits:
        if fit.doubt:
            yield Remark(f"path: {fit.source}", fit.doubt, f"{fit.length:.4g} m", "a path within the robot's reach")
