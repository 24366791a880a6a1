"""q_min <= q <= q_max, exactly: the saved motion is polynomial."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.extremes import largest
from brachis.verify.limits.protocol import Given, Worst

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
    beyond = _worst(given, np.clip(half, _LEAST_HALF, _LARGEST_HALF))
    if beyond.ratio > 1.0:
        return beyond
    inside = _worst(given, np.where(np.isfinite(half), np.maximum(half, _LEAST_HALF), 1.0))
    return inside._replace(ratio=max(inside.ratio, 0.0), remark=_REMARK)


def _worst(given: Given, scale: np.ndarray) -> Worst:
    """Find the largest ratio, where a way of `scale`, (n,), from an end changes it by 1."""
    limits, pieces = given.robot.limits, given.pieces
    above = 1.0 + (pieces.nodes - limits.position_upper + pieces.position) / scale
    below = 1.0 + (limits.position_lower - pieces.nodes - pieces.position) / scale
    return largest(given, above, below)
