"""q_min <= q <= q_max, as (q - middle) / half range in [-1, 1]; an open range is measured in rad or m."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import Decomposition, JointState
from brachis.nlp.constraints.protocol import Partials


class PositionConstraint:
    """Joint positions within their ranges."""

    kind = "position"
    timed = False
    physical = True

    def __init__(self, decomposition: Decomposition, joints: np.ndarray) -> None:
        robot = decomposition.robot
        low, high = robot.limits.position_lower[joints], robot.limits.position_upper[joints]
        closed = np.isfinite(low) & np.isfinite(high)
        half = np.where(closed, 0.5 * np.where(closed, high - low, 0.0), 1.0)
        self._middle = np.where(closed, 0.5 * np.where(closed, low + high, 0.0), 0.0)
        self._joints = joints
        self._selection = np.eye(robot.n)[joints] / half[:, None]
        self._scale = 1.0 / half
        self.labels = tuple(robot.joint_names[i] for i in joints)
        self.lower, self.upper = (low - self._middle) / half, (high - self._middle) / half

    def values(self, state: JointState) -> np.ndarray:
        """See `Constraint.values`."""
        return (state.q[:, self._joints] - self._middle) * self._scale

    def partials(self, state: JointState) -> Partials:
        """See `Constraint.partials`."""
        return Partials(q=np.broadcast_to(self._selection, (len(state.q), *self._selection.shape)))


def build(decomposition: Decomposition, _margin: float) -> PositionConstraint | None:
    """Build the constraint for the joints with a finite end of range."""
    limits = decomposition.robot.limits
    joints = np.flatnonzero(np.isfinite(limits.position_lower) | np.isfinite(limits.position_upper))
    return PositionConstraint(decomposition, joints) if len(joints) else None
