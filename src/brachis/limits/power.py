"""|tau qdot| <= P of every joint, and |sum over the joints of tau qdot| <= P_total, as ratios in [-1, 1]."""

from __future__ import annotations

import numpy as np

from brachis.limits.joint import JointRatioLimit
from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials
from brachis.robot import Robot
from brachis.task import Task


class PowerLimit(JointRatioLimit):
    """Mechanical power of every joint over its limit; negative where the joint brakes.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    kind = "power"

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        super().__init__(robot, joints, robot.limits.power[joints], ["W"] * robot.n)
        self._robot = robot

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(_powers(self._robot, motion))

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        parts = (
            part[:, self._joints] * self._scale[:, None]
            for part in _power_partials(self._robot, motion)
        )
        return Partials(*parts)


class TotalPowerLimit(Limit):
    """Power that all joints together draw from a common supply, or return to it, over its limit.

    Parameters
    ----------
    robot : Robot
    """

    kind = "total_power"
    longer_time = "relieves"

    def __init__(self, robot: Robot) -> None:
        self._robot, self._figure = robot, robot.limits.total_power
        self.labels = (
            Label("all joints", "total power", "W", "robot.limits.total_power"),
        )
        self.lower, self.upper = -np.ones(1), np.ones(1)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return (Bound(0, self._figure, self._figure, 1.0 / self._figure),)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return _powers(self._robot, motion).sum(axis=1, keepdims=True) / self._figure

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        parts = _power_partials(self._robot, motion)
        return Partials(
            *(part.sum(axis=1, keepdims=True) / self._figure for part in parts)
        )


def _powers(robot: Robot, motion: JointMotion) -> np.ndarray:
    """Powers of all joints, (K, n), W."""
    return motion.torque(robot) * motion.qdot


def _power_partials(
    robot: Robot, motion: JointMotion
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differentiate the powers of all joints with respect to q, qdot, qddot, (K, n, n) each."""
    exact = motion.torque_derivatives(robot)
    by_q, by_qdot, by_qddot = (
        part * motion.qdot[:, :, None] for part in (exact.q, exact.qdot, exact.qddot)
    )
    every = np.arange(robot.n)
    by_qdot[:, every, every] += motion.torque(robot)
    return by_q, by_qdot, by_qddot


def build_power(robot: Robot, _task: Task) -> PowerLimit | None:
    """Build the limit for the joints with a finite power limit."""
    joints = np.flatnonzero(np.isfinite(robot.limits.power))
    return PowerLimit(robot, joints) if len(joints) else None


def build_total_power(robot: Robot, _task: Task) -> TotalPowerLimit | None:
    """Build the limit where there is one."""
    return TotalPowerLimit(robot) if np.isfinite(robot.limits.total_power) else None
