"""|dtau/dt| <= rate_max."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.mechanics import torque_rates
from brachis.verify.motion import States


def worst_torque_rate(given: Given) -> Worst | None:
    """Find the largest ratio of a torque's rate, at the states and between them."""
    limit, robot = given.robot.limits.torque_rate, given.robot
    if not np.isfinite(limit).any():
        return None

    def ratios(states: States) -> np.ndarray:
        return np.abs(torque_rates(robot, states.q, states.qdot, states.qddot, states.qdddot)) / limit

    return worst_between(given, ratios, robot.joint_names)
