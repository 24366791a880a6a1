"""Blends: septic polynomials that round the corner between two curves."""

from __future__ import annotations

from math import floor
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.septic import SepticCurve, septic
from brachis.path.site import stands_still
from brachis.plausibility import position_hint

if TYPE_CHECKING:
    from brachis.path.joins import Join
    from brachis.path.protocol import Array, Curve

SLOWEST = 0.2
"""Smallest speed (norm of the position's derivative by sigma, 1 on a line) that a blend may have."""
_CHECKED_POINTS = 201
_ROUNDING = 1e-12


def blend_rows(first: Curve, second: Curve, size: float, join: Join) -> SepticCurve:
    """Return the blend that replaces the last `size` of one curve and the first `size` of the next.

    Parameters
    ----------
    first, second : Curve
        The curves that meet.
    size : float
        Replaced range of sigma on either side, m.
    join : Join
        Where they meet.

    Raises
    ------
    PathError
        The blend is longer than half of a neighbour, or (nearly) stops or reverses; or a neighbour moves yaw alone.
    """
    check_neighbours(first, second, size, join, still="yaw alone moves", turning="yaw")
    start, end, length = ends(first, second, size, join.positions)
    return checked_septic(start, end, length, join)


def check_neighbours(first: Curve, second: Curve, size: float, join: Join, *, still: str, turning: str) -> None:
    """Refuse a blend where the position stands still, or that is too long.

    `still` says what happens where it stands still, and `turning` names what turns there.

    Raises
    ------
    PathError
    """
    where, at = f"{join.blend_key}: {join.where}", (join.s, join.s)
    if stands_still(first, join.positions) or stands_still(second, join.positions):
        problem = f"a blend needs motion of the position on both sides, and {still} on one"
        hint = f"Turn {turning} along a line"
        raise PathError(
            problem, s_interval=at, found=f"{size:g} {join.unit}", allowed="no blend here", where=where, hint=hint
        )
    longest = min(first.length, second.length) / 2
    if size > longest * (1 + _ROUNDING):
        problem = "the blend is longer than half of a neighbouring segment"
        # Rounded down, to whole nanometres, so that the blend that the message names is accepted.
        allowed = f"at most {floor(longest * 1e9) / 1e9:.10g} {join.unit}"
        looks = position_hint(size, 0.0, longest, join.unit)
        raise PathError(problem, s_interval=at, found=f"{size:g} {join.unit}", allowed=allowed, where=where, hint=looks)


def ends(first: Curve, second: Curve, size: float, positions: int) -> tuple[Array, Array, float]:
    """Return the derivatives, (4, m), at the start and the end of a blend, and its length.

    The length is the mean of the chord and of the polygon over the corner, which keeps the blend's speed near 1.
    """
    start = first.derivatives(np.array([first.length - size]))[:, 0]
    corner = second.derivatives(np.zeros(1), 0)[0, 0]
    end = second.derivatives(np.array([size]))[:, 0]
    chord = _distance(start[0], end[0], positions)
    polygon = _distance(start[0], corner, positions) + _distance(corner, end[0], positions)
    return start, end, (chord + polygon) / 2


def checked_septic(start: Array, end: Array, length: float, join: Join) -> SepticCurve:
    """Return the septic polynomial between derivatives (4, m), after a check that its position keeps going.

    Raises
    ------
    PathError
    """
    curve = septic(start, end, length)
    sigma = np.linspace(0.0, curve.length, _CHECKED_POINTS)
    speed = float(np.linalg.norm(curve.derivatives(sigma, 1)[1, :, : join.positions], axis=1).min())
    if not speed > SLOWEST:
        problem = "the corner is too sharp for a blend, which would all but stop and reverse"
        raise PathError(
            problem,
            s_interval=(join.s, join.s),
            found=f"a smallest speed of {speed:.3g} relative to the segments",
            allowed=f"more than {SLOWEST}",
            where=f"{join.blend_key}: {join.where}",
            hint="Turn in two corners, or by an arc",
        )
    return curve


def _distance(one: Array, other: Array, positions: int) -> float:
    return float(np.linalg.norm((one - other)[:positions]))
