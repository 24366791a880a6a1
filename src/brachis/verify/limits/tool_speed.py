"""|v| <= v_max of the tool frame's origin, with Pinocchio's own frame velocity."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.motion import States


def worst(given: Given) -> Worst | None:
    """Find the largest ratio of the tool's speed, at the states and between them."""
    limit, robot = given.task.tool_limits.speed, given.robot
    if limit is None:
        return None
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id

    def ratios(states: States) -> np.ndarray:
        speeds = np.empty((len(states.t), 1))
        for k, (q, qdot) in enumerate(zip(states.q, states.qdot, strict=True)):
            pin.forwardKinematics(model, data, q, qdot)
            velocity = pin.getFrameVelocity(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            speeds[k] = np.linalg.norm(velocity.linear)
        return speeds / limit

    return worst_between(given, ratios, ("tool",))
