"""|a| <= a_max of the tool frame's origin and |w| <= w_max of the tool, with Pinocchio's own frame motion."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.robot import ROLL_JOINT
from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst
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
        for k, (q, qdot, qddot) in enumerate(zip(states.q, states.qdot, states.qddot, strict=True)):
            pin.forwardKinematics(model, data, q, qdot, qddot)
            found[k] = np.linalg.norm(pin.getFrameClassicalAcceleration(model, data, frame, _AXES).linear)
        return found / limit

    return worst_between(given, ratios, ("tool",))


def worst_tool_angular_speed(given: Given) -> Worst | None:
    """Find the largest ratio of the tool's angular speed; the virtual joint of a free roll turns nothing."""
    limit, robot = given.trajectory.task.tool_limits.angular_speed, given.robot
    if limit is None:
        return None
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    rolls = np.array([robot.rolls_freely and name == ROLL_JOINT for name in robot.joint_names])

    def ratios(states: States) -> np.ndarray:
        found = np.empty((len(states.t), 1))
        for k, (q, qdot) in enumerate(zip(states.q, np.where(rolls, 0.0, states.qdot), strict=True)):
            pin.forwardKinematics(model, data, q, qdot)
            found[k] = np.linalg.norm(pin.getFrameVelocity(model, data, frame, _AXES).angular)
        return found / limit

    return worst_between(given, ratios, ("tool",))
