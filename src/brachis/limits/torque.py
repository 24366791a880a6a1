"""Joint torques between tau_min and tau_max."""

from __future__ import annotations

import numpy as np

from brachis.limits.per_joint import JointRatioLimit
from brachis.limits.protocol import JointMotion, Partials, PhaseLines
from brachis.robot import Robot, dynamics
from brachis.task import Task


class TorqueLimit(JointRatioLimit):
    """Joint torques within their limits.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    kind = "torque"
    static = True
    refusal = "cannot hold the arm against gravity"

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        super().__init__(robot, joints, robot.limits.both_ways("torque")[:, joints], robot.torque_units)
        self._robot = robot

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.torque(self._robot))

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        exact = motion.torque_derivatives(self._robot)
        parts = (part[:, self._joints] * self._scale[:, None] for part in (exact.q, exact.qdot, exact.qddot))
        return Partials(*parts)

    def lines(self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray) -> PhaseLines:  # noqa: ARG002
        """See `Limit.lines`: a = M q_ds, b = M q_dds + C(q, q_ds) q_ds, c the torque at rest; no velocity friction."""
        robot, still = self._robot, np.zeros_like(q)
        held = dynamics.rigid_torque(robot, q, still, still)
        by_u = dynamics.rigid_torque(robot, q, still, q_ds) - held + robot.friction.armature * q_ds
        by_x = dynamics.rigid_torque(robot, q, q_ds, q_dds) - held + robot.friction.armature * q_dds
        slope, curve = (part[:, self._joints] * self._scale for part in (by_u, by_x))
        return PhaseLines(slope, curve, self._normalised(held))

    def step_rows(self, q: np.ndarray) -> tuple[np.ndarray, None]:
        """See `Limit.step_rows`: M over half the way between both limits."""
        return dynamics.mass_matrices(self._robot, q)[:, self._joints] * self._scale[:, None], None


def build_torque(robot: Robot, _task: Task) -> TorqueLimit | None:
    """Build the limit for the joints with a finite torque limit."""
    joints = np.flatnonzero(np.isfinite(robot.limits.torque_upper))
    return TorqueLimit(robot, joints) if len(joints) else None
