"""v_min <= qdot <= v_max, |qddot| <= a_max and |qdddot| <= j_max, exactly: the saved motion is polynomial.

q_min <= q <= q_max, exactly: the saved motion is polynomial.
"""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.protocol import Given, Worst, largest


def worst_velocity(given: Given) -> Worst | None:
    """Find the largest velocity ratio, anywhere."""
    limits = given.robot.limits
    return _worst(
        given, given.pieces.velocity, limits.velocity_lower, limits.velocity_upper
    )


def worst_acceleration(given: Given) -> Worst | None:
    """Find the largest acceleration ratio, anywhere."""
    limit = given.robot.limits.acceleration
    return _worst(given, given.pieces.acceleration, -limit, limit)


def worst_jerk(given: Given) -> Worst | None:
    """Find the largest jerk ratio, anywhere."""
    limit = given.robot.limits.jerk
    return _worst(given, given.pieces.jerk, -limit, limit)


def _worst(
    given: Given, rates: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> Worst | None:
    """Compare polynomials in Bernstein form, (m + 1, L, n), with limits below and above zero, (n,) each."""
    if not np.isfinite(upper).any():
        return None
    return largest(given, rates / upper, rates / lower)


_LEAST_HALF, _LARGEST_HALF = 1e-5, 1.0
"""A position ratio of 2 is beyond the end by half the range, but by no less and no more than this, rad or m."""

_REMARK = "0: the middle of the range, 1: an end"


def worst_position(given: Given) -> Worst | None:
    """Find the position that is nearest to an end of its range, or furthest beyond, anywhere.

    Inside, the ratio is the place in the range: 0 in its middle, 1 at its ends. Of a range with one end it is
    1 minus the distance from it, rad or m, and 0 farther away.
    """
    lower, upper = given.robot.limits.position_lower, given.robot.limits.position_upper
    if not (np.isfinite(lower) | np.isfinite(upper)).any():
        return None
    half = 0.5 * upper - 0.5 * lower
    beyond = _worst_position(given, np.clip(half, _LEAST_HALF, _LARGEST_HALF))
    if beyond.ratio > 1.0:
        return beyond
    inside = _worst_position(
        given, np.where(np.isfinite(half), np.maximum(half, _LEAST_HALF), 1.0)
    )
    return inside._replace(ratio=max(inside.ratio, 0.0), remark=_REMARK)


def _worst_position(given: Given, scale: np.ndarray) -> Worst:
    """Find the largest ratio, where a way of `scale`, (n,), from an end changes it by 1."""
    limits, pieces = given.robot.limits, given.pieces
    above = 1.0 + (pieces.nodes - limits.position_upper + pieces.position) / scale
    below = 1.0 + (limits.position_lower - pieces.nodes - pieces.position) / scale
    return largest(given, above, below)
