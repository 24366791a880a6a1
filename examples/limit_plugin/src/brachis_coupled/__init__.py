"""Coupled joint ranges: lower <= q_a + q_b <= upper.

Arms whose third joint is driven through a parallelogram keep the sum of two angles within a range of its own, beside
the ranges of the joints; a URDF has no word for it.
"""

from __future__ import annotations

import numpy as np

from brachis import Robot
from brachis.errors import UnknownNameError
from brachis.limits import JointStates, Label, Limit, Partials


class CoupledRange:
    """Range of the sum of two joints' positions, rad; what a task gives as ``custom_limits: {coupled_range: ...}``."""

    def __init__(self, joints: tuple[str, str], lower: float, upper: float) -> None:
        if len(joints) != 2 or joints[0] == joints[1]:
            raise ValueError(f"two different joints are coupled, found {list(joints)}")
        if not lower < upper:
            raise ValueError(f"lower must be below upper, found [{lower}, {upper}]")
        self.joints, self.lower, self.upper = tuple(joints), lower, upper

    def bind(self, robot: Robot) -> BoundRange:
        """Return the limit for a robot."""
        for name in self.joints:
            if name not in robot.joint_names:
                raise UnknownNameError(
                    "joint",
                    name,
                    robot.joint_names,
                    where="custom_limits.coupled_range.joints",
                )
        return BoundRange(self, robot)


class BoundRange(Limit):
    """A `CoupledRange` on a robot: one value, the sum itself, in rad."""

    kind = "coupled_range"
    at_rest = "turns"

    def __init__(self, given: CoupledRange, robot: Robot) -> None:
        subject = " + ".join(given.joints)
        self.labels = (Label(subject, "range", "rad", "custom_limits.coupled_range"),)
        self.lower, self.upper = np.array([given.lower]), np.array([given.upper])
        self._sum = np.array(
            [[float(name in given.joints) for name in robot.joint_names]]
        )

    def values(self, motion: JointStates) -> np.ndarray:
        """Sum of the two positions, (K, 1)."""
        return motion.q @ self._sum.T

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate the sum."""
        return Partials(q=np.broadcast_to(self._sum, (len(motion.q), *self._sum.shape)))
