"""Ratios of the motion of the joints to their limits.

Positions and their derivatives are polynomials, so their ratios are exact. Torques and quantities derived from them are
checked densely.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from brachis.robot import Robot
from brachis.verify.limits.protocol import (
    LimitCheck,
    Worst,
    largest,
    worst_between,
    worst_size,
)
from brachis.verify.mechanics import torque_rates
from brachis.verify.motion import CheckedMotion, MotionStates
from brachis.verify.report import POSITION_SCALE


def _worst_derivative(kind: str, motion: CheckedMotion) -> Worst | None:
    """Find the largest ratio of a derivative of the positions at any time; `kind` is its name in `MotionPieces`."""
    lower, upper = motion.robot.limits.both_ways(kind)
    if not np.isfinite(upper).any():
        return None
    rates = getattr(motion.pieces, kind)
    return largest(
        motion, lambda index: (rates[:, index] / upper, rates[:, index] / lower)
    )


def _worst_position(motion: CheckedMotion) -> Worst | None:
    """Find the position that is closest to an end of its range, or furthest beyond it, at any time.

    Inside the range, the ratio is 0 in the middle and 1 at the ends. For a range with only one end, the ratio is 1
    minus the distance from this end, rad or m, but at least 0. Beyond an end, the ratio is 1 plus the excess divided by
    half the range; the divisor is at least 1e-5 and at most 1 rad or m.
    """
    lower, upper = motion.robot.limits.both_ways("position")
    if np.isinf(lower).all() and np.isinf(upper).all():
        return None
    half = 0.5 * upper - 0.5 * lower
    beyond = _worst_in_range(motion, np.clip(half, 1e-5, 1.0))
    if beyond.ratio > 1.0:
        return beyond
    scale = np.where(np.isfinite(half), np.maximum(half, 1e-5), 1.0)
    inside = _worst_in_range(motion, scale)
    return inside._replace(ratio=max(inside.ratio, 0.0), remark=POSITION_SCALE)


def _worst_in_range(motion: CheckedMotion, scale: np.ndarray) -> Worst:
    """Find the largest ratio, where a distance of `scale`, (n,), from an end changes the ratio by 1."""
    lower, upper = motion.robot.limits.both_ways("position")
    pieces = motion.pieces

    def ratios(index: slice) -> tuple[np.ndarray, np.ndarray]:
        """Return the ratios to the upper and the lower ends."""
        positions = pieces.nodes[index] + pieces.position[:, index]
        above = 1.0 + (positions - upper) / scale
        return above, 1.0 + (lower - positions) / scale

    return largest(motion, ratios)


def _worst_quantity(
    kind: str,
    quantity: Callable[[Robot, MotionStates], np.ndarray],
    motion: CheckedMotion,
) -> Worst | None:
    """Find the largest ratio of a quantity of the joints, (K, n), at the states and between them."""
    robot = motion.robot
    lower, upper = robot.limits.both_ways(kind)
    if not np.isfinite(upper).any():
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the ratios to the limits in both directions, (K, n)."""
        values = quantity(robot, states)
        return np.maximum(values / upper, values / lower)

    return worst_between(motion, ratios, robot.joint_names)


def _worst_rms_torque(motion: CheckedMotion) -> Worst | None:
    """Find the largest ratio of an rms torque, by Simpson's rule between the states of each piece."""
    limit = motion.robot.limits.rms_torque
    states = motion.states
    if not np.isfinite(limit).any():
        return None
    steps = np.flatnonzero((np.diff(states.index) == 0) & (np.diff(states.u) > 1e-8))
    middle = 0.5 * (states.u[steps] + states.u[steps + 1])
    between = MotionStates.at(motion.pieces, states.index[steps], middle)
    lengths = states.t[steps + 1] - states.t[steps]
    ends = states.tau[steps] ** 2 + states.tau[steps + 1] ** 2
    mean = lengths @ ((ends + 4.0 * between.tau**2) / 6.0) / lengths.sum()
    ratios = np.sqrt(mean) / limit
    joint = np.argmax(ratios)
    name = motion.robot.joint_names[joint]
    return Worst(ratios[joint], name, states.t[-1])


def _worst_total_power(motion: CheckedMotion) -> Worst | None:
    """Find the largest ratio of the sum of all joints' powers."""

    def powers(states: MotionStates) -> np.ndarray:
        """Return the magnitudes of the total power, (K,)."""
        return np.abs(np.einsum("ki,ki->k", states.tau, states.qdot))

    return worst_size(motion, motion.robot.limits.total_power, powers, "all joints")


def _worst_torque_at_speed(motion: CheckedMotion) -> Worst | None:
    """Find the torque that is closest to, or furthest beyond, its joint's torque-speed curve.

    The ratio is 1 on the curve. Off the curve, the ratio differs from 1 by the distance in torque, as a fraction of the
    torque at rest.
    """
    robot = motion.robot
    curves = robot.limits.torque_speed
    joints = [joint for joint, curve in enumerate(curves) if curve]
    if not joints:
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return 1 plus the excess over the curves, (K, c), as a fraction of the torques at rest."""
        columns = []
        for joint in joints:
            speed, torque = np.array(curves[joint]).T
            moving = np.abs(states.qdot[:, joint])
            last_slope = (torque[-1] - torque[-2]) / (speed[-1] - speed[-2])
            beyond = last_slope * np.maximum(moving - speed[-1], 0.0)
            limit = np.maximum(np.interp(moving, speed, torque) + beyond, 0.0)
            columns.append(1.0 + (np.abs(states.tau[:, joint]) - limit) / torque[0])
        return np.column_stack(columns)

    return worst_between(motion, ratios, [robot.joint_names[joint] for joint in joints])


JOINT_CHECKS: dict[str, LimitCheck] = {
    "torque": partial(_worst_quantity, "torque", lambda _, states: states.tau),
    "velocity": partial(_worst_derivative, "velocity"),
    "acceleration": partial(_worst_derivative, "acceleration"),
    "position": _worst_position,
    "power": partial(
        _worst_quantity, "power", lambda _, states: states.tau * states.qdot
    ),
    "rms_torque": _worst_rms_torque,
    "jerk": partial(_worst_derivative, "jerk"),
    "torque_rate": partial(
        _worst_quantity,
        "torque_rate",
        lambda robot, states: torque_rates(
            robot, states.q, states.qdot, states.qddot, states.qdddot
        ),
    ),
}
"""The check for every row of `LIMIT_KINDS`."""
DRIVE_CHECKS: dict[str, LimitCheck] = {
    "total_power": _worst_total_power,
    "torque_speed": _worst_torque_at_speed,
}
"""The checks for the limits in `brachis.limits.drives`: limits of drives and of the whole robot."""
