"""Corners, at which the direction of points changes abruptly at any scale, their blends, and gaps between points.

Long straight sections between points get additional points, so that a fitted curve is straight there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, sin

import numpy as np

from brachis.common.arrays import interpolate_columns, spread, with_like_signs
from brachis.common.words import write_count
from brachis.task.points.checks import Scatter
from brachis.task.points.fit import lengths_along
from brachis.task.points.points import Array, Indices, Points

LEAST_ANGLE = np.deg2rad(12.0)
"""Minimum change of direction at a corner, rad. Smaller changes are left to the fit."""
_SURE = 5.0
"""Largest change of compared angles attributed to scatter, in standard deviations; none of 50,000 points exceeds it."""
_STRAIGHT = 0.7
"""Minimum straightness of lines whose directions are compared. An arc of 200 degrees, which seems to turn by 160
degrees in the opposite direction, is less straight."""


@dataclass(frozen=True, eq=False)
class Corner:
    """A corner.

    Attributes
    ----------
    index : int
        Index of the nearest point.
    before, after : int
        Number of points before the corner, and index of the first point after it.
    angle : float
        Change of direction, rad.
    place : (p,) ndarray
        Position at which the straight lines before and after the corner meet, m.
    """

    index: int
    before: int
    after: int
    angle: float
    place: Array


def find_corners(
    points: Points, scatter: Scatter, tolerance: float
) -> tuple[Corner, ...]:
    """Return the corners of points, in order.

    Parameters
    ----------
    points : Points
    scatter : Scatter
        Scatter of the points.
    tolerance : float
        Corners that are rounded within this distance still count as corners, m.
    """
    if len(points) < 3 or points.dimension < 2:
        return ()
    u = lengths_along(points.position, scatter.deviation)
    spacing = u[-1] / (len(points) - 1)
    direction = 0.02  # rad: largest change of a direction due to scatter
    for_direction = 12.0 * spacing * (scatter.deviation / direction) ** 2
    near = for_direction ** (1.0 / 3.0)
    width = max(near, 2.0 * tolerance)
    least = 4 if scatter.deviation > 0.0 else 1
    near_turn = _turning(points.position, u, width, least)
    wide_turn = _turning(points.position, u, 2.0 * width, 2 * least)
    angle = near_turn.angle
    # Between lines that are farther apart, a smooth curve turns proportionally more, but a corner by the same angle.
    growth = wide_turn.distance / near_turn.distance
    share = (2.0 + growth) / 3.0
    doubt = _SURE * scatter.deviation * near_turn.uncertainty
    sharp = (wide_turn.angle > 0.0) & (wide_turn.angle < share * (angle - doubt))
    sharp &= wide_turn.straightness > _STRAIGHT
    # Points whose direction changes this much from one side to the next are not on a smooth curve.
    sides = _turning(points.position, u, 0.0, 1)
    doubt = 8.0 * scatter.deviation * sides.uncertainty
    sharp |= sides.angle - doubt > np.deg2rad(50.0)
    # A smooth arc, even if it is small compared with the tolerance, turns little from one side to the next.
    fine = _turning(points.position, u, near, least)
    sharp &= np.minimum(angle, fine.angle) > np.maximum(LEAST_ANGLE, angle / 4.0)
    peaks = _peaks(angle, sharp, u, width, least)
    # If the path bends, lines longer than scatter requires would miss the corner.
    return tuple(
        _locate(points, u, i, float(angle[i]), near, least, tolerance / 4.0)
        for i in peaks
    )


@dataclass(frozen=True, eq=False)
class _Turning:
    """Turning (change of direction) at each point, from lines fitted to the points before and after it; arrays (n,).

    Attributes
    ----------
    angle : ndarray
        Angle between the two lines, rad; zero at the ends.
    uncertainty : ndarray
        Standard deviation of the angle for a scatter of 1 m, rad.
    distance : ndarray
        Distance between the middles of the two lines along the path, m.
    straightness : ndarray
        The lower of the two ratios of the length of a line to that of the path; 1 if the points are on the lines.
    """

    angle: Array
    uncertainty: Array
    distance: Array
    straightness: Array


def _turning(position: Array, u: Array, width: float, least: int) -> _Turning:
    """Return the turning at places u, m, between lines fitted to `width`, m, or to at least `least` points."""
    index = np.arange(len(u))
    last = len(u) - 1
    begins = np.minimum(np.searchsorted(u, u - width), index - least)
    ends = np.maximum(np.searchsorted(u, u + width, side="right") - 1, index + least)
    before = _lines(position, u, np.clip(begins, 0, last), index)
    after = _lines(position, u, index, np.clip(ends, 0, last))
    apart = np.linalg.norm(before.direction - after.direction, axis=1)
    together = np.linalg.norm(before.direction + after.direction, axis=1)
    angle = 2.0 * np.arctan2(apart, together)
    angle[(index < least) | (index > last - least)] = 0.0
    return _Turning(
        angle,
        np.hypot(before.uncertainty, after.uncertainty),
        after.middle - before.middle,
        np.minimum(before.straightness, after.straightness),
    )


@dataclass(frozen=True, eq=False)
class _Lines:
    """Straight lines fitted to points: unit vectors, (n, p), and quantities, (n,), as in `_Turning`."""

    direction: Array
    uncertainty: Array
    middle: Array
    straightness: Array


def _lines(position: Array, u: Array, first: Indices, last: Indices) -> _Lines:
    """Return lines fitted to the points `first` to `last`, (n,), of positions (n, p) at places u, (n,)."""
    at = u[:, None]
    moment = np.hstack([np.ones_like(at), at, at**2, position, at * position])
    sums = np.cumsum(np.pad(moment, ((1, 0), (0, 0))), axis=0)
    sums_within = sums[last + 1] - sums[first]
    dimension = position.shape[1]
    count = sums_within[:, :1]
    mean = sums_within[:, 1:2] / count
    spread = np.maximum(sums_within[:, 2:3] - count * mean**2, 1e-24)
    slope = (
        sums_within[:, 3 + dimension :] - mean * sums_within[:, 3 : 3 + dimension]
    ) / spread
    sizes = np.maximum(np.linalg.norm(slope, axis=1), 1e-24)
    uncertainty = 1.0 / np.sqrt(spread[:, 0])
    return _Lines(slope / sizes[:, None], uncertainty, mean[:, 0], sizes)


def _peaks(
    angle: Array, sharp: np.ndarray, u: Array, width: float, least: int
) -> list[int]:
    """Return the index of the largest angle in each run of sharp angles that is as wide as the fitted lines."""
    peaks: list[int] = []
    for i in np.flatnonzero(sharp).tolist():
        near = bool(peaks) and (u[i] - u[peaks[-1]] < width or i - peaks[-1] < least)
        if not near:
            peaks.append(i)
        elif angle[i] > angle[peaks[-1]]:
            peaks[-1] = i
    return peaks


def _locate(
    points: Points, u: Array, i: int, angle: float, width: float, least: int, off: float
) -> Corner:
    """Return the corner near a point: the point itself, or where the lines before and after it come closest.

    The corner is the point itself if there is no scatter and the points on both sides lead to within `off`, m, of it.
    """
    position = points.position
    here = Corner(i, i, i + 1, angle, position[i])
    from_before = _continues(position, u, i, -1, off)
    from_after = _continues(position, u, i, 1, off)
    if least == 1 and from_before == from_after:
        return here
    sides = []
    for sign in (-1, 1):
        away = sign * (u - u[i])
        side = np.flatnonzero((away > 0.3 * width) & (away < 2.0 * width))
        if len(side) <= least:
            side = i + sign * np.arange(1, 1 + max(least, 2))
            side = np.clip(side, 0, len(u) - 1)
        along = sign * (position[side[0]] - position[i])
        if np.ptp(u[side]):
            along = np.polyfit(u[side], position[side], 1)[0]
        sides.append((position[side].mean(axis=0), along / np.linalg.norm(along)))
    (centre_before, a), (centre_after, b) = sides
    steps, *_ = np.linalg.lstsq(
        np.stack([a, -b], axis=1), centre_after - centre_before, rcond=None
    )
    place = (centre_before + steps[0] * a + centre_after + steps[1] * b) / 2.0
    gap = u[i + 1] - u[i - 1]  # an end of the path is not a corner
    after = float((position[i] - place) @ (a + b)) > 0.0
    far = np.linalg.norm(place - position[i]) > max(width, gap)
    if far or (least == 1 and after != from_after):
        return here
    return Corner(i, i + (not after), i + (not after), angle, place)


def _continues(position: Array, u: Array, i: int, sign: int, off: float) -> bool:
    """Return whether the cubic through four points on one side, or a lower degree through fewer, leads to a point.

    The cubic may miss the point by `off`, m, or by a small fraction of the spacing.
    """
    from scipy.interpolate import krogh_interpolate

    side = i + sign * np.arange(1, 5)
    side = side[(side >= 0) & (side < len(u))]
    if len(side) == 1:
        return True
    foreseen = krogh_interpolate(u[side], position[side], u[i])
    allowed = max(off, 0.03 * abs(u[side[0]] - u[i]))
    return bool(np.linalg.norm(foreseen - position[i]) <= allowed)


def fill_gaps(points: Points) -> Points:
    """Add points on straight sections five times as long as usual, and note the number of these sections."""
    chords = points.steps
    usual = float(np.median(chords))
    times = 5.0
    long = chords > times * usual
    if len(points) < 20 or not np.any(long):
        return points
    counts = np.minimum(np.ceil(chords / (2.0 * usual)), 200)
    index = np.arange(len(points))
    at = spread(index, np.where(long, counts, 1).astype(int))
    columns = interpolate_columns(at, index, points.columns)
    position, turning = np.hsplit(columns, [points.dimension])
    if points.has_quaternions:
        turning = with_like_signs(turning)
    gaps = write_count(int(np.count_nonzero(long)), "gap")
    note = f"treated as straight: {gaps} longer than {times:g} times the usual spacing"
    rows = points.only(np.ceil(at).astype(int))
    notes = (*points.notes, note)
    return replace(rows, position=position, turning=turning, notes=notes)


def blend_size(angle: float, distance: float, shortest: float) -> float:
    """Return the length that a blend must cut from either side to pass a corner of straight lines at a distance, m.

    With `size` cut from each side and unit tangents a, b, the ends of the blend are at -size a and size b relative to
    the corner, and the parameter of the blend has the length ``size (1 + cos(angle / 2))``, see `brachis.path.joins`.
    The middle of the blend is ``(b - a) (size / 2 - 11/64 length)`` away from the corner, and ``|b - a| = 2 sin(angle /
    2)``.

    Parameters
    ----------
    angle : float
        Change of direction, rad.
    distance : float
    shortest : float
        Length of the shorter of the two neighbouring curves, m.
    """
    of_size = 2.0 * sin(angle / 2.0) * (0.5 - 11.0 / 64.0 * (1.0 + cos(angle / 2.0)))
    return min(distance / of_size, 0.45 * shortest)
