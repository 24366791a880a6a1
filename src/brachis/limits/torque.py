"""Joint torques between tau_min and tau_max.

|dtau/dt| <= rate_max, as a ratio in [-1, 1].

    dtau/dt = tau_q qdot + tau_v qddot + M qdddot

with the derivatives of the torque by q, qdot and qddot. Its own derivatives are, with D for d/dt along the motion,

    by q: D(tau_q),   by qdot: D(tau_v) + tau_q,   by qddot: D(M) + tau_v,   by qdddot: M

where D is taken by differences.

|tau| <= T(|qdot|) with T piecewise linear and falling, driving and braking alike.

Two values for each joint with such a curve, over its torque at rest, with T rounded from below (`RoundedCurve`):

    (tau - T(qdot)) / T_0 <= 0,        (-tau - T(qdot)) / T_0 <= 0.

A curve that begins level is there the plain torque limit.

A piecewise linear curve that falls, made twice continuously differentiable from below.

With slopes m_k between the points of the curve, w_k half the width of the rounding of a corner at speed v_k, and the
curve taken as an even function of the velocity v,

    T(v) = T(0) + sum_k (m_k - m_{k-1}) (r((v - v_k) / w_k) + r((-v - v_k) / w_k)) w_k,        m_{-1} = 0,

where r(y) w is the ramp max(x, 0), x = w y, with its corner rounded between y = -1 and 1, nowhere below the ramp:

    r(y) = (3 + 8 y + 6 y^2 - y^4) / 16.

Where a curve falls ever more steeply this lies below it. A corner behind which it falls less steeply is first moved to
the left by w_k, on the line that follows it: the rounded part then ends at the corner itself. It is convex and neither
of its ends is above the curve, which is straight there; so nowhere is it above.

Root mean square of the torque over the whole motion, which heats a motor: the mean of (tau / tau_rms)^2 <= 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brachis.common.arrays import rates
from brachis.limits.joint import JointRatioLimit, in_words
from brachis.limits.protocol import (
    Bound,
    Guarantee,
    JointMotion,
    Label,
    Limit,
    Partials,
    PhaseLines,
)
from brachis.robot import Robot, dynamics
from brachis.robot.torque_curves import Curve
from brachis.task import Task


class TorqueLimit(JointRatioLimit):
    """Joint torques within their limits.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    kind = "torque"
    at_rest = "posture"
    refusal = "cannot hold the arm against gravity"

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        super().__init__(
            robot,
            joints,
            robot.limits.both_ways("torque")[:, joints],
            robot.torque_units,
        )
        self._robot = robot

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.torque(self._robot))

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        exact = motion.torque_derivatives(self._robot)
        parts = (
            part[:, self._joints] * self._scale[:, None]
            for part in (exact.q, exact.qdot, exact.qddot)
        )
        return Partials(*parts)

    def lines(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhaseLines:
        """See `Limit.lines`: a = M q_ds, b = M q_dds + C(q, q_ds) q_ds, c the torque at rest; no velocity friction."""
        robot, still = self._robot, np.zeros_like(q)
        held = dynamics.rigid_torque(robot, q, still, still)
        by_u = (
            dynamics.rigid_torque(robot, q, still, q_ds)
            - held
            + robot.friction.armature * q_ds
        )
        by_x = (
            dynamics.rigid_torque(robot, q, q_ds, q_dds)
            - held
            + robot.friction.armature * q_dds
        )
        slope, curve = (part[:, self._joints] * self._scale for part in (by_u, by_x))
        return PhaseLines(slope, curve, self._normalised(held))

    def step_rows(self, q: np.ndarray) -> tuple[np.ndarray, None]:
        """See `Limit.step_rows`: M over half the way between both limits."""
        return dynamics.mass_matrices(self._robot, q)[:, self._joints] * self._scale[
            :, None
        ], None


def build_torque(robot: Robot, _task: Task) -> TorqueLimit | None:
    """Build the limit for the joints with a finite torque limit."""
    joints = np.flatnonzero(np.isfinite(robot.limits.torque_upper))
    return TorqueLimit(robot, joints) if len(joints) else None


class TorqueRateLimit(JointRatioLimit):
    """Rates of joint torques over their limits.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    kind = "torque_rate"
    order = 3

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        units = [f"{unit}/s" for unit in robot.torque_units]
        super().__init__(robot, joints, robot.limits.torque_rate[joints], units)
        self._robot = robot

    def _slopes(self, exact: dynamics.TorqueDerivatives) -> tuple[np.ndarray, ...]:
        """Differentiate the torque over the limits by q, qdot and qddot, (K, c, n) each."""
        parts = (exact.q, exact.qdot, exact.qddot)
        return tuple(part[:, self._joints] * self._scale[:, None] for part in parts)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        slopes = self._slopes(motion.torque_derivatives(self._robot))
        pairs = zip(slopes, (motion.qdot, motion.qddot, motion.qdddot), strict=True)
        return np.asarray(
            sum(np.einsum("kcj,kj->kc", slope, part) for slope, part in pairs)
        )

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        by_q, by_qdot, by_qddot = self._slopes(motion.torque_derivatives(self._robot))
        whole = motion.q, motion.qdot, motion.qddot, motion.qdddot

        def slopes(
            q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, _: np.ndarray
        ) -> tuple[np.ndarray, ...]:
            return self._slopes(
                dynamics.torque_derivatives(self._robot, q, qdot, qddot)
            )

        q, qdot, qddot = rates(slopes, whole)
        return Partials(q, qdot + by_q, qddot + by_qdot, by_qddot)


def build_torque_rate(robot: Robot, _task: Task) -> TorqueRateLimit | None:
    """Build the limit for the joints with a finite limit of the torque's rate."""
    joints = np.flatnonzero(np.isfinite(robot.limits.torque_rate))
    return TorqueRateLimit(robot, joints) if len(joints) else None


WIDTH = 0.002
"""Half the width of a rounded corner, as a part of the shorter one of the pieces beside it."""
_NOTHING = 1e-9
"""Of the torque at rest: so little counts as none, and need not fall any further."""


@dataclass(frozen=True)
class RoundedCurve:
    """An even function of the velocity that lies below a curve.

    Attributes
    ----------
    at_rest : float
        Value at velocity 0, were the corner there not rounded.
    corners : (k,) ndarray
        Speeds of the corners, rad/s or m/s.
    widths : (k,) ndarray
        Half the widths of their rounding.
    bends : (k,) ndarray
        Changes of slope.
    """

    at_rest: float
    corners: np.ndarray
    widths: np.ndarray
    bends: np.ndarray

    @classmethod
    def below(cls, curve: Curve) -> RoundedCurve | None:
        """Round a curve; None where it does not fall.

        Its last slope goes on until no torque is left. A level beginning is left out, and the piece that follows it
        goes on to speed 0: the level itself is a plain torque limit.
        """
        speed, torque = np.array(curve).T
        slope = np.diff(torque) / np.diff(speed)
        if slope[-1] < 0.0 and torque[-1] > _NOTHING * torque[0]:
            speed, torque = (
                np.append(speed, speed[-1] - torque[-1] / slope[-1]),
                np.append(torque, 0.0),
            )
            slope = np.append(slope, slope[-1])
        if not np.any(slope < 0.0):
            return None
        first = int(np.argmax(slope < 0.0))
        lengths, slope = np.diff(speed), np.append(slope, 0.0)
        widths = WIDTH * np.minimum(
            np.append(lengths[0], lengths), np.append(lengths, lengths[-1])
        )
        moved = np.where(np.diff(slope, prepend=0.0) > 0.0, widths, 0.0)
        speed, torque = speed - moved, torque - slope * moved
        slope = np.append(np.diff(torque) / np.diff(speed), 0.0)[first:]
        corners = np.append(0.0, speed[first + 1 :])
        return cls(
            torque[first] - slope[0] * speed[first],
            corners,
            widths[first:],
            np.diff(slope, prepend=0.0),
        )

    def values(self, velocity: np.ndarray) -> np.ndarray:
        """Values (K,) at velocities (K,)."""
        x = np.array([velocity, -velocity])[..., None] - self.corners
        y = np.clip(x / self.widths, -1.0, 1.0)
        ramp = self.widths * (3.0 + y * (8.0 + y * (6.0 - y * y))) / 16.0 + np.maximum(
            x - self.widths, 0.0
        )
        return np.asarray(self.at_rest + (ramp @ self.bends).sum(axis=0))

    def slopes(self, velocity: np.ndarray) -> np.ndarray:
        """Differentiate `values` by the velocities, (K,)."""
        y = np.clip(
            (np.array([velocity, -velocity])[..., None] - self.corners) / self.widths,
            -1.0,
            1.0,
        )
        forward, backward = (2.0 + y * (3.0 - y * y)) @ self.bends / 4.0
        return np.asarray(forward - backward)


class TorqueSpeedLimit(Limit):
    """Torques in both directions over the joints' curves.

    Parameters
    ----------
    robot : Robot
    curves : dict of int to RoundedCurve
        Those of the joints that have one, by index.
    """

    kind = "torque_speed"
    longer_time = "relieves"

    def __init__(self, robot: Robot, curves: dict[int, RoundedCurve]) -> None:
        self._robot, self._curves = robot, tuple(curves.values())
        self._joints = np.repeat(list(curves), 2)
        self._signs = np.tile([1.0, -1.0], len(curves))
        self._at_rest = np.array(
            [robot.limits.torque_speed[joint][0][1] for joint in self._joints]
        )
        self.labels = tuple(
            self._label(*row) for row in zip(self._joints, self._signs, strict=True)
        )
        self.lower, self.upper = (
            np.full(len(self._joints), -np.inf),
            np.zeros(len(self._joints)),
        )

    def _label(self, joint: int, sign: float) -> Label:
        name, unit = self._robot.joint_names[joint], self._robot.position_units[joint]
        side, torque = (
            "positive" if sign > 0.0 else "negative",
            in_words("torque", unit),
        )
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
        return tuple(
            Bound(column, level, level, 1.0 / level, "upper")
            for column, level in levels
        )

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        tau, qdot = (
            part[:, self._joints] for part in (motion.torque(self._robot), motion.qdot)
        )
        allowed = [
            curve.values(part)
            for curve, part in zip(self._curves, qdot.T[::2], strict=True)
        ]
        return np.asarray(
            (self._signs * tau - np.repeat(allowed, 2, axis=0).T) / self._at_rest
        )

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        exact, scale = (
            motion.torque_derivatives(self._robot),
            (self._signs / self._at_rest)[:, None],
        )
        by_q, by_qdot, by_qddot = (
            part[:, self._joints] * scale for part in (exact.q, exact.qdot, exact.qddot)
        )
        qdot = motion.qdot[:, self._joints[::2]]
        slopes = [
            curve.slopes(part) for curve, part in zip(self._curves, qdot.T, strict=True)
        ]
        by_qdot[:, np.arange(len(self._joints)), self._joints] -= (
            np.repeat(slopes, 2, axis=0).T / self._at_rest
        )
        return Partials(by_q, by_qdot, by_qddot)


def build_torque_speed(robot: Robot, _task: Task) -> TorqueSpeedLimit | None:
    """Build the limit where a joint's torque falls with its speed."""
    rounded = {
        joint: RoundedCurve.below(curve)
        for joint, curve in enumerate(robot.limits.torque_speed)
        if curve
    }
    falling = {joint: curve for joint, curve in rounded.items() if curve is not None}
    return TorqueSpeedLimit(robot, falling) if falling else None


class RmsTorqueLimit(JointRatioLimit):
    """Squares of joint torques over their limits; their means over time are held.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    kind = "rms_torque"
    guarantee = Guarantee.AS_MEAN

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        super().__init__(
            robot, joints, robot.limits.rms_torque[joints], robot.torque_units
        )
        self._robot = robot
        self.lower = np.full(len(joints), -np.inf)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: a figure moves its square, to first order by twice as much."""
        return tuple(
            replace(bound, per_unit=2.0 * bound.per_unit) for bound in super().bounds
        )

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        tau = motion.torque(self._robot)
        return self._normalised(tau) ** 2

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        tau = motion.torque(self._robot)[:, self._joints]
        exact = motion.torque_derivatives(self._robot)
        factors = (2.0 * tau * self._scale**2)[:, :, None]
        return Partials(
            *(
                factors * part[:, self._joints]
                for part in (exact.q, exact.qdot, exact.qddot)
            )
        )

    def violation(self, values: np.ndarray) -> np.ndarray:
        """See `Limit.violation`: of the root mean square itself."""
        return np.asarray(np.sqrt(np.maximum(values, 0.0)) - np.sqrt(self.upper))

    def ratio(self, values: np.ndarray) -> np.ndarray:
        """See `Limit.ratio`: of the root mean square itself."""
        return np.asarray(np.sqrt(np.maximum(values, 0.0) / self.upper))


def build_rms_torque(robot: Robot, _task: Task) -> RmsTorqueLimit | None:
    """Build the limit for the joints that have one."""
    joints = np.flatnonzero(np.isfinite(robot.limits.rms_torque))
    return RmsTorqueLimit(robot, joints) if len(joints) else None
