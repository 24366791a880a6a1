"""Joint velocities between v_min and v_max, |qddot| <= a_max and |qdddot| <= j_max."""

from __future__ import annotations

import numpy as np

from brachis.limits.per_joint import JointRatioLimit
from brachis.limits.protocol import JointMotion, Partials, PhaseLines
from brachis.robot import Robot
from brachis.task import Task


class _JointRateLimit(JointRatioLimit):
    """Joint velocities, accelerations or jerks within their limits.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    figures : (c,) or (2, c) ndarray
        Their limits; see `JointRatioLimit`.
    """

    _per_time: str

    def __init__(self, robot: Robot, joints: np.ndarray, figures: np.ndarray) -> None:
        super().__init__(robot, joints, figures, [unit + self._per_time for unit in robot.position_units])
        self._selection = np.eye(robot.n)[joints] * self._scale[:, None]

    def _rows(self, count: int) -> np.ndarray:
        """Constant partials at `count` moments, (K, c, n)."""
        return np.broadcast_to(self._selection, (count, *self._selection.shape))


class VelocityLimit(_JointRateLimit):
    """Joint velocities within their limits; see `_JointRateLimit`."""

    kind = "velocity"
    _per_time = "/s"

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.qdot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(qdot=self._rows(len(motion.q)))

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: the square of the ratio, q_ds^2 x / v^2, to the limit of the direction."""
        low, high = self._figures
        tangent = q_ds[:, self._joints]
        squares = (tangent / np.where(tangent > 0.0, high, low)) ** 2
        return PhaseLines(None, squares, np.zeros((len(q), len(self.lower))))

    def step_rows(self, q: np.ndarray) -> tuple[None, np.ndarray]:
        """See `Limit.step_rows`."""
        return None, self._rows(len(q))


class AccelerationLimit(_JointRateLimit):
    """Joint accelerations over their limits; see `_JointRateLimit`."""

    kind = "acceleration"
    _per_time = "/s^2"

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.qddot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(qddot=self._rows(len(motion.q)))

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`."""
        by_u, by_x = (part[:, self._joints] * self._scale for part in (q_ds, q_dds))
        return PhaseLines(by_u, by_x, np.zeros((len(q), len(self.lower))))

    def step_rows(self, q: np.ndarray) -> tuple[np.ndarray, None]:
        """See `Limit.step_rows`."""
        return self._rows(len(q)), None


class JerkLimit(_JointRateLimit):
    """Joint jerks over their limits; see `_JointRateLimit`."""

    kind = "jerk"
    order = 3
    _per_time = "/s^3"

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.qdddot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(qdddot=self._rows(len(motion.q)))


def build_velocity(robot: Robot, _task: Task) -> VelocityLimit | None:
    """Build the limit for the joints with a finite velocity limit."""
    figures = robot.limits.both_ways("velocity")
    joints = np.flatnonzero(np.isfinite(figures[1]))
    return VelocityLimit(robot, joints, figures[:, joints]) if len(joints) else None


def build_acceleration(robot: Robot, _task: Task) -> AccelerationLimit | None:
    """Build the limit for the joints with a finite acceleration limit."""
    joints = np.flatnonzero(np.isfinite(robot.limits.acceleration))
    return AccelerationLimit(robot, joints, robot.limits.acceleration[joints]) if len(joints) else None


def build_jerk(robot: Robot, _task: Task) -> JerkLimit | None:
    """Build the limit for the joints with a finite jerk limit."""
    joints = np.flatnonzero(np.isfinite(robot.limits.jerk))
    return JerkLimit(robot, joints, robot.limits.jerk[joints]) if len(joints) else None
