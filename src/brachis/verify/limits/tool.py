"""|a| <= a_max of the tool frame's origin and |w| <= w_max of the tool, with Pinocchio's own frame motion.

|v| <= v_max(s) of the tool frame's origin, with Pinocchio's own frame velocity.

Constant speeds of the tool over parts of the path: how far they are off, either way, as a share of the speed.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.robot import ROLL_JOINT, Robot
from brachis.task import ProcessSpeed, SpeedTable
from brachis.verify.limits.protocol import Given, Worst, worst_between
from brachis.verify.motion import States

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def worst_tool_acceleration(given: Given) -> Worst | None:
    """Find the largest ratio of the size of the tool's acceleration, at the states and between them."""
    limit, robot = given.trajectory.task.tool_limits.acceleration, given.robot
    if limit is None:
        return None
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id

    def ratios(states: States) -> np.ndarray:
        found = np.empty((len(states.t), 1))
        for k, (q, qdot, qddot) in enumerate(
            zip(states.q, states.qdot, states.qddot, strict=True)
        ):
            pin.forwardKinematics(model, data, q, qdot, qddot)
            found[k] = np.linalg.norm(
                pin.getFrameClassicalAcceleration(model, data, frame, _AXES).linear
            )
        return found / limit

    return worst_between(given, ratios, ("tool",))


def worst_tool_angular_speed(given: Given) -> Worst | None:
    """Find the largest ratio of the tool's angular speed; the virtual joint of a free roll turns nothing."""
    limit, robot = given.trajectory.task.tool_limits.angular_speed, given.robot
    if limit is None:
        return None
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    rolls = np.array(
        [robot.rolls_freely and name == ROLL_JOINT for name in robot.joint_names]
    )

    def ratios(states: States) -> np.ndarray:
        found = np.empty((len(states.t), 1))
        for k, (q, qdot) in enumerate(
            zip(states.q, np.where(rolls, 0.0, states.qdot), strict=True)
        ):
            pin.forwardKinematics(model, data, q, qdot)
            found[k] = np.linalg.norm(
                pin.getFrameVelocity(model, data, frame, _AXES).angular
            )
        return found / limit

    return worst_between(given, ratios, ("tool",))


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
            allowed = np.minimum(
                allowed,
                np.where(within | (table is stated), _allowed(table, s), np.inf),
            )
        return speeds(robot, states) / allowed[:, None]

    places = np.unique([place for table in tables for place in table.s])
    return worst_between(
        given.looking_at(places) if tables else given, ratios, ("tool",)
    )


_SAME_PLACE = 1e-12


def _allowed(table: SpeedTable, s: np.ndarray) -> np.ndarray:
    """Largest speeds, (K,), at path coordinates s, (K,); of both sides of a step the lower one."""
    places, figures = np.array(table.s), np.array(table.speed)
    allowed = np.interp(s, places, figures)  # which takes one side of a step
    for step in np.flatnonzero(np.diff(places) == 0.0).tolist():
        at_step = np.abs(s - places[step]) <= _SAME_PLACE
        allowed = np.where(
            at_step, np.minimum(allowed, figures[step : step + 2].min()), allowed
        )
    return np.asarray(allowed)


def speeds(robot: Robot, states: States) -> np.ndarray:
    """Speeds of the tool frame's origin, (K, 1), m/s."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    found = np.empty((len(states.t), 1))
    for k, (q, qdot) in enumerate(zip(states.q, states.qdot, strict=True)):
        pin.forwardKinematics(model, data, q, qdot)
        velocity = pin.getFrameVelocity(
            model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        found[k] = np.linalg.norm(velocity.linear)
    return found


def worst_process_speed(given: Given) -> Worst | None:
    """Find the largest speed; a ratio of 1 is the process speed and its tolerance."""
    return _worst(given, 1.0)


def worst_least_process_speed(given: Given) -> Worst | None:
    """Find the smallest speed; a ratio of 1 is the process speed without its tolerance, 2 a tool at rest."""
    return _worst(given, -1.0)


def _worst(given: Given, side: float) -> Worst | None:
    """Find the worst part of the path."""
    parts = given.trajectory.task.tool_limits.process_speed
    within = given.within(np.array([part.s for part in parts])) if parts else []
    found = (
        _of_part(inside, part, side, alone=len(parts) == 1)
        for inside, part in zip(within, parts, strict=True)
    )
    return max(found, key=lambda worst: worst.ratio, default=None)


def _of_part(inside: Given, part: ProcessSpeed, side: float, *, alone: bool) -> Worst:
    begin, end = part.s
    subject = "tool" if alone else f"tool, s = {begin:g} to {end:g}"
    return worst_between(
        inside,
        lambda states: (
            1.0
            - part.tolerance
            + side * (speeds(inside.robot, states) / part.speed - 1.0)
        ),
        (subject,),
    )
