"""v_min <= qdot <= v_max, |qddot| <= a_max and |qdddot| <= j_max, exactly: the saved motion is polynomial."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.extremes import largest
from brachis.verify.limits.protocol import Given, Worst


def worst_velocity(given: Given) -> Worst | None:
    """Find the largest velocity ratio, anywhere."""
    limits = given.robot.limits
    return _worst(given, given.pieces.velocity, limits.velocity_lower, limits.velocity_upper)


def worst_acceleration(given: Given) -> Worst | None:
    """Find the largest acceleration ratio, anywhere."""
    limit = given.robot.limits.acceleration
    return _worst(given, given.pieces.acceleration, -limit, limit)


def worst_jerk(given: Given) -> Worst | None:
    """Find the largest jerk ratio, anywhere."""
    limit = given.robot.limits.jerk
    return _worst(given, given.pieces.jerk, -limit, limit)


def _worst(given: Given, rates: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Worst | None:
    """Compare polynomials in Bernstein form, (m + 1, L, n), with limits below and above zero, (n,) each."""
    if not np.isfinite(upper).any():
        return None
    return largest(given, rates / upper, rates / lower)
