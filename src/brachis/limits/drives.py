"""Limits of drives that are not one number for each joint: the total power, and torque limits that fall with speed.

The total power obeys |sum over the joints of tau qdot| <= P_total, written as a ratio in [-1, 1].

The limit |tau| <= T(|qdot|), with T piecewise linear and falling, is the same for driving and braking. Each joint with
such a curve has two values, which are ratios to its torque at rest T_0. T is rounded from below (`RoundedCurve`):

    (tau - T(qdot)) / T_0 <= 0,        (-tau - T(qdot)) / T_0 <= 0.

If the first part of a curve is level, it acts as a plain torque limit.

The rounded curve is twice continuously differentiable and nowhere above the given curve. Let m_k be the slopes between
the points of the curve, and w_k half the width of the rounding of the corner at speed v_k. As an even function of the
velocity v, the curve is

    T(v) = T(0) + sum_k (m_k - m_{k-1}) (r((v - v_k) / w_k) + r((-v - v_k) / w_k)) w_k,        m_{-1} = 0,

where r(y) w is the ramp max(x, 0), with x = w y, whose corner is rounded between y = -1 and 1. It is nowhere below the
ramp:

    r(y) = (3 + 8 y + 6 y^2 - y^4) / 16.

Where a curve falls more and more steeply, T lies below it. A corner after which the curve falls less steeply is first
moved to the left by w_k, along the line that follows it, so that the rounded part ends at the corner itself. The
rounded part is convex, and neither of its ends is above the curve, which is straight there. So the rounded curve is
nowhere above the given curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from brachis.common.labels import Label
from brachis.limits.joint import power_partials, powers
from brachis.limits.protocol import Bound, JointStates, Limit, Partials
from brachis.robot import Robot
from brachis.robot.limits import TorqueSpeedCurve
from brachis.task import LIMIT_KINDS, Task


class TotalPowerLimit(Limit):
    """Limit on the power that all joints together draw from a common supply, or return to it.

    Parameters
    ----------
    robot : Robot
    figure : float
        Maximum magnitude of the power, W.
    """

    kind = "total_power"
    longer_time = "relieves"

    def __init__(self, robot: Robot, figure: float) -> None:
        self._robot = robot
        self._figure = figure
        self.labels = (
            Label("all joints", self.name, "W", f"robot.limits.{self.kind}"),
        )
        self.lower = -np.ones(1)
        self.upper = np.ones(1)
        self.bounds = (Bound(0, figure, figure, 1.0 / figure),)

    @classmethod
    def build(cls, robot: Robot, _task: Task) -> Self | None:
        """Build the limit; None if the robot has no such limit."""
        figure = robot.limits.total_power
        return cls(robot, figure) if np.isfinite(figure) else None

    def values(self, motion: JointStates) -> np.ndarray:
        return powers(self._robot, motion).sum(axis=1, keepdims=True) / self._figure

    def partials(self, motion: JointStates) -> Partials:
        return power_partials(self._robot, motion).map(
            lambda slopes: slopes.sum(axis=1, keepdims=True) / self._figure
        )


WIDTH = 0.002
"""Half the width of a rounded corner, as a fraction of the shorter of the two pieces next to the corner."""


@dataclass(frozen=True)
class RoundedCurve:
    """An even function of the velocity that lies below a curve.

    Attributes
    ----------
    stall_torque : float
        Value that the curve would have at velocity 0 if the corner there were not rounded.
    corners : (k,) ndarray
        Speeds of the corners, rad/s or m/s.
    widths : (k,) ndarray
        Half-widths of the rounded corners.
    bends : (k,) ndarray
        Changes of slope at the corners.
    """

    stall_torque: float
    corners: np.ndarray
    widths: np.ndarray
    bends: np.ndarray

    @classmethod
    def below(cls, curve: TorqueSpeedCurve) -> RoundedCurve | None:
        """Round a curve; return None for a curve that does not fall.

        The last slope of the curve continues until the torque is zero. If the curve begins with a level part, this part
        is left out, and the next piece is extended to speed 0: the level part itself is a plain torque limit.
        """
        speed, torque = np.array(curve).T
        slope = np.diff(torque) / np.diff(speed)
        has_torque = torque[-1] > 1e-9 * torque[0]
        if slope[-1] < 0.0 and has_torque:
            speed = np.append(speed, speed[-1] - torque[-1] / slope[-1])
            torque = np.append(torque, 0.0)
            slope = np.append(slope, slope[-1])
        if not np.any(slope < 0.0):
            return None
        first = int(np.argmax(slope < 0.0))
        lengths = np.diff(speed)
        slope = np.append(slope, 0.0)
        before = np.append(lengths[0], lengths)
        widths = WIDTH * np.minimum(before, np.append(lengths, lengths[-1]))
        moved = np.where(np.diff(slope, prepend=0.0) > 0.0, widths, 0.0)
        speed = speed - moved
        torque = torque - slope * moved
        slope = np.append(np.diff(torque) / np.diff(speed), 0.0)[first:]
        corners = np.append(0.0, speed[first + 1 :])
        stall_torque = torque[first] - slope[0] * speed[first]
        return cls(stall_torque, corners, widths[first:], np.diff(slope, prepend=0.0))

    def _distances(self, velocity: np.ndarray) -> np.ndarray:
        """Return by how much velocities, (K,), and their negatives exceed the speeds of the corners, (2, K, k)."""
        return np.array([velocity, -velocity])[..., None] - self.corners

    def values(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate the curve at velocities, (K,)."""
        x = self._distances(velocity)
        y = np.clip(x / self.widths, -1.0, 1.0)
        rounded = self.widths * (3.0 + y * (8.0 + y * (6.0 - y * y))) / 16.0
        ramp = rounded + np.maximum(x - self.widths, 0.0)
        return self.stall_torque + (ramp @ self.bends).sum(axis=0)

    def slopes(self, velocity: np.ndarray) -> np.ndarray:
        """Differentiate `values` with respect to the velocities, (K,)."""
        y = np.clip(self._distances(velocity) / self.widths, -1.0, 1.0)
        forward, backward = (2.0 + y * (3.0 - y * y)) @ self.bends / 4.0
        return forward - backward


class TorqueSpeedLimit(Limit):
    """Limits on torques in both directions, relative to the torque-speed curves of the joints.

    Parameters
    ----------
    robot : Robot
    curves : dict of int to RoundedCurve
        The curves, by the index of the joint.
    """

    kind = "torque_speed"
    longer_time = "relieves"

    def __init__(self, robot: Robot, curves: dict[int, RoundedCurve]) -> None:
        self._robot = robot
        self._curves = tuple(curves.values())
        self._joints = np.repeat(list(curves), 2)
        self._signs = np.tile([1.0, -1.0], len(curves))
        stall_torques = [
            robot.limits.torque_speed[joint][0][1] for joint in self._joints
        ]
        self._stall_torques = np.array(stall_torques)
        row = LIMIT_KINDS["torque"]
        labels = []
        for joint in curves:
            name = robot.joint_names[joint]
            unit = robot.position_units[joint]
            torque = row.in_words(unit)
            labels += [
                Label(
                    f"{name} {sign}",
                    f"{torque} at speed",
                    row.units[unit],
                    f"robot.limits.torque_speed.{name}",
                    active_text=f"{name} is on its {torque}-speed curve with {sign} {torque}",
                    slack_text=f"{sign} {torque} all along the curve of {name}",
                )
                for sign in ("positive", "negative")
            ]
        self.labels = tuple(labels)
        self.lower = np.full(len(stall_torques), -np.inf)
        self.upper = np.zeros(len(stall_torques))
        # The whole curve is scaled with the torque at rest.
        self.bounds = tuple(
            Bound(column, level, level, 1.0 / level, "upper")
            for column, level in enumerate(stall_torques)
        )

    def _by_curve(
        self,
        function: Callable[[RoundedCurve, np.ndarray], np.ndarray],
        motion: JointStates,
    ) -> np.ndarray:
        """Evaluate a function of each curve and the velocities of its joint, (K, c)."""
        qdot = motion.qdot[:, self._joints[::2]].T
        pairs = zip(self._curves, qdot, strict=True)
        return np.repeat([function(*pair) for pair in pairs], 2, axis=0).T

    def values(self, motion: JointStates) -> np.ndarray:
        """Compute by how much torques exceed the curves at their velocities, divided by the torques at rest, (K, c)."""
        tau = motion.torque(self._robot)[:, self._joints]
        allowed = self._by_curve(RoundedCurve.values, motion)
        excess = self._signs * tau - allowed
        return excess / self._stall_torques

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate the values with respect to q, qdot and qddot, (K, c, n) each."""
        scale = (self._signs / self._stall_torques)[:, None]
        by_q, by_qdot, by_qddot = (
            derivatives[:, self._joints] * scale
            for derivatives in motion.torque_derivatives(self._robot)
        )
        every = np.arange(len(self._joints))
        slopes = self._by_curve(RoundedCurve.slopes, motion)
        by_qdot[:, every, self._joints] -= slopes / self._stall_torques
        return Partials(by_q, by_qdot, by_qddot)


def build_torque_speed(robot: Robot, _task: Task) -> TorqueSpeedLimit | None:
    """Build the limit; None if the torque of no joint falls with its speed."""
    rounded = {
        joint: RoundedCurve.below(curve)
        for joint, curve in enumerate(robot.limits.torque_speed)
        if curve
    }
    falling = {joint: curve for joint, curve in rounded.items() if curve is not None}
    return TorqueSpeedLimit(robot, falling) if falling else None
