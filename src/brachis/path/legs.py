"""The legs of a path: parts between stops, each travelled at a given speed or as fast as the limits allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import cut
from brachis.errors import PathError
from brachis.path.protocol import Array
from brachis.path.sequence import Path, path_speed, tool_derivatives
from brachis.robot import TaskMap, task_map_of
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import AXES
from brachis.task import FREE, ProcessSpeed, Task, ToolLimits
from brachis.task.messages import validate

_KEY = "tool_limits.process_speed"
_LEAD = 0.1
"""Distance over which the tool reaches or leaves a speed, divided by that speed, s.

With 0.05, the included SCARA does not reach 0.3 m/s. With 0.1, five included arms reach 0.02 and 0.3 m/s.
"""


@dataclass(frozen=True)
class Leg:
    """A part of the path along which the tool does not stop.

    Attributes
    ----------
    begin, end : float
        Path coordinates at which the leg begins and ends.
    speed : float or None
        Given speed of the tool, m/s. With None, the leg is travelled as fast as the limits allow.
    stops : bool
        Whether the arm stops at the end of the leg; only for ends inside the path.
    dwell : float
        Time for which the arm waits at the end of the leg, s.
    """

    begin: float
    end: float
    speed: float | None = None
    stops: bool = False
    dwell: float = 0.0


def legs_of(task: Task, task_map: TaskMap, path: Path) -> tuple[Leg, ...]:
    """Return the legs of a task's path, in order and without gaps, from s = 0 to 1.

    Raises
    ------
    PathError
        A process speed does not fit the task space, or the tool stands still where it should have a process speed.
    """
    sections = task.tool_limits.process_speed
    if sections:
        _check_task_space(task_map)
    for number, section in enumerate(sections):
        _check_motion(task_map, path, section, number)
    dwells = path.dwells
    ends = sorted({0.0, 1.0, *dwells, *(s for section in sections for s in section.s)})
    speeds = {section.s: section.speed for section in sections}
    return tuple(
        Leg(begin, end, speeds.get((begin, end)), end in dwells, dwells.get(end, 0.0))
        for begin, end in pairwise(ends)
    )


def key_of_speed(section: ProcessSpeed, number: int, below: str) -> str:
    """Return the key of a process speed for messages: the key of its segment, or one `below` its index in the list."""
    if section.segment is not None:
        return f"path[{section.segment}].speed"
    return f"{_KEY}[{number}]{below}"


def with_held_speeds(task: Task, task_map: TaskMap, path: Path) -> Task:
    """Return the task with all process speeds, including those of segments, restricted to where the tool can hold them.

    Adjacent segments with the same speed form one part, with the blends between them. Parts are cut at stops. The speed
    changes in leads. There is a lead at every stop, at an end of the path that is not passed at the part's speed, and
    where one part directly follows another. Leads take up at most half of a part. In a lead, the tool does not exceed
    the speed of the part, unless it comes from, or continues at, a higher speed.

    Raises
    ------
    TaskError
        Parts overlap, or a speed exceeds the maximum speed of the tool.
    """
    limits = task.tool_limits
    sections = [section for section in limits.process_speed if section.segment is None]
    if task.path:
        sections += _parts_of_segments(task, path)
    if not sections:
        return task
    after = dict.fromkeys(path.stops.tolist(), 0.0)
    for end, speed in enumerate(task.boundary.speeds):
        # Where the speed is free, the tool may pass at the speed of the section.
        if not (task.boundary.periodic or speed == FREE):
            after[float(end)] = _speed_at_end(task, task_map, path, end)
    before = {section.s[1]: section.speed for section in sections} | after
    if task.boundary.periodic and 1.0 in before:
        before[0.0] = before[1.0]
    held = []
    for section in sections:
        speed = section.speed
        first, last = (_snap(s, path.stops) for s in section.s)
        for ends in pairwise(cut(path.stops, first, last).tolist()):
            between = path.between(*ends)
            lengths = [
                _lead(speed, speeds.get(s, speed))
                for s, speeds in zip(ends, (before, after), strict=True)
            ]
            leads = np.divide(
                lengths, [_tool_slope(task_map, between, s) for s in ends]
            ).tolist()
            # The planner finds out whether a shorter lead is enough.
            share = min(
                1.0, 0.5 * (ends[1] - ends[0]) / max(sum(leads), tolerances.PATH)
            )
            s = (ends[0] + share * leads[0], ends[1] - share * leads[1])
            changes: dict[str, object] = {"s": s, "lead_length": share * sum(lengths)}
            if any(leads):
                changes["within"] = (
                    ends[0] if before.get(ends[0], 0.0) <= speed else s[0],
                    ends[1] if after.get(ends[1], 0.0) <= speed else s[1],
                )
            held.append(section.model_copy(update=changes))
    held.sort(key=lambda section: section.s)
    changed = limits.model_copy(update={"process_speed": tuple(held)})
    checked = validate(ToolLimits, changed, "tool_limits")
    return task.model_copy(update={"tool_limits": checked})


def _parts_of_segments(task: Task, path: Path) -> list[ProcessSpeed]:
    """List the parts of the path that have a speed.

    A blend has a speed if the segments on both sides have the same one.
    """
    speeds = [getattr(segment, "speed", None) for segment in task.path]
    sections: list[ProcessSpeed] = []
    bounds = pairwise(path.breaks.tolist())
    for (begin, end), span in zip(bounds, path.spans, strict=True):
        segment = span.segments[0]
        speed = speeds[segment]
        if speed is None or speed != speeds[span.segments[-1]]:
            continue
        first = begin
        if sections and (sections[-1].s[1], sections[-1].speed) == (begin, speed):
            first = sections.pop().s[0]
        sections.append(ProcessSpeed(speed=speed, s=(first, end), segment=segment))
    return sections


def _snap(s: float, stops: Array) -> float:
    """Return the stop at a path coordinate, to within the precision of a file; if there is none, the coordinate."""
    near = stops[np.abs(stops - s) <= tolerances.WRITTEN]
    return float(near[0]) if len(near) else s


def _lead(speed: float, next_speed: float) -> float:
    """Return the distance over which the tool changes from one speed to another, m."""
    if abs(speed - next_speed) <= tolerances.WRITTEN * speed:
        return 0.0
    return _LEAD * max(speed, next_speed)


def _tool_slope(task_map: TaskMap, path: Path, s: float) -> float:
    """Return how far the tool moves per unit s, m, but at least the length that counts as zero."""
    velocity = tool_derivatives(task_map, path, np.array([s]))[0, 0]
    return max(float(np.linalg.norm(velocity)), tolerances.LENGTH)


def _speed_at_end(task: Task, task_map: TaskMap, path: Path, end: int) -> float:
    """Return the speed of the tool at the start, 0, or end, 1, of the path, m/s."""
    stated = task.boundary.given_speeds[end]
    slope = _tool_slope(task_map, path, end)
    return stated * slope / path_speed(task_map, path, end)


def _check_task_space(task_map: TaskMap) -> None:
    """Reject a task space in which the tool can move in other ways than along the path."""
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
            allowed="a task space that contains every position coordinate that the arm can move",
            hint="Set task_space: position, or tool_limits.speed instead",
        )


def _check_motion(
    task_map: TaskMap, path: Path, section: ProcessSpeed, number: int
) -> None:
    """Reject a part of the path in which the tool stands still."""
    s = np.linspace(*section.s, 401)
    velocity = tool_derivatives(task_map, path.between(*section.s), s)[0]
    speeds = np.linalg.norm(velocity, axis=1)
    worst = np.argmin(speeds)
    if speeds[worst] <= tolerances.LENGTH:
        raise PathError(
            "the tool has a process speed where its position stands still",
            s_interval=(float(s[worst]), float(s[worst])),
            where=key_of_speed(section, number, ".s"),
            found=f"no motion of the position at s = {s[worst]:.4g}",
            allowed="a part of the path along which the position moves",
        )
