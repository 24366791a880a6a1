"""|tau| <= tau_max."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst


def worst(given: Given) -> Worst | None:
    """Find the largest torque ratio, at the states and between them."""
    limit = given.robot.limits.torque
    if not np.isfinite(limit).any():
        return None
    return worst_between(given, lambda states: np.abs(states.tau) / limit, given.robot.joint_names)
