"""|w| <= w_max of the tool, as |w| / w_max <= 1; see `tool` for the derivatives.

A tool that rolls freely about its own axis does so by a virtual joint, which turns nothing.
"""

from __future__ import annotations

import numpy as np

from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials, PhaseLines, Role
from brachis.limits.tool import direction
from brachis.robot import ROLL_JOINT, Robot, task_map_of
from brachis.task import Task

_ANGULAR = slice(3, None)
"""Rows of a pose's velocity that are its angular part, in the tool's own axes."""


class ToolAngularSpeedLimit(Limit):
    """Angular speed of the tool over its limit.

    Parameters
    ----------
    robot : Robot
    figure : float
        rad/s.
    """

    kind = "tool_angular_speed"
    role = Role.PROCESS
    time_scaling = True

    def __init__(self, robot: Robot, figure: float) -> None:
        self._tool, self._figure = task_map_of(robot, "pose"), figure
        self._turning = np.array([not (robot.rolls_freely and name == ROLL_JOINT) for name in robot.joint_names])
        self.labels = (
            Label("tool", "angular speed", "rad/s", "tool_limits.angular_speed", share="tool angular speed / limit"),
        )
        self.lower, self.upper = np.full(1, -np.inf), np.ones(1)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return (Bound(0, self._figure, self._figure, 1.0 / self._figure),)

    def _jacobian(self, twists: np.ndarray) -> np.ndarray:
        """Jacobian of the angular velocity over the limit, (K, 3, n)."""
        return self._tool.jacobian(twists)[:, _ANGULAR] * (self._turning / self._figure)

    def _speed(self, q: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        velocity = np.einsum("kij,kj->ki", self._jacobian(self._tool.twists(q)), qdot)
        return np.linalg.norm(velocity, axis=1)[:, None]

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._speed(motion.q, motion.qdot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        twists, qdot = self._tool.twists(motion.q), motion.qdot * self._turning
        jacobian = self._jacobian(twists)
        _, along = direction(np.einsum("kij,kj->ki", jacobian, qdot))
        by_q = self._tool.velocity_slopes(twists, qdot)[:, _ANGULAR] / self._figure
        return Partials(*(np.einsum("ki,kij->kj", along, part)[:, None] for part in (by_q, jacobian)))

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: the square of the ratio."""
        return PhaseLines(None, self._speed(q, q_ds) ** 2, np.zeros((len(q), 1)))


def build_tool_angular_speed(robot: Robot, task: Task) -> ToolAngularSpeedLimit | None:
    """Build the limit where the task has one."""
    figure = task.tool_limits.angular_speed
    return None if figure is None else ToolAngularSpeedLimit(robot, figure)
