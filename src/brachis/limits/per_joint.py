"""Limits below and above zero for each joint, as (value - middle) / half the way between them, in [-1, 1].

With the same limit in both directions that is the ratio to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits.protocol import Bound, Label, Limit
from brachis.robot import Robot


def in_words(quantity: str, position_unit: str) -> str:
    """Name a joint's quantity: what is a torque of a revolute joint (rad) is a force of a prismatic one (m)."""
    return quantity if position_unit == "rad" else quantity.replace("torque", "force")


class JointRatioLimit(Limit):
    """A quantity of every limited joint over its limit; `kind` is also the key below ``robot.limits``.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    figures : (c,) or (2, c) ndarray
        Their limits, the same in both directions; or lower and upper ones.
    units : sequence of str
        Of the limits of all joints of the robot.
    """

    time_scaling = True

    def __init__(self, robot: Robot, joints: np.ndarray, figures: np.ndarray, units: Sequence[str]) -> None:
        low, high = self._figures = figures if figures.ndim > 1 else np.array([-figures, figures])
        self._joints, self._middle, self._scale = joints, 0.5 * (high + low), 2.0 / (high - low)
        self.labels = tuple(
            Label(name, in_words(self.name, position_unit), units[i], f"robot.limits.{self.kind}.{name}")
            for i, name, position_unit in ((i, robot.joint_names[i], robot.position_units[i]) for i in joints)
        )
        self.lower, self.upper = -np.ones(len(joints)), np.ones(len(joints))
        self._violation_scale = 0.5 * (high - low) / np.minimum(high, -low)
        self._bounds = tuple(
            Bound(column, figure, abs(figure), float(self._scale[column]), end)
            for column, (below, above) in enumerate(zip(low.tolist(), high.tolist(), strict=True))
            for end, figure in (((None, above),) if -below == above else (("lower", below), ("upper", above)))
        )

    def _normalised(self, quantity: np.ndarray) -> np.ndarray:
        """Values, (K, c), from a quantity of all joints, (K, n)."""
        return np.asarray((quantity[:, self._joints] - self._middle) * self._scale)

    @property
    def violation_scale(self) -> np.ndarray:
        """See `Limit`: a violation is a part of the smaller one of both limits."""
        return self._violation_scale

    @property
    def centre(self) -> np.ndarray:
        """See `Limit`: where the quantity is zero."""
        return np.asarray(-self._middle * self._scale)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return self._bounds
