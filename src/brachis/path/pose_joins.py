"""Checking that curves of poses continue each other to the third derivative."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.path.joins import TOLERANCE, Corner, angle_between, at_join, mismatch
from brachis.path.pose import POSITIONS, twist
from brachis.path.site import stands_still

if TYPE_CHECKING:
    from brachis.path.joins import Join
    from brachis.path.protocol import Array, Curve


def pose_corner(join: Join, first: Curve, second: Curve) -> Corner | None:
    """Return what jumps from one curve of poses to the next, or None where three derivatives continue."""
    on_the_spot = [stands_still(curve, POSITIONS) for curve in (first, second)]
    if on_the_spot[0] != on_the_spot[1]:
        found = "a stop: the position moves on one side, and the tool turns on the spot on the other"
        return Corner(join, found, "Turn the tool along a segment, by its orientation, or in a task of its own")
    before, after, length = at_join(first, second)
    jump = mismatch(before[:, :POSITIONS], after[:, :POSITIONS], length, POSITIONS)
    if jump:
        return Corner(join, jump, f"Set {join.rounding}")
    jump = _turning_mismatch(before, after, length, "rad" if on_the_spot[0] else "m")
    smooth = "Set profile: smooth where the tool turns"
    return Corner(join, jump, smooth if on_the_spot[0] else f"{smooth}, or {join.rounding}") if jump else None


def _turning_mismatch(before: Array, after: Array, length: float, unit: str) -> str | None:
    """Return in words what jumps in the turning of the tool, or None where three derivatives continue.

    Parameters
    ----------
    before, after : ndarray, shape (4, 12)
        Derivatives of the coordinates of the pose by sigma at the join.
    length : float
        Length of the shorter curve, sigma.
    unit : str
        Unit of sigma.
    """
    old, new = (twist(one[:, None])[:, 0, POSITIONS:] for one in (before, after))
    rate, new_rate = (float(np.linalg.norm(one[0])) for one in (old, new))
    jumps = np.linalg.norm(new - old, axis=1)
    large = jumps * length ** np.arange(3.0) > TOLERANCE * max(rate, 1.0)
    if not np.any(large):
        return None
    if not large[0]:
        order, k = ("slope", 1) if large[1] else ("second derivative", 2)
        return f"the {order} of the tool's turning rate jumps by {jumps[k]:.4g} rad/{unit}^{k + 1}"
    if abs(new_rate - rate) > TOLERANCE * max(rate, 1.0):
        return f"the tool's turning rate jumps: {rate:.4g} rad/{unit} before and {new_rate:.4g} after"
    angle = np.rad2deg(angle_between(old[0], new[0]))
    return f"the axis about which the tool turns jumps by {angle:.4g} degrees"
