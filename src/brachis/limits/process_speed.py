"""A constant speed v of the tool over parts of the path: (1 - tolerance) v <= |velocity| <= (1 + tolerance) v there.

A bound that sets in at once would have no slope by which a solver could see it coming, and one that sets in with a kink
would be met at the collocation points alone. So each side fades out smoothly over a short way d beyond the part, in s:

    |velocity| >= v (1 - tolerance - g),   |velocity| <= v (1 + tolerance + g),   g = cosh(d / width) - 1,

as rows (|velocity| / v - 1) tolerance / (tolerance + g) >= -tolerance, and <= tolerance. What that costs is about the
time for one width at the process speed on either side, where the arm could have braked or gathered speed faster.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials, PhaseLines, Role
from brachis.limits.tool import ToolSpeed
from brachis.robot import Robot
from brachis.task import ProcessSpeed, Task

_WIDEST, _OF_LENGTH, _OF_REST = 0.003, 0.02, 0.2
"""Width in s, as a share of the part's own length, and of the path before or behind it, on which the tool is at rest
somewhere; the least of them counts."""
_FARTHEST = 40.0
"""In widths: beyond it nothing is left of the bounds."""


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
        self._speeds, self._tolerances = (np.array([getattr(part, name) for part in parts]) for name in _FIGURES)
        self._begin, self._end = np.array([part.s for part in parts]).T
        beside = np.minimum(self._begin, 1.0 - self._end)
        widths = (np.full(len(parts), _WIDEST), _OF_LENGTH * (self._end - self._begin), _OF_REST * beside)
        self._width = np.min(widths, axis=0)
        self.breaks = np.concatenate([self._begin, self._end])
        what = "process speed" if self._side > 0.0 else "least process speed"
        subjects = ["tool"] if len(parts) == 1 else [f"tool, s = {part.s[0]:g} to {part.s[1]:g}" for part in parts]
        self.labels = tuple(Label(subject, what, "m/s", "tool_limits.process_speed") for subject in subjects)
        self.lower, self.upper = np.full(len(parts), -np.inf), np.full(len(parts), np.inf)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: the speed at this side of the tolerance; a change by 100 % is one by the tolerance."""
        figures = self._speeds * (1.0 + self._side * self._tolerances)
        end = "upper" if self._side > 0.0 else "lower"
        rows = zip(figures.tolist(), self._speeds.tolist(), self._tolerances.tolist(), strict=True)
        return tuple(Bound(c, figure, share * v, 1.0 / v, end) for c, (figure, v, share) in enumerate(rows))

    def _window(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How much of each bound is in force, and its derivative by s, (K, c)."""
        s = np.where(np.isnan(s), np.inf, s)  # off the path
        before, behind = self._begin - s[:, None], s[:, None] - self._end
        way = np.maximum(np.maximum(before, behind), 0.0) / self._width
        sign = np.where(way <= 0.0, 0.0, np.where(before > behind, -1.0, 1.0)) / self._width
        near = np.minimum(way, _FARTHEST)
        force = self._tolerances / (self._tolerances + np.cosh(near) - 1.0)
        slope = -(force**2) / self._tolerances * np.sinh(near) * sign
        return force, np.where(way < _FARTHEST, slope, 0.0)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return (self._tool.speed(motion)[:, None] / self._speeds - 1.0) * self._window(motion.s)[0]

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        force, slope = self._window(motion.s)
        speed, by_q, by_qdot = self._tool.derivatives(motion)
        share = (force / self._speeds)[:, :, None]
        by_s = (speed[:, None] / self._speeds - 1.0) * slope
        return Partials(q=share * by_q[:, None], qdot=share * by_qdot[:, None], s=by_s)

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: within the parts alone, as the square of the ratio; for the least speeds 2 minus it."""
        inside = (s[:, None] >= self._begin) & (s[:, None] <= self._end)
        level = self._speeds * (1.0 + self._side * self._tolerances)
        squares = np.where(inside, (self._tool.slope(q, q_ds)[:, None] / level) ** 2, 0.0)
        constant = np.where(inside & (self._side < 0.0), 2.0, 0.0)
        return PhaseLines(None, self._side * squares, constant)


_FIGURES = ("speed", "tolerance")


class GreatestProcessSpeed(_ProcessSpeedLimit):
    """Process speeds are not exceeded by more than their tolerance."""

    kind = "process_speed"
    time_scaling = True
    _side = 1.0

    def __init__(self, robot: Robot, parts: Sequence[ProcessSpeed]) -> None:
        super().__init__(robot, parts)
        self.upper = self._tolerances


class LeastProcessSpeed(_ProcessSpeedLimit):
    """Nor do process speeds fall short by more."""

    kind = "least_process_speed"
    least_speed = True
    _side = -1.0

    def __init__(self, robot: Robot, parts: Sequence[ProcessSpeed]) -> None:
        super().__init__(robot, parts)
        self.lower = -self._tolerances


def build_greatest(robot: Robot, task: Task) -> GreatestProcessSpeed | None:
    """Build the upper side where the task has process speeds."""
    parts = task.tool_limits.process_speed
    return GreatestProcessSpeed(robot, parts) if parts else None


def build_least(robot: Robot, task: Task) -> LeastProcessSpeed | None:
    """Build the lower side where the task has process speeds."""
    parts = task.tool_limits.process_speed
    return LeastProcessSpeed(robot, parts) if parts else None
