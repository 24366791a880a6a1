"""The legs of a path: parts between stops, each at a given speed or as fast as the limits allow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from brachis.common import tolerances
from brachis.errors import PathError
from brachis.path.sequence import Path, path_speed, tool_derivatives
from brachis.robot import TaskMap, task_map_of
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import AXES
from brachis.task import ProcessSpeed, Task, ToolLimits
from brachis.task.messages import validate

_KEY = "tool_limits.process_speed"
_LEAD = 0.1
"""Lengths in which the tool reaches or leaves a speed, per change of speed, s."""


@dataclass(frozen=True)
class Leg:
    """A part of the path that is passed in one go.

    Attributes
    ----------
    begin, end : float
        Path coordinates.
    speed : float or None
        Given speed of the tool, m/s; None: as fast as the limits allow.
    stops : bool
        Whether the arm is at rest at its end; only at ends inside the path.
    dwell : float
        Time for which the arm waits at its end, s.
    """

    begin: float
    end: float
    speed: float | None = None
    stops: bool = False
    dwell: float = 0.0


def legs_of(task: Task, task_map: TaskMap, path: Path) -> tuple[Leg, ...]:
    """Return the legs of a task's path, in order, without gaps from s = 0 to 1.

    Raises
    ------
    PathError
        A process speed does not fit the task space, a stop, or the speeds at the path's ends; or the tool stands still
        where it is to have one.
    """
    parts = task.tool_limits.process_speed
    if parts:
        _check_task_space(task_map)
        _check_seam(task)
    for number, part in enumerate(parts):
        _check_stops(path, part, number)
        _check_motion(task_map, path, part, number)
        _check_ends(task, task_map, path, number)
    waits = [segment.dwell for segment in task.path if segment.stop]
    dwells = dict(zip(path.stops.tolist(), waits, strict=True))
    ends = sorted({0.0, 1.0, *dwells, *(s for part in parts for s in part.s)})
    speeds = {part.s: part.speed for part in parts}
    return tuple(
        Leg(begin, end, speeds.get((begin, end)), end in dwells, dwells.get(end, 0.0))
        for begin, end in pairwise(ends)
    )


def key_of_speed(part: ProcessSpeed, number: int, below: str) -> str:
    """Name the key of a process speed for messages: that of its segment, or one `below` its number in the list."""
    if part.segment is not None:
        return f"path[{part.segment}].speed"
    return f"{_KEY}[{number}]{below}"


def with_segment_speeds(task: Task, task_map: TaskMap, path: Path) -> Task:
    """Return the task with the speeds of its segments among its process speeds.

    Segments of the same speed are one part, with the blends between them. Where the tool has another speed, at stops, at
    the path's ends and at such segments, the part leaves a lead for the speed to change: `_LEAD` times the change.

    Raises
    ------
    PathError
        A segment is too short to reach its speed.
    TaskError
        Its part overlaps another one of the task, or its speed is above the tool's largest one.
    """
    parts = [part for part in task.tool_limits.process_speed if part.segment is None]
    runs = _runs_of(task, path)
    if not any(run.speed for run in runs):
        return task
    speed_before: float | None = None
    for run in runs:
        begin, end, speed, segment = run.begin, run.end, run.speed, run.segment
        if begin in path.stops:
            speed_before = 0.0
        elif begin == 0.0:
            speed_before = _boundary_speed(task, task_map, path, 0)[0]
        speed_after = None
        if end in path.stops:
            speed_after = 0.0
        elif end == 1.0:
            speed_after = _boundary_speed(task, task_map, path, 1)[0]
        if speed is not None:
            leads = [
                _lead(speed, other) / _tool_slope(task_map, path.between(begin, end), s)
                for s, other in ((begin, speed_before), (end, speed_after))
            ]
            if sum(leads) >= end - begin:
                share = (end - begin) / sum(leads)
                raise PathError(
                    "the segment is too short to reach its speed and to leave it",
                    s_interval=(begin, end),
                    where=f"path[{segment}].speed",
                    found=f"{speed:g} m/s",
                    allowed=f"less than {share * speed:.3g} m/s, or a segment that is {1.0 / share:.3g} times as long",
                )
            s = (begin + leads[0], end - leads[1])
            parts.append(ProcessSpeed(speed=speed, s=s, segment=segment))
        speed_before = speed
    parts.sort(key=lambda part: part.s)
    limits = task.tool_limits.model_copy(update={"process_speed": tuple(parts)})
    checked = validate(ToolLimits, limits, "tool_limits")
    return task.model_copy(update={"tool_limits": checked})


@dataclass(frozen=True)
class _Run:
    """Pieces of the path with one speed, m/s, or none, from s = `begin` to `end`; `segment` is the first one."""

    begin: float
    end: float
    speed: float | None
    segment: int


def _runs_of(task: Task, path: Path) -> list[_Run]:
    """Cut the path where the speeds of segments change, and at stops; a blend has the speed that both sides have."""
    speeds = [getattr(segment, "speed", None) for segment in task.path]
    runs: list[_Run] = []
    segment = 0
    for (begin, end), piece in zip(pairwise(path.breaks.tolist()), path.pieces, strict=True):
        if piece.segment is None:
            is_same = speeds[segment] == speeds[segment + 1]
            run = _Run(begin, end, speeds[segment] if is_same else None, segment)
            segment += 1
        else:
            segment = piece.segment
            run = _Run(begin, end, speeds[segment], segment)
        if runs and runs[-1].speed == run.speed and begin not in path.stops:
            run = replace(runs.pop(), end=end)
        runs.append(run)
    return runs


def _lead(speed: float, other: float | None) -> float:
    """Length in which the tool gets from one speed to another one, m; 0 where that is free, or the same one."""
    if other is None or abs(speed - other) <= tolerances.WRITTEN * speed:
        return 0.0
    return _LEAD * abs(speed - other)


def _tool_slope(task_map: TaskMap, path: Path, s: float) -> float:
    """How far the tool moves per unit s, m, and no less than nothing but for rounding."""
    velocity = tool_derivatives(task_map, path, np.array([s]))[0, 0]
    return max(float(np.linalg.norm(velocity)), tolerances.LENGTH)


def _boundary_speed(
    task: Task, task_map: TaskMap, path: Path, end: int
) -> tuple[float | None, float]:
    """Return the tool's speed at an end of the path, m/s (None where the motion is periodic), and its share of that of the path."""
    boundary = task.boundary
    ratio = _tool_slope(task_map, path, end) / path_speed(task_map, path, end)
    if boundary.periodic:
        return None, ratio
    return ratio * (boundary.end_speed if end else boundary.start_speed), ratio


def _check_task_space(task_map: TaskMap) -> None:
    """Refuse a task space that leaves the tool free to move otherwise than along the path."""
    if isinstance(task_map, JointSpace):
        return
    position = task_map_of(task_map.robot, "position")
    jacobians = position.sample_jacobians()
    moves = np.abs(jacobians).max(axis=(0, 2)) > tolerances.COORDINATE
    free = [axis for i, axis in enumerate(AXES) if moves[i] and i not in task_map.axes]
    if free:
        raise PathError(
            "a process speed needs a path that prescribes the whole position of the tool",
            where=_KEY,
            found=f"task_space [{', '.join(task_map.rows)}], which leaves {' and '.join(free)} free",
            allowed="a task space with all coordinates of the position in which the tool can move",
            hint="Set task_space: position, or tool_limits.speed instead",
        )


def _check_seam(task: Task) -> None:
    """Refuse two process speeds where a periodic motion begins anew."""
    first = task.tool_limits.process_speed[0]
    last = task.tool_limits.process_speed[-1]
    meets = first.s[0] == 0.0 and last.s[1] == 1.0
    if task.boundary.periodic and meets and first.speed != last.speed:
        number = len(task.tool_limits.process_speed) - 1
        raise PathError(
            "the process speed changes at once where the periodic motion begins anew",
            where=key_of_speed(last, number, ".speed"),
            found=f"{last.speed:g} m/s, then {first.speed:g} m/s",
            allowed="one speed, or a gap in which the speed changes",
        )


def _check_stops(path: Path, part: ProcessSpeed, number: int) -> None:
    """Refuse a part with a stop in it or at its ends."""
    begin, end = part.s
    near = tolerances.PATH
    inside = path.stops[(path.stops > begin - near) & (path.stops < end + near)]
    if not len(inside):
        return
    stop = float(inside[0])
    raise PathError(
        "the tool has a process speed where it stops",
        s_interval=(stop, stop),
        where=f"{_KEY}[{number}].s",
        found=f"[{begin:g}, {end:g}], with a stop at s = {stop:.6g}",
        allowed="parts of the path between stops, with room to reach and leave the speed",
        hint=f"Leave room before and behind s = {stop:.6g}, such as {_lead(part.speed, 0.0):.3g} m: cut the part in two, "
        "or remove the stop",
    )


def _check_motion(
    task_map: TaskMap, path: Path, part: ProcessSpeed, number: int
) -> None:
    """Refuse a part in which the tool stands still."""
    s = np.linspace(*part.s, 401)
    velocity = tool_derivatives(task_map, path.between(*part.s), s)[0]
    speeds = np.linalg.norm(velocity, axis=1)
    worst = np.argmin(speeds)
    if speeds[worst] <= tolerances.LENGTH:
        raise PathError(
            "the tool has a process speed where its position stands still",
            s_interval=(float(s[worst]), float(s[worst])),
            where=key_of_speed(part, number, ".s"),
            found=f"no motion of the position at s = {s[worst]:.4g}",
            allowed="a part of the path along which the position moves",
        )


def _check_ends(task: Task, task_map: TaskMap, path: Path, number: int) -> None:
    """Refuse a part that begins or ends with the path, unless the path has its speed there."""
    part = task.tool_limits.process_speed[number]
    for end, name in enumerate(("start", "end")):
        if part.s[end] != end:
            continue
        found, ratio = _boundary_speed(task, task_map, path, end)
        lead = _lead(part.speed, found)
        if found is None or not lead:
            continue
        raise PathError(
            f"process speed at s = {end} is {part.speed:g} m/s, but that at the path's {name} is {found:g} m/s",
            where=f"{_KEY}[{number}].s[{end}]",
            found=f"{found:g} m/s, by boundary.{name}_speed",
            allowed=f"{part.speed:g} m/s at the path's {name}, or an s inside the path",
            hint=f"Set boundary.{name}_speed to {part.speed / ratio:.10g}, or leave room on the path to "
            f"change the speed, such as {lead:.3g} m",
        )
