"""|v| <= v_max(s) of the tool frame's origin, as |v| / v_max(s) <= 1; v_max a number, or tables over the path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials, PhaseLines, Role
from brachis.limits.speed_table import SpeedTable
from brachis.limits.tool import ToolSpeed
from brachis.robot import Robot
from brachis.task import SpeedTable as SpeedTableModel
from brachis.task import Task


class ToolSpeedLimit(Limit):
    """Speed of the tool frame's origin over its limits.

    Parameters
    ----------
    robot : Robot
    tables : (c,) sequence of SpeedTable
        Largest speeds, m/s.
    labels : (c,) sequence of Label
    """

    kind = "tool_speed"
    role = Role.PROCESS
    time_scaling = True

    def __init__(self, robot: Robot, tables: Sequence[SpeedTable], labels: Sequence[Label]) -> None:
        self._tool, self._tables, self.labels = ToolSpeed(robot), tables, tuple(labels)
        self.lower, self.upper = np.full(len(tables), -np.inf), np.ones(len(tables))
        self.breaks = np.unique(np.concatenate([table.places for table in tables if len(table.places) > 1] or [[]]))

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: the largest figure of a table stands for all of them."""
        figures = [table.largest for table in self._tables]
        return tuple(Bound(column, figure, figure, 1.0 / figure) for column, figure in enumerate(figures))

    def largest_at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest speeds, (K, c), m/s, at path coordinates s, (K,), and their derivatives by s."""
        largest, slopes = zip(*(table.at(s) for table in self._tables), strict=True)
        return np.column_stack(largest), np.column_stack(slopes)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return np.asarray(self._tool.speed(motion)[:, None] / self.largest_at(motion.s)[0])

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        largest, slope = self.largest_at(motion.s)
        speed, by_q, by_qdot = self._tool.derivatives(motion)
        q, qdot = (part[:, None] / largest[:, :, None] for part in (by_q, by_qdot))
        return Partials(q=q, qdot=qdot, s=-speed[:, None] * slope / largest**2)

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: the square of the ratio."""
        squares = (self._tool.slope(q, q_ds)[:, None] / self.largest_at(s)[0]) ** 2
        return PhaseLines(None, squares, np.zeros_like(squares))


def build_tool_speed(robot: Robot, task: Task) -> ToolSpeedLimit | None:
    """Build the limit where the task has one, or its path has feed rates."""
    speed, feed = task.tool_limits.speed, task.tool_limits.feed
    tables, labels = [], []
    if speed is not None:
        given = (speed.s, speed.speed) if isinstance(speed, SpeedTableModel) else ((0.0,), (speed,))
        tables.append(SpeedTable(*given))
        labels.append(Label("tool", "speed", "m/s", "tool_limits.speed", share="tool speed / limit"))
    for part in feed:
        tables.append(SpeedTable(part.s, part.speed, whole=False))
        labels.append(Label(f"tool, s = {part.s[0]:g} to {part.s[-1]:g},", "feed rate", "m/s", "tool_limits.feed"))
    return ToolSpeedLimit(robot, tables, labels) if tables else None
