"""Ratios of the tool's speed, angular speed and acceleration to their limits, with Pinocchio's own frame motion."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin

from brachis.robot import Robot
from brachis.task import SpeedTable
from brachis.verify.limits.protocol import LimitCheck, Worst, worst_between
from brachis.verify.motion import Given, MotionStates


def frame_motion(robot: Robot, states: MotionStates, vector: str) -> np.ndarray:
    """Sizes, (K, 1), of the tool frame's velocity (``linear``, m/s; ``angular``, rad/s), or ``acceleration``, m/s^2.

    Virtual joints do not move the tool.
    """
    model = robot.model
    data = model.createData()
    frame = (robot.frame_id, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    motion = [states.q.copy(), states.qdot.copy(), states.qddot.copy()]
    for part in motion:
        part[:, len(robot.urdf_joints) :] = 0.0
    sizes = np.empty((len(states.t), 1))
    for k in range(len(sizes)):
        pin.forwardKinematics(model, data, *(part[k] for part in motion))
        if vector == "acceleration":
            part = pin.getFrameClassicalAcceleration(model, data, *frame).linear
        else:
            part = getattr(pin.getFrameVelocity(model, data, *frame), vector)
        sizes[k] = np.linalg.norm(part)
    return sizes


def _worst_motion(key: str, vector: str, given: Given) -> Worst | None:
    """Find the largest ratio to one of the task's tool limits, at the states and between them."""
    limit = getattr(given.task.tool_limits, key)
    if limit is None:
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the sizes over the limit, (K, 1)."""
        return frame_motion(given.robot, states, vector) / limit

    return worst_between(given, ratios, ("tool",))


_SAME_S = 1e-12
"""Path coordinates that are nearer to each other are the same."""


def _worst_speed(given: Given) -> Worst | None:
    """Find the largest ratio of the tool's speed, at the states and between them; also at the places of tables."""
    limits = given.task.tool_limits
    tables = [
        *([limits.speed] if isinstance(limits.speed, SpeedTable) else []),
        *limits.feed,
    ]
    if not tables:
        return _worst_motion("speed", "linear", given)

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the speeds over the lowest limit at each s, (K, 1)."""
        s = states.s
        limit = np.full(
            len(s), limits.speed if isinstance(limits.speed, float) else np.inf
        )
        for table in tables:
            # A table of feed rates says nothing beyond its ends.
            within = (s >= table.s[0] - _SAME_S) & (s <= table.s[-1] + _SAME_S)
            holds = within | (table is limits.speed)
            limit = np.where(holds, np.minimum(limit, _speed_limit(table, s)), limit)
        return frame_motion(given.robot, states, "linear") / limit[:, None]

    places = np.unique([place for table in tables for place in table.s])
    return worst_between(given.with_states_at(places), ratios, ("tool",))


def _speed_limit(table: SpeedTable, s: np.ndarray) -> np.ndarray:
    """Largest speeds, (K,), at path coordinates s, (K,); of both sides of a step the lower one."""
    before, behind = (
        np.interp(s + step, table.s, table.speed) for step in (-_SAME_S, _SAME_S)
    )
    return np.minimum(before, behind)


TOOL_CHECKS: dict[str, LimitCheck] = {
    "tool_speed": _worst_speed,
    "tool_acceleration": partial(_worst_motion, "acceleration", "acceleration"),
    "tool_angular_speed": partial(_worst_motion, "angular_speed", "angular"),
}
