"""|tau| <= tau_max, as tau / tau_max in [-1, 1]."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import Decomposition, JointState
from brachis.nlp.constraints.protocol import Partials
from brachis.robot import dynamics


class TorqueConstraint:
    """Joint torques over their limits."""

    kind = "torque"
    timed = True
    physical = True

    def __init__(self, decomposition: Decomposition, joints: np.ndarray) -> None:
        self._robot = decomposition.robot
        self._joints = joints
        self._scale = 1.0 / self._robot.limits.torque[joints]
        self.labels = tuple(self._robot.joint_names[i] for i in joints)
        self.lower, self.upper = -np.ones(len(joints)), np.ones(len(joints))
        self.excess_scale = np.ones(len(joints))

    def values(self, state: JointState) -> np.ndarray:
        """See `Constraint.values`."""
        return dynamics.torque(self._robot, state.q, state.qdot, state.qddot)[:, self._joints] * self._scale

    def partials(self, state: JointState) -> Partials:
        """See `Constraint.partials`."""
        exact = dynamics.torque_derivatives(self._robot, state.q, state.qdot, state.qddot)
        parts = (part[:, self._joints] * self._scale[:, None] for part in (exact.q, exact.qdot, exact.qddot))
        return Partials(*parts)


def build(decomposition: Decomposition, _margin: float) -> TorqueConstraint | None:
    """Build the constraint for the joints with a finite torque limit."""
    joints = np.flatnonzero(np.isfinite(decomposition.robot.limits.torque))
    return TorqueConstraint(decomposition, joints) if len(joints) else None
