"""A constant speed v of the tool over parts of the path: (1 - tolerance) v <= |velocity| <= (1 + tolerance) v there.

A bound that sets in at once would have no slope by which a solver could see it coming. So each side gives way beside
the part, the faster the farther, over the way that the tool needs for it: with d the distance from the part and
l = v^2 / 2 a the way on which the largest acceleration a leads from rest to v,

    |velocity| >= v (1 - g),   |velocity| <= v (1 + g),   g = 2 f(d) / l,

up to the tolerance, where f is d but for a corner rounded over a width w: d^2 / 2 w up to there, d - w / 2 beyond. As
rows ((|velocity| / v - 1) +- g) / (1 + g) >= -tolerance, and <= tolerance. The acceleration a is taken at rest
in the start posture: no motion to v is as steep as that unless the tool accelerates more than twice as much elsewhere;
the corner alone holds back, over the way w, by about 0.06 w^2 / l v of time.

Process speeds on a robot and a path: the ways on which they are reached, and ends of the path at such a speed.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from brachis.errors import InputError
from brachis.limits.protocol import (
    Approach,
    Bound,
    JointMotion,
    Label,
    Limit,
    Partials,
    PhaseLines,
    Role,
)
from brachis.limits.tool import ToolSpeed
from brachis.path import Path, path_speed
from brachis.robot import Robot, TaskMap, dynamics, task_map_of
from brachis.robot.task_map import JointSpace
from brachis.task import ProcessSpeed, Task

_STEEPNESS = 2.0
"""So many times as steep as the largest acceleration the bounds give way beside a part."""
_COST = 2e-3
"""The square of the corner's width is this share of l times the part, 4 l^2 at most."""
_SHORTEST = 1e-6
"""Least way to the speed, in s; and that where robot and path have not been asked for it."""
_FARTHEST = 1e3
"""Largest g: beyond it nothing is left of the bounds."""


class _ProcessSpeedLimit(Limit):
    """One side of the process speeds, a value for each part of the path.

    Parameters
    ----------
    robot : Robot
    parts : (c,) sequence of ProcessSpeed
    """

    role = Role.PROCESS
    _side: float
    """1 for the greatest speeds, -1 for the least ones."""

    def __init__(self, robot: Robot, parts: Sequence[ProcessSpeed]) -> None:
        self._tool = ToolSpeed(robot)
        self._speeds, self._tolerances = (
            np.array([getattr(part, name) for part in parts]) for name in _FIGURES
        )
        self._part = np.array([part.s for part in parts]).T
        self._lay_ways(np.zeros((2, len(parts))))
        self.breaks = self._part.ravel()
        what = "process speed" if self._side > 0.0 else "least process speed"
        places = (
            [""]
            if len(parts) == 1
            else [f", s = {part.s[0]:g} to {part.s[1]:g}" for part in parts]
        )
        self.labels = tuple(
            self._label(number, what, place) for number, place in enumerate(places)
        )
        self.lower, self.upper = (
            np.full(len(parts), -np.inf),
            np.full(len(parts), np.inf),
        )

    def _label(self, number: int, what: str, place: str) -> Label:
        """Name the speed of a part, whose place is told where there are several."""
        end, side = ("upper", "above") if self._side > 0.0 else ("lower", "below")
        within = f"{place}," if place else ""
        reached = f"tool is at the {end} end of its process speed{within}"
        room = f"tolerance {side} the process speed{within}"
        return Label(
            f"tool{place}",
            what,
            "m/s",
            f"tool_limits.process_speed[{number}].speed",
            reached,
            room,
        )

    def _lay_ways(self, ways: np.ndarray) -> None:
        """Set the ways to the speeds before and behind the parts, (2, c), in s, and the widths of their corners."""
        # Also where the robot accelerates faster than estimated, the path before a part is way enough.
        beside = np.array([self._part[0], 1.0 - self._part[1]])
        self._ramp = np.maximum(np.minimum(ways, beside), _SHORTEST)
        self._width = np.minimum(
            2.0 * self._ramp, np.sqrt(_COST * self._ramp * np.diff(self._part, axis=0))
        )

    def along(self, approach: Approach) -> Self:
        """See `Limit.along`."""
        other = copy.copy(self)
        pairs = [
            zip(self._speeds.tolist(), places.tolist(), strict=True)
            for places in self._part
        ]
        other._lay_ways(  # noqa: SLF001
            np.array([[approach.way(*pair) for pair in rows] for rows in pairs])
        )
        return other

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: the speed at this side of the tolerance; a change by 100 % is one by the tolerance."""
        figures = self._speeds * (1.0 + self._side * self._tolerances)
        end = "upper" if self._side > 0.0 else "lower"
        rows = zip(
            figures.tolist(),
            self._speeds.tolist(),
            self._tolerances.tolist(),
            strict=True,
        )
        return tuple(
            Bound(c, figure, share * v, 1.0 / v, end)
            for c, (figure, v, share) in enumerate(rows)
        )

    def _giving(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How much each bound gives way, g, and its derivative by s, (K, c); infinitely much off the path."""
        s = np.where(np.isnan(s), np.inf, s)
        before, behind = self._part[0] - s[:, None], s[:, None] - self._part[1]
        end = (behind > before).astype(int)
        column = np.arange(len(self._speeds))
        ramp, width = self._ramp[end, column], self._width[end, column]
        way = np.maximum(np.maximum(before, behind), 0.0)
        given = (
            _STEEPNESS
            / ramp
            * np.where(way < width, 0.5 * way**2 / width, way - 0.5 * width)
        )
        slope = (
            _STEEPNESS / ramp * np.minimum(way / width, 1.0) * np.where(end, 1.0, -1.0)
        )
        near = given < _FARTHEST
        return np.where(near, given, _FARTHEST), np.where(near, slope, 0.0)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        given, _ = self._giving(motion.s)
        return (
            self._tool.speed(motion)[:, None] / self._speeds - 1.0 - self._side * given
        ) / (1.0 + given)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        given, slope = self._giving(motion.s)
        speed, by_q, by_qdot = self._tool.derivatives(motion)
        share = (1.0 / self._speeds / (1.0 + given))[:, :, None]
        by_s = -(
            self._side
            + (speed[:, None] / self._speeds - 1.0 - self._side * given) / (1.0 + given)
        )
        return Partials(
            q=share * by_q[:, None],
            qdot=share * by_qdot[:, None],
            s=by_s * slope / (1.0 + given),
        )

    def lines(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhaseLines:
        """See `Limit.lines`: within the parts alone, as the square of the ratio; for the least speeds 2 minus it."""
        inside = (s[:, None] >= self._part[0]) & (s[:, None] <= self._part[1])
        level = self._speeds * (1.0 + self._side * self._tolerances)
        squares = np.where(
            inside, (self._tool.slope(q, q_ds)[:, None] / level) ** 2, 0.0
        )
        constant = np.where(inside & (self._side < 0.0), 2.0, 0.0)
        return PhaseLines(None, self._side * squares, constant)


_FIGURES = ("speed", "tolerance")


class GreatestProcessSpeed(_ProcessSpeedLimit):
    """Process speeds are not exceeded by more than their tolerance."""

    kind = "process_speed"
    longer_time = "relieves"
    _side = 1.0

    def __init__(self, robot: Robot, parts: Sequence[ProcessSpeed]) -> None:
        super().__init__(robot, parts)
        self.upper = self._tolerances


class LeastProcessSpeed(_ProcessSpeedLimit):
    """Nor do process speeds fall short by more."""

    kind = "least_process_speed"
    longer_time = "violates"
    _side = -1.0

    def __init__(self, robot: Robot, parts: Sequence[ProcessSpeed]) -> None:
        super().__init__(robot, parts)
        self.lower = -self._tolerances


def build_process_speed(robot: Robot, task: Task) -> GreatestProcessSpeed | None:
    """Build the upper side where the task has process speeds."""
    parts = task.tool_limits.process_speed
    return GreatestProcessSpeed(robot, parts) if parts else None


def build_least_process_speed(robot: Robot, task: Task) -> LeastProcessSpeed | None:
    """Build the lower side where the task has process speeds."""
    parts = task.tool_limits.process_speed
    return LeastProcessSpeed(robot, parts) if parts else None


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
        return (
            0.5
            * speed**2
            / self.acceleration
            / max(_tool_path_speed(self.task_map, self.path, s), _STILL)
        )


def approach_of(
    task: Task,
    robot: Robot,
    task_map: TaskMap,
    path: Path,
    posture: np.ndarray | None,
    *,
    own: bool = False,
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
    largest = largest_acceleration(
        robot, _middle(robot) if posture is None else posture
    )
    return FromRest(task_map, path, min(largest, tool.acceleration or np.inf))


def largest_acceleration(robot: Robot, posture: np.ndarray) -> float:
    """Bound the acceleration of the tool, m/s^2, at rest in a posture, (n,), without gravity, from above.

    With rows A of joint accelerations over what torque and acceleration limits allow, |A qddot| <= 1, no component of
    J qddot exceeds the sum of the sizes in its row of J A^-1.
    """
    tool = task_map_of(robot, "position")
    jacobian = tool.jacobian(tool.twists(posture[None]))[0]
    mass = dynamics.mass_matrices(robot, posture[None])[0]
    torque, rate = (
        np.abs(robot.limits.both_ways(kind)).max(axis=0)
        for kind in ("torque", "acceleration")
    )
    found = []
    for first in (torque, np.full(robot.n, np.inf)):
        by_torque = np.isfinite(first) | (np.isfinite(torque) & ~np.isfinite(rate))
        rows = np.where(by_torque[:, None], mass, np.eye(robot.n))
        figures = np.where(by_torque, torque, np.where(np.isfinite(rate), rate, 0.0))
        found.append(
            float(
                np.linalg.norm(
                    np.abs(jacobian @ np.linalg.inv(rows) * figures).sum(axis=1)
                )
            )
        )
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
        ratio = _tool_path_speed(task_map, path, s) / max(
            path_speed(task_map, path, s), _STILL
        )
        found = speed * ratio
        low, high = (
            (1.0 - part.tolerance) * part.speed,
            (1.0 + part.tolerance) * part.speed,
        )
        free = not isinstance(task_map, JointSpace) and len(task_map.axes) < _PLANE
        if not (0.0 if free else low) <= found <= high or not found > 0.0:
            wanted = part.speed / max(ratio, _STILL)
            name, begins, reach = (
                ("start", "begins", "reach"),
                ("end", "ends", "leave"),
            )[end]
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
    return np.where(
        ranged, 0.5 * (np.where(ranged, low, 0.0) + np.where(ranged, high, 0.0)), 0.0
    )
