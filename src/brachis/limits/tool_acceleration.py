"""|a| <= a_max of the tool frame's origin, as |a| / a_max <= 1; see `tool` for the derivatives."""

from __future__ import annotations

import numpy as np

from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials, PhaseLines, Role
from brachis.limits.tool import direction
from brachis.robot import Robot, task_map_of
from brachis.task import Task


class ToolAccelerationLimit(Limit):
    """Size of the acceleration of the tool frame's origin over its limit.

    Parameters
    ----------
    robot : Robot
    figure : float
        m/s^2.
    """

    kind = "tool_acceleration"
    role = Role.PROCESS
    time_scaling = True

    def __init__(self, robot: Robot, figure: float) -> None:
        self._tool, self._figure = task_map_of(robot, "position"), figure
        self.labels = (
            Label("tool", "acceleration", "m/s^2", "tool_limits.acceleration", share="tool acceleration / limit"),
        )
        self.lower, self.upper = np.full(1, -np.inf), np.ones(1)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return (Bound(0, self._figure, self._figure, 1.0 / self._figure),)

    def _acceleration(self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
        """Accelerations over the limit, (K, 3), world frame."""
        jacobian = self._tool.jacobian(twists)
        return (np.einsum("kij,kj->ki", jacobian, qddot) + self._tool.bias(twists, qdot)) / self._figure

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        found = self._acceleration(self._tool.twists(motion.q), motion.qdot, motion.qddot)
        return np.linalg.norm(found, axis=1)[:, None]

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        twists = self._tool.twists(motion.q)
        _, along = direction(self._acceleration(twists, motion.qdot, motion.qddot))
        exact = self._tool.derivatives(twists, motion.qdot, motion.qddot)
        by = (exact.acceleration_q, exact.acceleration_qdot, self._tool.jacobian(twists))
        return Partials(*(np.einsum("ki,kij->kj", along, part)[:, None] / self._figure for part in by))

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: the components along the world's axes, each within the whole."""
        twists, still = self._tool.twists(q), np.zeros_like(q)
        by_u = self._acceleration(twists, still, q_ds)
        return PhaseLines(by_u, self._acceleration(twists, q_ds, q_dds), np.zeros_like(by_u))


def build_tool_acceleration(robot: Robot, task: Task) -> ToolAccelerationLimit | None:
    """Build the limit where the task has one."""
    figure = task.tool_limits.acceleration
    return None if figure is None else ToolAccelerationLimit(robot, figure)
