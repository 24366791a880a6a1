"""A constant speed v of the tool over parts of the path: (1 - tolerance) v <= |velocity| <= (1 + tolerance) v there.

A bound that switches on abruptly gives the solver no gradient. So outside a part both bounds are relaxed, the more the
farther away, over the distance in which the tool reaches the speed: with d the distance from the part and
l = v^2 / 2 a the distance in which the largest acceleration a leads from rest to v,

    |velocity| >= v (1 - g),   |velocity| <= v (1 + g),   g = 2 f(d) / l,

up to the tolerance, where f is d but for a corner rounded over a width w: d^2 / 2 w up to there, d - w / 2 beyond. As
rows ((|velocity| / v - 1) +- g) / (1 + g) >= -tolerance, and <= tolerance. The acceleration a is taken at rest
in the start posture: no motion to v is as steep as that unless the tool accelerates more than twice as much elsewhere.
Only the corner costs time, over the distance w about 0.06 w^2 / l v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from brachis.errors import InputError
from brachis.limits.protocol import (
    Bound,
    HasPhasePlaneRows,
    JointStates,
    Label,
    Limit,
    Partials,
    PhasePlaneRows,
    Role,
)
from brachis.limits.tool import ToolSpeed
from brachis.path import Path, path_speed
from brachis.robot import Robot, TaskMap, dynamics, task_map_of
from brachis.robot.task_map import JointSpace
from brachis.task import ProcessSpeed, Task

_STILL = 1e-9
"""Speeds along the path, m per unit s, and accelerations, m/s^2, below this count as zero."""


@dataclass(frozen=True)
class ConstantAccelerationRamp:
    """How a robot reaches a speed along its path.

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

    def distance(self, speed: float, s: float) -> float:
        """Distance, in s, in which the tool reaches a speed, m/s, from rest near path coordinate s."""
        rate = max(_tool_path_speed(self.task_map, self.path, s), _STILL)
        return 0.5 * speed**2 / self.acceleration / rate


class _ProcessSpeedLimit(Limit, HasPhasePlaneRows):
    """One side of the process speeds, a value for each part of the path.

    Parameters
    ----------
    robot : Robot
    parts : (c,) sequence of ProcessSpeed
    ramp : ConstantAccelerationRamp or None
        Without one, the bounds of the parts switch on abruptly.
    """

    role = Role.PROCESS
    side: str
    words: tuple[str, str]
    """What is limited; "above" or "below"."""

    def __init__(
        self,
        robot: Robot,
        parts: Sequence[ProcessSpeed],
        ramp: ConstantAccelerationRamp | None,
    ) -> None:
        self._tool = ToolSpeed(robot)
        self._sign = 1.0 if self.side == "upper" else -1.0
        self._speeds = np.array([part.speed for part in parts])
        self._tolerances = np.array([part.tolerance for part in parts])
        self._levels = self._speeds * (1.0 + self._sign * self._tolerances)
        self._part = np.array([part.s for part in parts]).T
        self._set_ramps(parts, ramp)
        self.breaks = self._part.ravel()
        self.labels = tuple(
            self._label(number, part, alone=len(parts) == 1)
            for number, part in enumerate(parts)
        )
        self.lower = np.full(len(parts), -np.inf)
        self.upper = np.full(len(parts), np.inf)
        setattr(self, self.side, self._sign * self._tolerances)
        # A change of the speed by 100 % is one by the tolerance.
        self.bounds = tuple(
            Bound(
                number,
                float(self._levels[number]),
                part.tolerance * part.speed,
                1.0 / part.speed,
                self.side,
            )
            for number, part in enumerate(parts)
        )

    @classmethod
    def build(
        cls, robot: Robot, task: Task, ramp: ConstantAccelerationRamp | None = None
    ) -> Self | None:
        """Build the limit of a task with process speeds."""
        parts = task.tool_limits.process_speed
        return cls(robot, parts, ramp) if parts else None

    def _label(self, number: int, part: ProcessSpeed, *, alone: bool) -> Label:
        """Name the speed of a part, and the part unless it is alone."""
        what, direction = self.words
        where = "" if alone else f", s = {part.s[0]:g} to {part.s[1]:g}"
        within = f"{where}," if where else ""
        return Label(
            f"tool{where}",
            what,
            "m/s",
            f"tool_limits.process_speed[{number}].speed",
            active_text=f"tool is at the {self.side} end of its process speed{within}",
            slack_text=f"tolerance {direction} the process speed{within}",
        )

    def _set_ramps(
        self, parts: Sequence[ProcessSpeed], ramp: ConstantAccelerationRamp | None
    ) -> None:
        """Set the distances before and behind the parts in which speeds are reached, (2, c), and corner widths."""
        distances = np.zeros((2, len(parts)))
        if ramp is not None:
            distances = np.array(
                [
                    [ramp.distance(part.speed, part.s[end]) for part in parts]
                    for end in (0, 1)
                ]
            )
        # A robot that accelerates faster than estimated needs no more than the path beside the part.
        beside = np.array([self._part[0], 1.0 - self._part[1]])
        self._ramp = np.maximum(np.minimum(distances, beside), 1e-6)
        length = np.diff(self._part, axis=0)
        # The corner costs little time: its square is 0.2 % of the ramp times the part.
        self._width = np.minimum(2.0 * self._ramp, np.sqrt(2e-3 * self._ramp * length))

    def _relaxation(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How much each bound is relaxed, g, and its derivative by s, (K, c); as good as infinite off the path."""
        s = np.where(np.isnan(s), np.inf, s)
        before = self._part[0] - s[:, None]
        behind = s[:, None] - self._part[1]
        end = (behind > before).astype(int)
        column = np.arange(len(self._speeds))
        width = self._width[end, column]
        steepness = 2.0 / self._ramp[end, column]
        distance = np.maximum(np.maximum(before, behind), 0.0)
        rounded = np.where(
            distance < width, 0.5 * distance**2 / width, distance - 0.5 * width
        )
        relaxation = steepness * rounded
        slope = steepness * np.minimum(distance / width, 1.0) * np.where(end, 1.0, -1.0)
        most = 1e3  # nothing is left of the bounds
        near = relaxation < most
        return np.where(near, relaxation, most), np.where(near, slope, 0.0)

    def _values(self, speed: np.ndarray, relaxation: np.ndarray) -> np.ndarray:
        off = speed[:, None] / self._speeds - 1.0
        return np.asarray((off - self._sign * relaxation) / (1.0 + relaxation))

    def values(self, motion: JointStates) -> np.ndarray:
        relaxation, _ = self._relaxation(motion.s)
        return self._values(self._tool.speed(motion), relaxation)

    def partials(self, motion: JointStates) -> Partials:
        relaxation, slope = self._relaxation(motion.s)
        speed, by_q, by_qdot = self._tool.derivatives(motion)
        share = (1.0 / self._speeds / (1.0 + relaxation))[:, :, None]
        by_relaxation = -(self._sign + self._values(speed, relaxation))
        by_s = by_relaxation * slope / (1.0 + relaxation)
        return Partials(share * by_q[:, None], share * by_qdot[:, None], s=by_s)

    def phase_plane_rows(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhasePlaneRows:
        """Write the square of the ratio within the parts; for the least speeds 2 minus it."""
        inside = (s[:, None] >= self._part[0]) & (s[:, None] <= self._part[1])
        ratios = self._tool.slope(q, q_ds)[:, None] / self._levels
        squares = np.where(inside, ratios**2, 0.0)
        constant = np.where(inside & (self._sign < 0.0), 2.0, 0.0)
        return PhasePlaneRows(None, self._sign * squares, constant)


class GreatestProcessSpeed(_ProcessSpeedLimit):
    """Process speeds are not exceeded by more than their tolerance."""

    kind = "process_speed"
    longer_time = "relieves"
    side = "upper"
    words = ("process speed", "above")


class LeastProcessSpeed(_ProcessSpeedLimit):
    """The tool is not slower than process speeds by more than their tolerance."""

    kind = "least_process_speed"
    longer_time = "violates"
    side = "lower"
    words = ("least process speed", "below")


def build_ramp(
    task: Task, robot: Robot, task_map: TaskMap, path: Path, posture: np.ndarray | None
) -> ConstantAccelerationRamp | None:
    """Estimate how speeds along the path are reached; None for a task without process speeds.

    Parameters
    ----------
    task : Task
    robot : Robot
    task_map : TaskMap
    path : Path
    posture : (n,) ndarray or None
        Posture at which to estimate the largest acceleration of the tool (its order of magnitude); None: the middle
        of the joint ranges.

    Raises
    ------
    InputError
        A part of the path with a process speed begins or ends with the path, which is passed there at another speed.
    """
    tool = task.tool_limits
    if not tool.process_speed:
        return None
    for number in range(len(tool.process_speed)):
        _check_ends(task, task_map, path, number)
    if posture is None:
        low = robot.limits.position_lower
        high = robot.limits.position_upper
        ranged = np.isfinite(low) & np.isfinite(high)
        posture = np.zeros(robot.n)
        posture[ranged] = 0.5 * (low[ranged] + high[ranged])
    largest = largest_acceleration(robot, posture)
    return ConstantAccelerationRamp(
        task_map, path, min(largest, tool.acceleration or np.inf)
    )


def largest_acceleration(robot: Robot, posture: np.ndarray) -> float:
    """Bound the acceleration of the tool, m/s^2, at rest in a posture, (n,), without gravity, from above.

    With rows A of joint accelerations over what torque and acceleration limits allow, |A qddot| <= 1, no component of
    J qddot exceeds the sum of the sizes in its row of J A^-1.
    """
    tool = task_map_of(robot, "position")
    jacobian = tool.jacobian(tool.twists(posture[None]))[0]
    mass = dynamics.mass_matrices(robot, posture[None])[0]
    torque, acceleration = (
        np.abs(robot.limits.both_ways(kind)).max(axis=0)
        for kind in ("torque", "acceleration")
    )
    limited = np.isfinite(acceleration)
    estimates = []
    for preferred in (torque, np.full(robot.n, np.inf)):
        by_torque = np.isfinite(preferred) | (np.isfinite(torque) & ~limited)
        rows = np.where(by_torque[:, None], mass, np.eye(robot.n))
        figures = np.where(by_torque, torque, np.where(limited, acceleration, 0.0))
        reach = np.abs(jacobian @ np.linalg.inv(rows) * figures).sum(axis=1)
        estimates.append(float(np.linalg.norm(reach)))
    return max(min(estimates), _STILL)


def _tool_path_speed(task_map: TaskMap, path: Path, s: float) -> float:
    """Return how far the tool moves per unit s, m, in the prescribed rows of its position."""
    if not isinstance(task_map, JointSpace):
        return path_speed(task_map, path, s)
    sample = path.sample(np.array([s]))
    return float(ToolSpeed(task_map.robot).slope(sample.target, sample.xi)[0])


def _check_ends(task: Task, task_map: TaskMap, path: Path, number: int) -> None:
    """Refuse a part that begins or ends with the path, unless the path has its speed there."""
    part = task.tool_limits.process_speed[number]
    boundary = task.boundary
    for end, name, speed, verbs in (
        (0, "start", boundary.start_speed, ("begins", "reach")),
        (1, "end", boundary.end_speed, ("ends", "leave")),
    ):
        s = float(end)
        if part.s[end] != s or boundary.periodic:
            continue
        ratio = _tool_path_speed(task_map, path, s)
        ratio /= max(path_speed(task_map, path, s), _STILL)
        found = speed * ratio
        low = (1.0 - part.tolerance) * part.speed
        high = (1.0 + part.tolerance) * part.speed
        # A path that prescribes one row of the position does not say how fast the tool is.
        is_free = not isinstance(task_map, JointSpace) and len(task_map.axes) < 2
        if not (0.0 if is_free else low) <= found <= high or not found > 0.0:
            wanted = part.speed / max(ratio, _STILL)
            raise InputError(
                f"process speed at s = {end} is {part.speed:g} m/s, but the path {verbs[0]} at {found:g} m/s",
                where=f"tool_limits.process_speed[{number}].s[{end}]",
                found=f"{found:g} m/s, by boundary.{name}_speed",
                allowed=f"{low:g} to {high:g} m/s at the path's {name}, or an s inside the path",
                hint=f"Set boundary.{name}_speed to {wanted:g}, or leave room on the path to {verbs[1]} the speed",
            )
