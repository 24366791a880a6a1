"""|v| <= v_max(s) of the tool frame's origin, with Pinocchio's own frame velocity."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.robot import Robot
from brachis.task import SpeedTable
from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.motion import States


def worst(given: Given) -> Worst | None:
    """Find the largest ratio of the tool's speed, at the states and between them; at the places of a table too."""
    limit, robot = given.trajectory.task.tool_limits.speed, given.robot
    if limit is None:
        return None
    if not isinstance(limit, SpeedTable):
        figure = limit
        return worst_between(given, lambda states: speeds(robot, states) / figure, ("tool",))
    places, figures = np.array(limit.s), np.array(limit.speed)
    steps = np.flatnonzero(np.diff(places) == 0.0)

    def ratios(states: States) -> np.ndarray:
        s = given.s_at(states.t)
        # `interp` takes one side of a step; the bound is the lower of both sides.
        allowed = np.interp(s, places, figures)
        for step in steps.tolist():
            at_step = np.abs(s - places[step]) <= _SAME_PLACE
            allowed = np.where(at_step, np.minimum(allowed, figures[step : step + 2].min()), allowed)
        return speeds(robot, states) / allowed[:, None]

    return worst_between(given.looking_at(np.unique(places)), ratios, ("tool",))


_SAME_PLACE = 1e-12


def speeds(robot: Robot, states: States) -> np.ndarray:
    """Speeds of the tool frame's origin, (K, 1), m/s."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id
    found = np.empty((len(states.t), 1))
    for k, (q, qdot) in enumerate(zip(states.q, states.qdot, strict=True)):
        pin.forwardKinematics(model, data, q, qdot)
        velocity = pin.getFrameVelocity(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        found[k] = np.linalg.norm(velocity.linear)
    return found
