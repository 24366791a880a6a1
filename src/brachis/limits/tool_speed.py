"""|v| <= v_max(s) of the tool frame's origin, as |v| / v_max(s) <= 1; v_max a number, or a table over the path."""

from __future__ import annotations

import numpy as np

from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials, PhaseLines, Role
from brachis.limits.speed_table import SpeedTable
from brachis.limits.tool import ToolSpeed
from brachis.robot import Robot
from brachis.task import SpeedTable as SpeedTableModel
from brachis.task import Task


class ToolSpeedLimit(Limit):
    """Speed of the tool frame's origin over its limit.

    Parameters
    ----------
    robot : Robot
    table : SpeedTable
        Largest speeds, m/s.
    """

    kind = "tool_speed"
    role = Role.PROCESS
    time_scaling = True

    def __init__(self, robot: Robot, table: SpeedTable) -> None:
        self._tool, self._table = ToolSpeed(robot), table
        self._figure = float(table.speeds.max())
        self.labels = (Label("tool", "speed", "m/s", "tool_limits.speed"),)
        self.lower, self.upper = np.full(1, -np.inf), np.ones(1)
        self.breaks = table.places if len(table.places) > 1 else self.breaks

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: the largest figure of a table stands for all of them."""
        return (Bound(0, self._figure, self._figure, 1.0 / self._figure),)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        largest, _ = self._table.at(motion.s)
        return (self._tool.speed(motion) / largest)[:, None]

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        largest, slope = self._table.at(motion.s)
        speed, by_q, by_qdot = self._tool.derivatives(motion)
        by_s = -(speed * slope / largest**2)[:, None]
        return Partials(q=(by_q / largest[:, None])[:, None], qdot=(by_qdot / largest[:, None])[:, None], s=by_s)

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: the square of the ratio."""
        squares = (self._tool.slope(q, q_ds) / self._table.at(s)[0]) ** 2
        return PhaseLines(None, squares[:, None], np.zeros((len(q), 1)))


def build(robot: Robot, task: Task) -> ToolSpeedLimit | None:
    """Build the limit where the task has one."""
    speed = task.tool_limits.speed
    if speed is None:
        return None
    given = (speed.s, speed.speed) if isinstance(speed, SpeedTableModel) else ((0.0,), (speed,))
    return ToolSpeedLimit(robot, SpeedTable(*given))
