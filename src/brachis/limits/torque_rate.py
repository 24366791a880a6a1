"""|dtau/dt| <= rate_max, as a ratio in [-1, 1].

    dtau/dt = tau_q qdot + tau_v qddot + M qdddot

with the derivatives of the torque by q, qdot and qddot. Its own derivatives are, with D for d/dt along the motion,

    by q: D(tau_q),   by qdot: D(tau_v) + tau_q,   by qddot: D(M) + tau_v,   by qdddot: M

where D is taken by differences.
"""

from __future__ import annotations

import numpy as np

from brachis.arrays import rates
from brachis.limits.per_joint import JointRatioLimit
from brachis.limits.protocol import JointMotion, Partials
from brachis.robot import Robot, dynamics
from brachis.task import Task


class TorqueRateLimit(JointRatioLimit):
    """Rates of joint torques over their limits.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    kind = "torque_rate"
    order = 3

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        units = [f"{unit}/s" for unit in robot.torque_units]
        super().__init__(robot, joints, robot.limits.torque_rate[joints], units)
        self._robot = robot

    def _slopes(self, exact: dynamics.TorqueDerivatives) -> tuple[np.ndarray, ...]:
        """Differentiate the torque over the limits by q, qdot and qddot, (K, c, n) each."""
        parts = (exact.q, exact.qdot, exact.qddot)
        return tuple(part[:, self._joints] * self._scale[:, None] for part in parts)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        slopes = self._slopes(motion.torque_derivatives(self._robot))
        pairs = zip(slopes, (motion.qdot, motion.qddot, motion.qdddot), strict=True)
        return np.asarray(sum(np.einsum("kcj,kj->kc", slope, part) for slope, part in pairs))

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        by_q, by_qdot, by_qddot = self._slopes(motion.torque_derivatives(self._robot))
        whole = motion.q, motion.qdot, motion.qddot, motion.qdddot

        def slopes(q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, _: np.ndarray) -> tuple[np.ndarray, ...]:
            return self._slopes(dynamics.torque_derivatives(self._robot, q, qdot, qddot))

        q, qdot, qddot = rates(slopes, whole)
        return Partials(q, qdot + by_q, qddot + by_qdot, by_qddot)


def build_torque_rate(robot: Robot, _task: Task) -> TorqueRateLimit | None:
    """Build the limit for the joints with a finite limit of the torque's rate."""
    joints = np.flatnonzero(np.isfinite(robot.limits.torque_rate))
    return TorqueRateLimit(robot, joints) if len(joints) else None
