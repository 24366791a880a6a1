"""|v| <= v_max of the tool frame's origin, as |v| / v_max <= 1.

With J the Jacobian of the origin's position in world axes, v = J(q) qdot and its direction e = v / |v|,

    d|v|/dqdot = e . J,        d|v|/dq = e . dv/dq.

A tool that stands still has no direction; far from its limit there, it is given none.
"""

from __future__ import annotations

import numpy as np

from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials, PhaseLines, Role
from brachis.robot import Robot, task_map_of
from brachis.task import Task


class ToolSpeedLimit(Limit):
    """Speed of the tool frame's origin over its limit.

    Parameters
    ----------
    robot : Robot
    figure : float
        m/s.
    """

    kind = "tool_speed"
    role = Role.PROCESS
    time_scaling = True

    def __init__(self, robot: Robot, figure: float) -> None:
        self._tool = task_map_of(robot, "position")
        self._figure = figure
        self.labels = (Label("tool", "speed", "m/s", "tool_limits.speed"),)
        self.lower, self.upper = np.full(1, -np.inf), np.ones(1)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return (Bound(0, self._figure, self._figure, 1.0 / self._figure),)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        velocity = np.einsum("kij,kj->ki", self._tool.jacobian(self._tool.twists(motion.q)), motion.qdot)
        return np.linalg.norm(velocity, axis=1)[:, None] / self._figure

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        twists = self._tool.twists(motion.q)
        jacobian = self._tool.jacobian(twists)
        velocity = np.einsum("kij,kj->ki", jacobian, motion.qdot)
        speed = np.linalg.norm(velocity, axis=1)[:, None]
        direction = np.divide(velocity, speed, out=np.zeros_like(velocity), where=speed > 0.0)
        by_q = self._tool.derivatives(twists, motion.qdot, motion.qddot).velocity_q
        parts = (np.einsum("ki,kij->kj", direction, part)[:, None] / self._figure for part in (by_q, jacobian))
        by_position, by_velocity = parts
        return Partials(q=by_position, qdot=by_velocity)

    def lines(self, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: the square of the ratio."""
        tangent = np.einsum("kij,kj->ki", self._tool.jacobian(self._tool.twists(q)), q_ds)
        return PhaseLines(None, np.sum(tangent**2, axis=1)[:, None] / self._figure**2, np.zeros((len(q), 1)))


def build(robot: Robot, task: Task) -> ToolSpeedLimit | None:
    """Build the limit where the task has one."""
    speed = task.tool_limits.speed
    return None if speed is None else ToolSpeedLimit(robot, speed)
