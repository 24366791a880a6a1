"""Coupled joint ranges: lower <= q_a + q_b <= upper.

If an arm's third joint is driven through a parallelogram, the sum of two angles is limited in addition to the range of
each joint. A URDF cannot express that.
"""

from __future__ import annotations

import numpy as np

from brachis import Robot
from brachis.errors import UnknownNameError
from brachis.limits import JointStates, Label, Limit, Partials


class CoupledRange(Limit):
    """Range of the sum of two joint positions, rad. Its one value is the sum itself.

    A task gives it as ``custom_limits: {coupled_range: {joints: [a, b], lower: ..., upper: ...}}``.
    """

    kind = "coupled_range"
    at_rest = "turns"

    def __init__(self, joints: tuple[str, str], lower: float, upper: float) -> None:
        if len(joints) != 2 or joints[0] == joints[1]:
            raise ValueError(f"two different joints are coupled, found {list(joints)}")
        if not lower < upper:
            raise ValueError(f"lower must be below upper, found [{lower}, {upper}]")
        self.joints = tuple(joints)
        key = "custom_limits.coupled_range"
        self.labels = (Label(" + ".join(joints), "range", "rad", key),)
        self.lower, self.upper = np.array([lower]), np.array([upper])

    def bind(self, robot: Robot) -> CoupledRange:
        """Return the limit for a robot, whose joints are known only here."""
        names = robot.joint_names
        for name in self.joints:
            if name not in names:
                where = "custom_limits.coupled_range.joints"
                raise UnknownNameError("joint", name, names, where=where)
        bound = super().bind(robot)
        bound.weights = np.array([[float(name in self.joints) for name in names]])
        return bound

    def values(self, motion: JointStates) -> np.ndarray:
        """Compute the sum of the two positions, (K, 1)."""
        return motion.q @ self.weights.T

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate the sum with respect to q, (K, 1, n)."""
        shape = (len(motion.q), *self.weights.shape)
        return Partials(q=np.broadcast_to(self.weights, shape))
