"""tau_min <= tau <= tau_max, with limits below and above zero."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst


def worst_torque(given: Given) -> Worst | None:
    """Find the largest torque ratio, at the states and between them."""
    lower, upper = given.robot.limits.torque_lower, given.robot.limits.torque_upper
    if not np.isfinite(upper).any():
        return None
    return worst_between(
        given, lambda states: np.maximum(states.tau / upper, states.tau / lower), given.robot.joint_names
    )
