"""q_min <= q <= q_max, exactly: the saved motion is polynomial."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.extremes import largest
from brachis.verify.limits.protocol import Given, Worst

_LEAST_HALF_RANGE, _LARGEST_HALF_RANGE = 1e-5, 1.0
"""A position ratio of 2 is beyond the end by half the range, but by no less and no more than this, rad or m."""


def worst(given: Given) -> Worst | None:
    """Find the position that is nearest to an end of its range, or furthest beyond, anywhere."""
    lower, upper = given.robot.limits.position_lower, given.robot.limits.position_upper
    if not (np.isfinite(lower) | np.isfinite(upper)).any():
        return None
    pieces, half = given.pieces, np.clip(0.5 * upper - 0.5 * lower, _LEAST_HALF_RANGE, _LARGEST_HALF_RANGE)
    above = 1.0 + (pieces.nodes - upper + pieces.position) / half
    below = 1.0 + (lower - pieces.nodes - pieces.position) / half
    return largest(given, above, below)
