"""Process speeds on a robot and a path: the ways on which they are reached, and ends of the path at such a speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.errors import InputError
from brachis.limits.tool import ToolSpeed
from brachis.path import Path, path_speed
from brachis.robot import Robot, TaskMap, dynamics, task_map_of
from brachis.robot.task_map import JointSpace
from brachis.task import Task

_STILL = 1e-9
"""m per unit s below which the tool stands still along the path."""
_PLANE = 2
"""Rows of the position from which on the path alone says how fast the tool is."""


@dataclass(frozen=True)
class FromRest:
    """How a robot comes to a speed along its path: an `Approach`.

    Attributes
    ----------
    task_map : TaskMap
    path : Path
    acceleration : float
        The tool's largest one from rest, m/s^2.
    """

    task_map: TaskMap
    path: Path
    acceleration: float

    def way(self, speed: float, s: float) -> float:
        """See `Approach.way`."""
        return 0.5 * speed**2 / self.acceleration / max(_tool_path_speed(self.task_map, self.path, s), _STILL)


def approach_of(
    task: Task, robot: Robot, task_map: TaskMap, path: Path, posture: np.ndarray | None, *, own: bool = False
) -> FromRest | None:
    """Find out how speeds along the path are reached; None where no limit asks for it.

    Parameters
    ----------
    task : Task
    robot : Robot
    task_map : TaskMap
    path : Path
    posture : (n,) ndarray or None
        In which the tool's largest acceleration is taken, of which no more than the size matters; None: that in the
        middle of the joint ranges.
    own : bool, optional
        Whether there are limits of the user's own, which may ask for it as process speeds do.

    Raises
    ------
    InputError
        A part of the path with a process speed begins or ends with the path, where that is passed at another speed.
    """
    tool = task.tool_limits
    if not (tool.process_speed or task.custom_limits or own):
        return None
    for number in range(len(tool.process_speed)):
        _check_ends(task, task_map, path, number)
    largest = largest_acceleration(robot, _middle(robot) if posture is None else posture)
    return FromRest(task_map, path, min(largest, tool.acceleration or np.inf))


def largest_acceleration(robot: Robot, posture: np.ndarray) -> float:
    """Bound the acceleration of the tool, m/s^2, at rest in a posture, (n,), without gravity, from above.

    With rows A of joint accelerations over what torque and acceleration limits allow, |A qddot| <= 1, no component of
    J qddot exceeds the sum of the sizes in its row of J A^-1.
    """
    tool = task_map_of(robot, "position")
    jacobian = tool.jacobian(tool.twists(posture[None]))[0]
    mass = dynamics.mass_matrices(robot, posture[None])[0]
    torque, rate = (np.abs(robot.limits.both_ways(kind)).max(axis=0) for kind in ("torque", "acceleration"))
    found = []
    for first in (torque, np.full(robot.n, np.inf)):
        by_torque = np.isfinite(first) | (np.isfinite(torque) & ~np.isfinite(rate))
        rows = np.where(by_torque[:, None], mass, np.eye(robot.n))
        figures = np.where(by_torque, torque, np.where(np.isfinite(rate), rate, 0.0))
        found.append(float(np.linalg.norm(np.abs(jacobian @ np.linalg.inv(rows) * figures).sum(axis=1))))
    return max(min(found), _STILL)


def _tool_path_speed(task_map: TaskMap, path: Path, s: float) -> float:
    """Return how far the tool moves per unit s, m; where only some rows of its position are prescribed, in those."""
    if not isinstance(task_map, JointSpace):
        return path_speed(task_map, path, s)
    place = path.sample(np.array([s]))
    return float(ToolSpeed(task_map.robot).slope(place.target, place.xi)[0])


def _check_ends(task: Task, task_map: TaskMap, path: Path, number: int) -> None:
    """Refuse a part that begins or ends with the path, unless the speed there is its own."""
    part, given = task.tool_limits.process_speed[number], task.boundary
    for s, end, speed in ((0.0, 0, given.start_speed), (1.0, 1, given.end_speed)):
        if part.s[end] != s or given.periodic:
            continue
        ratio = _tool_path_speed(task_map, path, s) / max(path_speed(task_map, path, s), _STILL)
        found = speed * ratio
        low, high = (1.0 - part.tolerance) * part.speed, (1.0 + part.tolerance) * part.speed
        free = not isinstance(task_map, JointSpace) and len(task_map.axes) < _PLANE
        if not (0.0 if free else low) <= found <= high or not found > 0.0:
            wanted = part.speed / max(ratio, _STILL)
            name, begins, reach = (("start", "begins", "reach"), ("end", "ends", "leave"))[end]
            raise InputError(
                f"the part with a constant speed {begins} with the path, which is passed there at another one",
                where=f"tool_limits.process_speed[{number}].s[{end}]",
                found=f"{found:g} m/s, by boundary.{name}_speed",
                allowed=f"{low:g} to {high:g} m/s at the path's {name}, or a place within the path",
                hint=f"Set boundary.{name}_speed to {wanted:g}, or leave way to {reach} the speed",
            )


def _middle(robot: Robot) -> np.ndarray:
    """Return the posture in the middle of the joint ranges, (n,); zero where a joint has none."""
    low, high = robot.limits.position_lower, robot.limits.position_upper
    ranged = np.isfinite(low) & np.isfinite(high)
    return np.where(ranged, 0.5 * (np.where(ranged, low, 0.0) + np.where(ranged, high, 0.0)), 0.0)
