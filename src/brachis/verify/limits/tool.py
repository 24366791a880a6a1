"""Ratios to limits of the tool: its speed, angular speed, acceleration, and deviation from the path.

The ratios are computed only from the URDF's chain and the path. Let D be the rotation of the tool relative to the
orientation of the path. Let z be the third column of D, which is the axis of the tool. Then

    tilt = acos z_z,   lead = asin z_x,   side = atan2(z_y, z_z),   roll = atan2(-D_xy, D_xx).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from brachis.common.arrays import apply_each
from brachis.robot import Robot
from brachis.task import Task
from brachis.verify.limits.protocol import LimitCheck, Worst, worst_between, worst_size
from brachis.verify.mechanics import (
    joint_placements,
    real_tool_placements,
    tool_accelerations,
)
from brachis.verify.motion import CheckedMotion, MotionStates, list_speed_tables

_ANGLES = ("lead", "side", "roll")
_SAME_S = 1e-12
"""Difference of path coordinates below which they count as the same."""


def tool_sizes(robot: Robot, states: MotionStates, quantity: str) -> np.ndarray:
    """Return the tool's ``speed``, m/s, ``angular_speed``, rad/s, or ``acceleration``, m/s^2, (K,)."""
    rates = (states.qdot, states.qddot)
    if quantity != "acceleration":
        rates = (np.zeros_like(states.q), states.qdot)
    linear, angular = tool_accelerations(robot, states.q, *rates)
    vectors = angular if quantity == "angular_speed" else linear
    return np.linalg.norm(vectors, axis=0)


def _worst_motion(quantity: str, motion: CheckedMotion) -> Worst | None:
    """Find the largest ratio to one of the task's tool limits, at the states and between them."""
    largest = getattr(motion.task.tool_limits, quantity)
    return worst_size(
        motion, largest, lambda states: tool_sizes(motion.robot, states, quantity)
    )


def largest_speeds(
    task: Task, s: np.ndarray, side: Callable[..., np.ndarray] = np.minimum
) -> np.ndarray:
    """Return the tool's maximum speeds, m/s, (K,), at path coordinates; at a step, `side` chooses one of two values."""
    limits = task.tool_limits
    constant = limits.speed if isinstance(limits.speed, float) else np.inf
    largest = np.full(len(s), constant)
    for table in list_speed_tables(task):
        sides = [
            np.interp(s + step, table.s, table.speed) for step in (-_SAME_S, _SAME_S)
        ]
        # A table of feed rates does not apply beyond its ends.
        within = (s >= table.s[0] - _SAME_S) & (s <= table.s[-1] + _SAME_S)
        holds = within | (table is limits.speed)
        largest = np.minimum(largest, np.where(holds, side(*sides), np.inf))
    return largest


def _worst_speed(motion: CheckedMotion) -> Worst | None:
    """Find the largest ratio of the tool's speed, at the states and between them."""
    if not list_speed_tables(motion.task):
        return _worst_motion("speed", motion)

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the tool's speeds divided by the lowest limit at each s, (K,)."""
        speeds = tool_sizes(motion.robot, states, "speed")
        return speeds / largest_speeds(motion.task, states.s)

    return worst_size(motion, 1.0, ratios)


def _worst_deviation(name: str, motion: CheckedMotion) -> Worst | None:
    """Find the largest ratio of the tool's tilt, or of its distance from the path, to the allowed value."""
    tolerances = motion.task.tolerances
    is_tilt = name == "tilt"
    largest = tolerances.orientation.tilt if is_tilt else tolerances.position.sphere
    return worst_size(motion, largest, lambda states: _deviations(motion, states)[name])


def _worst_range(motion: CheckedMotion) -> Worst | None:
    """Find the largest fraction of a range that the tool uses; None if there are no ranges."""
    tolerances = motion.task.tolerances
    angles = {
        direction: getattr(tolerances.orientation, direction) for direction in _ANGLES
    }
    lengths = {
        direction: getattr(tolerances.position, direction) for direction in "xyz"
    }
    every = angles | lengths
    ranges = {
        direction: ends
        for direction, ends in every.items()
        if ends not in (None, "free")
    }
    if not ranges:
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the used fractions of the ranges, (K, c)."""
        used = _deviations(motion, states)
        columns = []
        for direction, (low, high) in ranges.items():
            away = used[direction] - 0.5 * (low + high)
            if direction in _ANGLES:
                away = np.remainder(away + 180.0, 360.0) - 180.0
            columns.append(np.abs(away) / (0.5 * (high - low)))
        return np.stack(columns, axis=1)

    return worst_between(motion, ratios, [f"tool {direction}" for direction in ranges])


def _deviations(motion: CheckedMotion, states: MotionStates) -> dict[str, np.ndarray]:
    """Return angles, degrees, and displacements, m, of the tool from its place on the path, (K,) each."""
    joints = joint_placements(motion.robot, states.q)
    origin, rotation = real_tool_placements(motion.robot, *joints)
    target = motion.path.sample(np.clip(states.s, 0.0, 1.0)).target
    shift = np.zeros_like(origin)
    axes = list(motion.task_map.axes)
    shift[:, axes] = origin[:, axes] - target[:, : len(axes)]
    target_rotation = (
        target[:, -9:].reshape(-1, 3, 3) if motion.task.of_poses else rotation
    )
    back = np.swapaxes(target_rotation, 1, 2)
    turned = back @ rotation
    if motion.task.tolerances.position.axes == "tool":
        shift = apply_each(back, shift)
    x, y, z = turned[:, :, 2].T
    radians = {
        "tilt": np.arctan2(np.hypot(x, y), z),
        "lead": np.arcsin(np.clip(x, -1.0, 1.0)),
        "side": np.arctan2(y, z),
        "roll": np.arctan2(-turned[:, 0, 1], turned[:, 0, 0]),
    }
    deviations = {direction: np.degrees(angle) for direction, angle in radians.items()}
    deviations |= zip("xyz", shift.T, strict=True)
    return {**deviations, "distance": np.linalg.norm(shift, axis=1)}


TOOL_CHECKS: dict[str, LimitCheck] = {
    "tool_speed": _worst_speed,
    "tool_acceleration": partial(_worst_motion, "acceleration"),
    "tool_angular_speed": partial(_worst_motion, "angular_speed"),
    "tool_tilt": partial(_worst_deviation, "tilt"),
    "tool_distance": partial(_worst_deviation, "distance"),
    "tool_range": _worst_range,
}
