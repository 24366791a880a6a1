"""|qdot| <= v_max, |qddot| <= a_max and |qdddot| <= j_max, exactly: the saved motion is polynomial."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.extremes import largest
from brachis.verify.limits.protocol import Given, Worst


def worst_velocity(given: Given) -> Worst | None:
    """Find the largest velocity ratio, anywhere."""
    return _worst(given, given.pieces.velocity, given.robot.limits.velocity)


def worst_acceleration(given: Given) -> Worst | None:
    """Find the largest acceleration ratio, anywhere."""
    return _worst(given, given.pieces.acceleration, given.robot.limits.acceleration)


def worst_jerk(given: Given) -> Worst | None:
    """Find the largest jerk ratio, anywhere."""
    return _worst(given, given.pieces.jerk, given.robot.limits.jerk)


def _worst(given: Given, rates: np.ndarray, limit: np.ndarray) -> Worst | None:
    """Compare polynomials in Bernstein form, (m + 1, L, n), with limits, (n,)."""
    if not np.isfinite(limit).any():
        return None
    ratio = rates / limit
    return largest(given, ratio, -ratio)
