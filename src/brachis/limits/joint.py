"""Limits on a quantity of each joint: position, velocity, acceleration, jerk, power, torque, torque rate, mean torque.

A value is (quantity - middle) / (half the distance between the lower and the upper limit), in [-1, 1]. If both
directions have the same limit, the value is the ratio of the quantity to the limit. Positions with a wide or open range
are measured in rad or m instead.

The rate of the torque tau(q, qdot, qddot) is

    dtau/dt = tau_q qdot + tau_v qddot + M qdddot

with the derivatives of tau with respect to q, qdot and qddot. With D for d/dt along the motion, the derivatives of the
rate with respect to

    q: D(tau_q),   qdot: D(tau_v) + tau_q,   qddot: D(M) + tau_v,   qdddot: M

where D is computed by differences.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, Self

import numpy as np

from brachis.common.arrays import apply_each, rates
from brachis.common.labels import Label
from brachis.kernel import Chain, ScaledQuantity
from brachis.limits.protocol import (
    Bound,
    Guarantee,
    HasLatticeWeights,
    JointStates,
    Limit,
    Partials,
    compute_inset,
)
from brachis.robot import Robot
from brachis.task import LIMIT_KINDS, Task


class JointLimit(Limit):
    """Limits on one quantity of the limited joints; `kind` is a row of `LIMIT_KINDS`.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    """

    longer_time: Literal["relieves", "neither"] = "relieves"
    share = ""
    """Title of an axis for the ratios; see `Label`."""

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        row = LIMIT_KINDS[self.kind]
        self._robot = robot
        self._joints = joints
        self._ends = robot.limits.both_ways(self.kind)[:, joints]
        self._measure(*self._ends)
        named_units = [*zip(robot.joint_names, robot.position_units, strict=True)]
        ranges = {joint.name: joint.key for joint in robot.tool_joints}
        self.labels = tuple(
            Label(
                name,
                row.in_words(unit),
                row.units[unit],
                ranges.get(name, f"robot.limits.{self.kind}.{name}"),
                share=self.share,
            )
            for name, unit in (named_units[joint] for joint in joints)
        )

    def _measure(self, low: np.ndarray, high: np.ndarray) -> None:
        """Set the scale of the values and their bounds from lower and upper limits of the quantity, (c,) each."""
        self._middle = 0.5 * (high + low)
        self._scale = 2.0 / (high - low)
        self.lower = -np.ones(len(low))
        self.upper = np.ones(len(low))
        self.violation_scale = 0.5 * (high - low) / np.minimum(high, -low)
        self._set_bounds(np.abs(self._ends), -low == high)

    def _set_bounds(self, full_scale: np.ndarray, is_symmetric: np.ndarray) -> None:
        """List the finite limits, with full scales, (2, c); a symmetric limit, (c,) bool, counts as one figure."""
        self.bounds = tuple(
            Bound(
                column,
                float(self._ends[end, column]),
                float(full_scale[end, column]),
                per_unit,
                None if is_symmetric[column] else side,
            )
            for column, per_unit in enumerate(self._scale.tolist())
            for end, side in enumerate(("lower", "upper"))
            if np.isfinite(self._ends[end, column])
            and not (is_symmetric[column] and side == "lower")
        )

    @property
    def centre(self) -> np.ndarray:
        """The values at which the quantity is zero."""
        return -self._middle * self._scale

    @classmethod
    def build(cls, robot: Robot, _task: Task | None = None) -> Self | None:
        """Build the limit for the joints that have a finite limit; None without such joints."""
        joints = np.flatnonzero(
            np.isfinite(robot.limits.both_ways(cls.kind)).any(axis=0)
        )
        return cls(robot, joints) if len(joints) else None

    @abstractmethod
    def quantity(self, motion: JointStates) -> np.ndarray:
        """Compute the quantity of all joints, (K, n), in SI units."""

    def values(self, motion: JointStates) -> np.ndarray:
        quantity = self.quantity(motion).take(self._joints, axis=1)
        return (quantity - self._middle) * self._scale

    def kernel_quantity(self, chain: Chain) -> ScaledQuantity | None:
        """Describe the values; None for subclasses, whose values may differ."""
        name = _QUANTITIES.get(type(self))
        if name is None or self._robot.dynamic_chain is not chain:
            return None
        return ScaledQuantity(name, self._joints, self._middle, self._scale, chain)

    def _scale_rows(self, slopes: np.ndarray) -> np.ndarray:
        """Turn derivatives of the quantity, (K, n, n), into derivatives of the values, (K, c, n)."""
        return slopes.take(self._joints, axis=1) * self._scale[:, None]


class _DerivativeLimit(JointLimit):
    """Limits on joint positions, velocities, accelerations or jerks."""

    derivative: str
    """Name of the quantity in `JointStates` and in `Partials`."""

    def quantity(self, motion: JointStates) -> np.ndarray:
        return getattr(motion, self.derivative)

    def partials(self, motion: JointStates) -> Partials:
        return Partials(**{self.derivative: self._rows(len(motion.q))})

    def _rows(self, count: int) -> np.ndarray:
        """Return the derivatives of the values with respect to the quantity, (K, c, n), at `count` moments."""
        rows = np.eye(self._robot.n)[self._joints] * self._scale[:, None]
        return np.broadcast_to(rows, (count, *rows.shape))


def position_measure(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return the distance outside a range, rad or m, that counts as a violation of 1: half the range, 1e-5 to 1."""
    return np.clip(0.5 * upper - 0.5 * lower, 1e-5, 1.0)


class PositionLimit(_DerivativeLimit):
    """Ranges of the joint positions."""

    kind = "position"
    derivative = "q"
    longer_time = "neither"
    at_rest = "turns"
    share = "position in its range"

    def _measure(self, low: np.ndarray, high: np.ndarray) -> None:
        half = 0.5 * high - 0.5 * low
        # For a range of more than 20 rad or m, half of it is too coarse a measure close to its ends.
        is_narrow = half <= 10.0
        measure = np.where(is_narrow, half, 1.0)
        with np.errstate(invalid="ignore"):  # -inf + inf
            self._middle = np.where(is_narrow, 0.5 * low + 0.5 * high, 0.0)
        self._scale = 1.0 / measure
        self.lower = (low - self._middle) * self._scale
        self.upper = (high - self._middle) * self._scale
        within = position_measure(low, high)
        self.violation_scale = measure / within
        self.inset = compute_inset(within)
        width = np.where(np.isfinite(half), 2.0 * half, 1.0)
        self._set_bounds(np.array([width, width]), np.zeros(len(low), dtype=bool))

    @property
    def centre(self) -> np.ndarray:
        """Values at the middles of the ranges."""
        return super(JointLimit, self).centre


class VelocityLimit(_DerivativeLimit, HasLatticeWeights):
    """Limits on joint velocities."""

    kind = "velocity"
    derivative = "qdot"

    def lattice_weights(self, q: np.ndarray) -> tuple[None, np.ndarray]:
        return None, self._rows(len(q))


class AccelerationLimit(_DerivativeLimit, HasLatticeWeights):
    """Limits on joint accelerations."""

    kind = "acceleration"
    derivative = "qddot"

    def lattice_weights(self, q: np.ndarray) -> tuple[np.ndarray, None]:
        return self._rows(len(q)), None


class JerkLimit(_DerivativeLimit):
    """Limits on joint jerks."""

    kind = "jerk"
    derivative = "qdddot"
    order = 3


class _DynamicLimit(JointLimit):
    """Limits on a quantity that depends on several derivatives of the joint positions."""

    @abstractmethod
    def quantity_partials(self, motion: JointStates) -> Partials:
        """Return the derivatives of `quantity`, (K, n, n) each."""

    def partials(self, motion: JointStates) -> Partials:
        return self.quantity_partials(motion).map(self._scale_rows)


class _TorqueLimit(_DynamicLimit):
    """Limits on a function of the joint torques."""

    def quantity(self, motion: JointStates) -> np.ndarray:
        return motion.torque(self._robot)

    def quantity_partials(self, motion: JointStates) -> Partials:
        return Partials(*motion.torque_derivatives(self._robot))


class TorqueLimit(_TorqueLimit, HasLatticeWeights):
    """Limits on joint torques."""

    kind = "torque"
    at_rest = "posture"
    refusal = "cannot hold the arm against gravity"

    def lattice_weights(self, q: np.ndarray) -> tuple[np.ndarray, None]:
        return self._scale_rows(self._robot.dynamic_chain.mass_matrices(q)), None


class TorqueRateLimit(_DynamicLimit):
    """Limits on the rates of joint torques."""

    kind = "torque_rate"
    order = 3

    def quantity(self, motion: JointStates) -> np.ndarray:
        """Compute the rates of the torques of all joints, (K, n), Nm/s or N/s."""
        exact = motion.torque_derivatives(self._robot)
        return (
            apply_each(exact.q, motion.qdot)
            + apply_each(exact.qdot, motion.qddot)
            + apply_each(exact.qddot, motion.qdddot)
        )

    def quantity_partials(self, motion: JointStates) -> Partials:
        """Differentiate the rates with respect to q and its first three derivatives, (K, n, n) each."""
        exact = motion.torque_derivatives(self._robot)
        chain = self._robot.dynamic_chain
        states = (motion.q, motion.qdot, motion.qddot, motion.qdddot)
        q, qdot, qddot = rates(
            lambda *states: chain.torque_derivatives(*states[:3]), states
        )
        return Partials(q, qdot + exact.q, qddot + exact.qdot, exact.qddot)


def powers(robot: Robot, motion: JointStates) -> np.ndarray:
    """Compute the mechanical power of each joint, (K, n), W; negative if the joint brakes."""
    return motion.torque(robot) * motion.qdot


def power_partials(robot: Robot, motion: JointStates) -> Partials:
    """Differentiate `powers` with respect to q, qdot and qddot, (K, n, n) each."""
    exact = motion.torque_derivatives(robot)
    rate = motion.qdot[:, :, None]
    by_qdot = exact.qdot * rate
    every = np.arange(robot.n)
    by_qdot[:, every, every] += motion.torque(robot)
    return Partials(exact.q * rate, by_qdot, exact.qddot * rate)


class PowerLimit(_DynamicLimit):
    """Limits on the mechanical power of each joint."""

    kind = "power"

    def quantity(self, motion: JointStates) -> np.ndarray:
        return powers(self._robot, motion)

    def quantity_partials(self, motion: JointStates) -> Partials:
        return power_partials(self._robot, motion)


class RmsTorqueLimit(_TorqueLimit):
    """Limits on root-mean-square torques. The values are the squares of the ratios to the limits."""

    kind = "rms_torque"
    guarantee = Guarantee.AS_MEAN

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        super().__init__(robot, joints)
        self.lower = np.full(len(joints), -np.inf)
        # To first order, the relative change of the square is twice that of the figure.
        self.bounds = tuple(
            replace(bound, per_unit=2.0 * bound.per_unit) for bound in self.bounds
        )

    def values(self, motion: JointStates) -> np.ndarray:
        return super().values(motion) ** 2

    def partials(self, motion: JointStates) -> Partials:
        factors = 2.0 * super().values(motion)[:, :, None]
        return super().partials(motion).map(lambda slopes: factors * slopes)

    def violation(self, values: np.ndarray) -> np.ndarray:
        """Compute the violations of the root mean square itself, not of its square."""
        return np.sqrt(np.maximum(values, 0.0)) - np.sqrt(self.upper)

    def ratio(self, values: np.ndarray) -> np.ndarray:
        """Compute the ratios of the root mean square itself, not of its square."""
        return np.sqrt(np.maximum(values, 0.0) / self.upper)


JOINT_LIMITS = {
    limit.kind: limit
    for limit in (
        TorqueLimit,
        VelocityLimit,
        AccelerationLimit,
        PositionLimit,
        PowerLimit,
        RmsTorqueLimit,
        JerkLimit,
        TorqueRateLimit,
    )
}
"""The class of the limit for every row of `LIMIT_KINDS`."""
_QUANTITIES: dict[type[Limit], str] = {TorqueLimit: "torque"} | {
    limit: limit.derivative
    for limit in (PositionLimit, VelocityLimit, AccelerationLimit, JerkLimit)
}
"""Limits whose values have the form (quantity of the kernel - offset) * factor."""


def reciprocals_near(
    robot: Robot, limits: Sequence[Limit], q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the reciprocals of the maximum acceleration and velocity of each joint alone, close to `q`, (n,) each.

    They follow from the limits of the joints. For a joint without a limit, the reciprocal is 0.
    """
    reciprocals = np.zeros((2, robot.n))
    for limit in limits:
        if not isinstance(limit, HasLatticeWeights):
            continue
        subjects = [label.subject for label in limit.labels]
        is_of_joint = np.equal.outer(subjects, robot.joint_names)
        for weights, rows in zip(
            reciprocals, limit.lattice_weights(q[None]), strict=True
        ):
            if rows is not None:
                largest = np.abs(np.where(is_of_joint, rows[0], 0.0)).max(axis=0)
                np.maximum(weights, largest, out=weights)
    return reciprocals[0], reciprocals[1]
