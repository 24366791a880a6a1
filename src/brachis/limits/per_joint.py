"""Limits of one number > 0 for each joint, as ratios in [-1, 1]."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits.protocol import Bound, Label, Limit
from brachis.robot import Robot


class JointRatioLimit(Limit):
    """A quantity of every limited joint over its limit; `kind` is also the key below ``robot.limits``.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    figures : (c,) ndarray
        Their limits.
    units : sequence of str
        Of the limits of all joints of the robot.
    """

    time_scaling = True

    def __init__(self, robot: Robot, joints: np.ndarray, figures: np.ndarray, units: Sequence[str]) -> None:
        self._joints, self._scale = joints, 1.0 / figures
        names = [robot.joint_names[i] for i in joints]
        self.labels = tuple(
            Label(name, self.name, units[i], f"robot.limits.{self.kind}.{name}")
            for i, name in zip(joints, names, strict=True)
        )
        self.lower, self.upper = -np.ones(len(joints)), np.ones(len(joints))
        self._bounds = tuple(Bound(c, limit, limit, 1.0 / limit) for c, limit in enumerate(figures.tolist()))

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return self._bounds
