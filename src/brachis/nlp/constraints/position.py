"""q_min <= q <= q_max, as (q - middle) / half range in [-1, 1]; wide and open ranges are measured in rad or m."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import Decomposition, JointState
from brachis.nlp.constraints.protocol import Partials

WIDE = 10.0
"""Ranges whose half is larger count as open ones do, in rad or m: half of a far range is no measure at its near end."""
_LEAST_HALF, _LARGEST_HALF = 1e-5, 1.0
"""An excess of 1 is half the range, but between these, rad or m, so that each end is judged by itself."""


class PositionConstraint:
    """Joint positions within their ranges."""

    kind = "position"
    timed = False
    physical = True

    def __init__(self, decomposition: Decomposition, joints: np.ndarray) -> None:
        robot = decomposition.robot
        low, high = robot.limits.position_lower[joints], robot.limits.position_upper[joints]
        half = 0.5 * high - 0.5 * low
        ranged = half <= WIDE
        per_row = np.where(ranged, half, 1.0)
        with np.errstate(invalid="ignore"):  # -inf + inf
            self._middle = np.where(ranged, 0.5 * low + 0.5 * high, 0.0)
        self._joints = joints
        self._selection = np.eye(robot.n)[joints] / per_row[:, None]
        self._scale = 1.0 / per_row
        self.labels = tuple(robot.joint_names[i] for i in joints)
        self.lower, self.upper = (low - self._middle) / per_row, (high - self._middle) / per_row
        self.excess_scale = per_row / np.clip(half, _LEAST_HALF, _LARGEST_HALF)

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
