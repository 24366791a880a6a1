"""|v| <= v_max(s) of the tool frame's origin, with Pinocchio's own frame velocity."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.robot import Robot
from brachis.task import SpeedTable
from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.motion import States


def worst_tool_speed(given: Given) -> Worst | None:
    """Find the largest ratio of the tool's speed, at the states and between them; at the places of tables too."""
    limits, robot = given.trajectory.task.tool_limits, given.robot
    stated, feed = limits.speed, limits.feed
    if stated is None and not feed:
        return None
    tables = [*([stated] if isinstance(stated, SpeedTable) else []), *feed]

    def ratios(states: States) -> np.ndarray:
        s = given.s_at(states.t)
        allowed = np.full(len(s), stated if isinstance(stated, float) else np.inf)
        for table in tables:
            within = (s >= table.s[0] - _SAME_PLACE) & (s <= table.s[-1] + _SAME_PLACE)
            allowed = np.minimum(allowed, np.where(within | (table is stated), _allowed(table, s), np.inf))
        return speeds(robot, states) / allowed[:, None]

    places = np.unique([place for table in tables for place in table.s])
    return worst_between(given.looking_at(places) if tables else given, ratios, ("tool",))


_SAME_PLACE = 1e-12


def _allowed(table: SpeedTable, s: np.ndarray) -> np.ndarray:
    """Largest speeds, (K,), at path coordinates s, (K,); of both sides of a step the lower one."""
    places, figures = np.array(table.s), np.array(table.speed)
    allowed = np.interp(s, places, figures)  # which takes one side of a step
    for step in np.flatnonzero(np.diff(places) == 0.0).tolist():
        at_step = np.abs(s - places[step]) <= _SAME_PLACE
        allowed = np.where(at_step, np.minimum(allowed, figures[step : step + 2].min()), allowed)
    return np.asarray(allowed)


def speeds(robot: Robot, states: States) -> np.ndarray:
    """Speeds of the tool frame's origin, (K, 1), m/s."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    found = np.empty((len(states.t), 1))
    for k, (q, qdot) in enumerate(zip(states.q, states.qdot, strict=True)):
        pin.forwardKinematics(model, data, q, qdot)
        velocity = pin.getFrameVelocity(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        found[k] = np.linalg.norm(velocity.linear)
    return found
