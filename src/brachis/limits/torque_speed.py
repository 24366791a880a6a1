"""|tau| <= T(|qdot|) with T piecewise linear and falling, driving and braking alike.

Two values for each joint with such a curve, over its torque at rest, with T rounded from below (`RoundedCurve`):

    (tau - T(qdot)) / T_0 <= 0,        (-tau - T(qdot)) / T_0 <= 0.

A curve that begins level is there the plain torque limit.
"""

from __future__ import annotations

import numpy as np

from brachis.limits.per_joint import in_words
from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials
from brachis.limits.rounded_curve import RoundedCurve
from brachis.robot import Robot
from brachis.task import Task


class TorqueSpeedLimit(Limit):
    """Torques in both directions over the joints' curves.

    Parameters
    ----------
    robot : Robot
    curves : dict of int to RoundedCurve
        Those of the joints that have one, by index.
    """

    kind = "torque_speed"
    time_scaling = True

    def __init__(self, robot: Robot, curves: dict[int, RoundedCurve]) -> None:
        self._robot, self._curves = robot, tuple(curves.values())
        self._joints = np.repeat(list(curves), 2)
        self._signs = np.tile([1.0, -1.0], len(curves))
        self._at_rest = np.array([robot.limits.torque_speed[joint][0][1] for joint in self._joints])
        self.labels = tuple(self._label(*row) for row in zip(self._joints, self._signs, strict=True))
        self.lower, self.upper = np.full(len(self._joints), -np.inf), np.zeros(len(self._joints))

    def _label(self, joint: int, sign: float) -> Label:
        name, unit = self._robot.joint_names[joint], self._robot.position_units[joint]
        side, torque = "positive" if sign > 0.0 else "negative", in_words("torque", unit)
        return Label(
            f"{name} {side}",
            in_words("torque at speed", unit),
            self._robot.torque_units[joint],
            f"robot.limits.torque_speed.{name}",
            f"{name} is on its {torque}-speed curve with {side} {torque}",
            f"{side} {torque} all along the curve of {name}",
        )

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: the torque at rest, with which the whole curve rises."""
        levels = enumerate(self._at_rest.tolist())
        return tuple(Bound(column, level, level, 1.0 / level, "upper") for column, level in levels)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        tau, qdot = (part[:, self._joints] for part in (motion.torque(self._robot), motion.qdot))
        allowed = [curve.values(part) for curve, part in zip(self._curves, qdot.T[::2], strict=True)]
        return np.asarray((self._signs * tau - np.repeat(allowed, 2, axis=0).T) / self._at_rest)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        exact, scale = motion.torque_derivatives(self._robot), (self._signs / self._at_rest)[:, None]
        by_q, by_qdot, by_qddot = (part[:, self._joints] * scale for part in (exact.q, exact.qdot, exact.qddot))
        qdot = motion.qdot[:, self._joints[::2]]
        slopes = [curve.slopes(part) for curve, part in zip(self._curves, qdot.T, strict=True)]
        by_qdot[:, np.arange(len(self._joints)), self._joints] -= np.repeat(slopes, 2, axis=0).T / self._at_rest
        return Partials(by_q, by_qdot, by_qddot)


def build_torque_speed(robot: Robot, _task: Task) -> TorqueSpeedLimit | None:
    """Build the limit where a joint's torque falls with its speed."""
    rounded = {joint: RoundedCurve.below(curve) for joint, curve in enumerate(robot.limits.torque_speed) if curve}
    falling = {joint: curve for joint, curve in rounded.items() if curve is not None}
    return TorqueSpeedLimit(robot, falling) if falling else None
