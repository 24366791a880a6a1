"""|tau| <= T(|qdot|) with T piecewise linear, concave and falling.

A piece T = a - b |qdot| holds for torque and speed of either sign, driving and braking alike, as two values in [-1, 1]:

    (tau + b qdot) / a,        (tau - b qdot) / a.

The level piece of a curve is the plain torque limit.
"""

from __future__ import annotations

import itertools

import numpy as np

from brachis.limits.per_joint import in_words
from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials
from brachis.robot import Robot
from brachis.task import Task


class TorqueSpeedLimit(Limit):
    """Torques and speeds over the falling pieces of the joints' curves.

    Parameters
    ----------
    robot : Robot
        With at least one such piece.
    """

    kind = "torque_speed"
    time_scaling = True

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        pieces = [
            (joint, v, tau + slope * v, slope, sign, curve[0][1])
            for joint, curve in enumerate(robot.limits.torque_speed)
            for (v, tau), slope in _falling(curve)
            for sign in (1.0, -1.0)
        ]
        joint, speed, level, slope, sign, at_rest = (np.array(column) for column in zip(*pieces, strict=True))
        self._joints, self._level, self._slope = joint.astype(int), level, sign * slope
        # Measured by the torque at rest, as a user would.
        self._violation_scale = level / at_rest
        self.labels = tuple(self._label(*piece) for piece in zip(self._joints, speed, sign, strict=True))
        self.lower, self.upper = -np.ones(len(pieces)), np.ones(len(pieces))

    def _label(self, joint: int, speed: float, sign: float) -> Label:
        name, unit = self._robot.joint_names[joint], self._robot.position_units[joint]
        subject = f"{name} {'driving' if sign > 0.0 else 'braking'} from {speed:g} {unit}/s"
        return Label(
            subject,
            in_words("torque at speed", unit),
            self._robot.torque_units[joint],
            f"robot.limits.torque_speed.{name}",
        )

    @property
    def violation_scale(self) -> np.ndarray:
        """See `Limit`."""
        return self._violation_scale

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: the torque at which the piece meets speed 0."""
        return tuple(Bound(column, level, level, 1.0 / level) for column, level in enumerate(self._level.tolist()))

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        tau = motion.torque(self._robot)
        return (tau[:, self._joints] + self._slope * motion.qdot[:, self._joints]) / self._level

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        exact = motion.torque_derivatives(self._robot)
        by_q, by_qdot, by_qddot = (part[:, self._joints] for part in (exact.q, exact.qdot, exact.qddot))
        by_qdot[:, np.arange(len(self._joints)), self._joints] += self._slope
        return Partials(*(part / self._level[:, None] for part in (by_q, by_qdot, by_qddot)))


def _falling(curve: tuple[tuple[float, float], ...]) -> list[tuple[tuple[float, float], float]]:
    """Beginnings of the falling pieces of a curve, and how much torque each loses per unit of speed."""
    pairs = itertools.pairwise(curve)
    slopes = [(first, (first[1] - second[1]) / (second[0] - first[0])) for first, second in pairs]
    return [(first, slope) for first, slope in slopes if slope > 0.0]


def build(robot: Robot, _task: Task) -> TorqueSpeedLimit | None:
    """Build the limit where a joint's torque falls with its speed."""
    return TorqueSpeedLimit(robot) if any(_falling(curve) for curve in robot.limits.torque_speed) else None
