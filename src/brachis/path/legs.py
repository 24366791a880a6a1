"""The legs of a path: parts between stops, each at a given speed or as fast as the limits allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from brachis.common import tolerances
from brachis.errors import PathError
from brachis.path.sequence import Path, path_speed, tool_derivatives
from brachis.robot import TaskMap, task_map_of
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import AXES
from brachis.task import ProcessSpeed, Task

_KEY = "tool_limits.process_speed"


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
            where=f"{_KEY}[{number}].speed",
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
        hint=f"Leave room before and behind s = {stop:.6g}: cut the part in two, or remove the stop",
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
            where=f"{_KEY}[{number}].s",
            found=f"no motion of the position at s = {s[worst]:.4g}",
            allowed="a part of the path along which the position moves",
        )


def _check_ends(task: Task, task_map: TaskMap, path: Path, number: int) -> None:
    """Refuse a part that begins or ends with the path, unless the path has its speed there."""
    part = task.tool_limits.process_speed[number]
    boundary = task.boundary
    for end, name, speed in (
        (0, "start", boundary.start_speed),
        (1, "end", boundary.end_speed),
    ):
        if part.s[end] != end or boundary.periodic:
            continue
        velocity = tool_derivatives(task_map, path, np.array([float(end)]))[0, 0]
        ratio = np.linalg.norm(velocity) / path_speed(task_map, path, end)
        found = speed * ratio
        if abs(found - part.speed) <= tolerances.WRITTEN * part.speed:
            continue
        raise PathError(
            f"process speed at s = {end} is {part.speed:g} m/s, but that at the path's {name} is {found:g} m/s",
            where=f"{_KEY}[{number}].s[{end}]",
            found=f"{found:g} m/s, by boundary.{name}_speed",
            allowed=f"{part.speed:g} m/s at the path's {name}, or an s inside the path",
            hint=f"Set boundary.{name}_speed to {part.speed / ratio:.10g}, or leave room on the path to "
            "change the speed",
        )
