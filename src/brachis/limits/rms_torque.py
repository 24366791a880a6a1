"""Root mean square of the torque over the whole motion, which heats a motor: the mean of (tau / tau_rms)^2 <= 1."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.limits.per_joint import JointRatioLimit
from brachis.limits.protocol import Bound, JointMotion, Partials
from brachis.robot import Robot
from brachis.task import Task


class RmsTorqueLimit(JointRatioLimit):
    """Squares of joint torques over their limits; their means over time are held.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    kind = "rms_torque"
    where = "whole"

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        super().__init__(robot, joints, robot.limits.rms_torque[joints], robot.torque_units)
        self._robot = robot
        self.lower = np.full(len(joints), -np.inf)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: a figure moves its square, to first order by twice as much."""
        return tuple(replace(bound, per_unit=2.0 * bound.per_unit) for bound in super().bounds)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        tau = motion.torque(self._robot)
        return self._normalised(tau) ** 2

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        tau = motion.torque(self._robot)[:, self._joints]
        exact = motion.torque_derivatives(self._robot)
        factors = (2.0 * tau * self._scale**2)[:, :, None]
        return Partials(*(factors * part[:, self._joints] for part in (exact.q, exact.qdot, exact.qddot)))

    def violation(self, values: np.ndarray) -> np.ndarray:
        """See `Limit.violation`: of the root mean square itself."""
        return np.asarray(np.sqrt(np.maximum(values, 0.0)) - np.sqrt(self.upper))

    def ratio(self, values: np.ndarray) -> np.ndarray:
        """See `Limit.ratio`: of the root mean square itself."""
        return np.asarray(np.sqrt(np.maximum(values, 0.0) / self.upper))


def build_rms_torque(robot: Robot, _task: Task) -> RmsTorqueLimit | None:
    """Build the limit for the joints that have one."""
    joints = np.flatnonzero(np.isfinite(robot.limits.rms_torque))
    return RmsTorqueLimit(robot, joints) if len(joints) else None
