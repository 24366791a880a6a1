"""How large a robot is."""

from __future__ import annotations

import numpy as np

from brachis.robot import Robot


def link_lengths(robot: Robot) -> list[float]:
    """Distances from joint to joint, and from the last joint to the tool frame, m."""
    placements = [*list(robot.model.jointPlacements)[2:], robot.model.frames[robot.frame_id].placement]
    return [float(np.linalg.norm(placement.translation)) for placement in placements]


def reach(robot: Robot) -> float:
    """How far the tool frame can be from the first joint at most, m, in the ranges of slides that the URDF states."""
    slides = [
        max(abs(end) for end in (lower, upper, stated.lower, stated.upper) if end is not None)
        for lower, upper, stated, unit in zip(
            robot.limits.position_lower,
            robot.limits.position_upper,
            robot.stated_limits,
            robot.position_units,
            strict=True,
        )
        if unit == "m"
    ]
    return sum(link_lengths(robot)) + sum(slides)
