"""Splines that follow a timing: the choice of their knots and control points.

In the fastest timing accelerations jump, but splines can only ramp. Knots are therefore close together where
accelerations jump, and far apart where accelerations are nearly linear. The control points of the splines' rates are
means of the curves' rates, which are sharpened where the rates change smoothly. As a result, no spline accelerates much
more than its curve does close by.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from brachis import kernel
from brachis.common.arrays import greville
from brachis.kernel import Spline, collocation
from brachis.optimise.boundary import Boundary, BoundarySpline
from brachis.optimise.bspline import clamped_knots, locate
from brachis.optimise.motion import Motion
from brachis.timing import TimedCourse, Timing
from brachis.timing.joint_path import halfway

_FIRST_INTERVALS = 8
"""Minimum number of intervals before halving."""
_PLACES_AN_INTERVAL = 250
"""Number of places of the joint path per interval before halving."""
_LONGER = 4.5
"""Maximum ratio between the lengths of neighbouring intervals."""
_SWITCH = 0.2
"""Relative change of the accelerations above which the change counts as a switch from one limit to another."""
_FEW = 5
"""Number of instants within an interval that are needed to tell whether the timing is smooth there. With 8, the motion
along an arc, with degree 5, was 0.1 % slower. With 3, a third more intervals were needed for the same end time."""
_POINT = 1e-12
"""Half length below which a chord is treated as a point, as a fraction of the time."""
_ANCHORED = 100
"""Number of intervals after which the splines are brought back to the positions of the timing."""


def breaks_for(
    course: TimedCourse, timing: Timing, tolerance: float, max_intervals: int
) -> np.ndarray:
    """Choose knots for splines that follow a timing.

    Intervals are halved, beginning with the interval that costs the most time. The cost of an interval of length h is h
    times the deviation of the accelerations from a straight line within it, as a fraction of the limits. A jump of
    d2p/dt2 costs less: if a ramp replaces it, the motion falls behind by the jump's height times h^2 / 24. No interval
    is shorter than the mean step of the timing, because the limits are imposed once per step.

    Parameters
    ----------
    course : TimedCourse
    timing : Timing
    tolerance : float
        Fraction of the time that all intervals together may cost.
    max_intervals : int
        Number of intervals at which halving stops. After that, only intervals beside much shorter ones are halved.

    Returns
    -------
    (N + 1,) ndarray
        Ends of the intervals in normalised time.
    """
    values = course.accelerations(timing)
    rate = timing.middle_rate
    acceleration = timing.acceleration
    t = 0.5 * (timing.times[1:] + timing.times[:-1]) / timing.t_end
    sizes = np.abs(values).max(axis=1)
    jumps = np.abs(np.diff(values, axis=0)).max(axis=1)
    # A smaller change comes from the limits themselves, and a ramp in its place would exceed them.
    is_switch = jumps > _SWITCH * np.maximum(sizes[1:], sizes[:-1])
    jumps = np.where(is_switch, jumps, 0.0)
    ramps = timing.t_end / 24.0 * np.abs(np.diff(acceleration))

    begins = kernel.halve_intervals(
        t,
        values,
        rate,
        jumps,
        ramps,
        least_times=_FEW,
        begin_count=max(_FIRST_INTERVALS, len(course.path.p) // _PLACES_AN_INTERVAL),
        tolerance=tolerance,
        shortest=1.0 / len(timing.times),
        max_count=max_intervals,
    )
    return even_out(np.append(begins, 1.0))


def even_out(breaks: np.ndarray) -> np.ndarray:
    """Halve those intervals between breaks, (N + 1,), that are much longer than their neighbours."""
    while True:
        steps = np.diff(breaks)
        beside = np.pad(steps, 1, constant_values=1.0)
        is_long = steps > _LONGER * np.minimum(beside[:-2], beside[2:])
        if not is_long.any():
            return breaks
        middles = 0.5 * (breaks[1:] + breaks[:-1])
        breaks = np.sort(np.append(breaks, middles[is_long]))


def move_breaks(breaks: np.ndarray, before: Timing, timing: Timing) -> np.ndarray:
    """Move knots, (N + 1,), to the times at which a new timing passes the same places."""
    places = np.interp(breaks, before.times / before.t_end, before.path.p)
    moved = np.interp(places, timing.path.p, timing.times / timing.t_end)
    return np.concatenate([[0.0], moved[1:-1], [1.0]])


def control_points_along(
    course: TimedCourse,
    timing: Timing,
    knots: np.ndarray,
    degree: int,
    delays: tuple[float, float],
) -> np.ndarray:
    """Compute control points, (c, N + d), of splines whose rates have means of the curves' rates as control points.

    A control point of the rate belongs to d - 1 knots. Its mean is the slope of a chord. The chord spans the largest
    interval that is symmetric around the mean of these knots and lies between the first and the last of them. With any
    knots, accelerations therefore stay within the range of the curves' accelerations close by. During the delays, s,
    before and after the timing, the curves keep the rates that they have at its ends.
    """
    t_end = timing.t_end + sum(delays)
    windows = sliding_window_view(knots[2:-2], degree - 1)
    places = windows.mean(axis=1)
    half = np.minimum(places - windows[:, 0], windows[:, -1] - places)
    half[half < _POINT] = 0.0
    ends = np.column_stack([places - half, places + half]) * t_end - delays[0]
    widths = ends[:, 1] - ends[:, 0]
    is_point = half <= 0.0
    y = course.curves(timing, ends.ravel())[0].reshape(len(ends), 2, -1)
    means = (y[:, 1] - y[:, 0]) / np.where(is_point, 1.0, widths)[:, None]
    means[is_point] = course.curves(timing, ends[is_point, 0])[1]
    # Add the second moments of the means and of control points relative to their curve.
    beside = half**2 / 6.0 + windows.var(axis=1) / (2.0 * max(degree - 2, 1))
    rates = _sharpen(means, places, half, beside)
    first = course.curves(timing, np.array([-delays[0]]))[0]
    steps = (knots[degree + 1 : -1] - knots[1 : -degree - 1]) * t_end / degree
    points = first + np.cumsum(rates * steps[:, None], axis=0)
    return np.concatenate([first, points]).T


def _sharpen(
    means: np.ndarray, places: np.ndarray, half: np.ndarray, beside: np.ndarray
) -> np.ndarray:
    """Convert means of a curve, (w, c), over `half`, (w,), on both sides into control points of a spline along it.

    A mean and its control point differ by the curve's second derivative times `beside`, (w,). To avoid oscillations
    beside a jump, the smallest second derivative close by is used, and zero where the second derivative changes sign.
    """
    widths = np.diff(places)[:, None]
    slopes = np.diff(means, axis=0) / widths
    # Find the places at which the slopes of these means are the curve's slopes.
    taken = halfway(places) + np.diff(half**2) / (6.0 * widths[:, 0])
    bends = np.diff(slopes, axis=0) / np.diff(taken)[:, None]
    near = sliding_window_view(np.pad(bends, ((1, 1), (0, 0))), 3, axis=0)
    is_smooth = np.abs(np.sign(near).sum(axis=-1)) == 3
    smallest = np.sign(bends) * np.abs(near).min(axis=-1)
    sharpened = means.copy()
    sharpened[1:-1] -= beside[1:-1, None] * np.where(is_smooth, smallest, 0.0)
    return sharpened


def between_stations(
    values: np.ndarray, breaks: np.ndarray, timing: Timing
) -> np.ndarray:
    """Return bounds between stations, (P - 1, c), from lines that lie above the values of knot intervals, (N, c)."""
    padded = np.concatenate([values[:1], values, values[-1:]])
    at_breaks = np.maximum(padded[1:], padded[:-1])
    t = timing.times / timing.t_end
    first, fraction = locate(breaks, t)
    share = fraction[:, None]
    lines = (1.0 - share) * at_breaks[first] + share * at_breaks[first + 1]
    between = np.maximum(lines[1:], lines[:-1])
    station = (np.searchsorted(t, breaks, side="right") - 1).clip(0, len(between) - 1)
    raise_to(between, station, at_breaks)
    return between


def raise_to(table: np.ndarray, rows: np.ndarray, values: np.ndarray) -> None:
    """Raise rows of a table, (R, c), to the largest of their values, (K, c). The row numbers, (K,), ascend."""
    first = np.flatnonzero(np.diff(rows, prepend=-1))
    largest = np.maximum.reduceat(values, first)
    table[rows[first]] = np.maximum(table[rows[first]], largest)


def third_points(
    boundary: Boundary, splines: Sequence[BoundarySpline], t_end: float
) -> np.ndarray:
    """Return the third control points from both ends, (2, c), where accelerations in motion are given; else NaN."""
    ends = boundary.start, boundary.end
    third = np.full((2, len(splines)), np.nan)
    for curve, spline in enumerate(splines):
        points = spline.fixed_points(t_end)
        for number, (end, place) in enumerate(zip(ends, (2, -3), strict=True)):
            if end[0].rate and len(end[curve].given) > 1:
                third[number, curve] = points[place]
    return third


def splines_along(
    course: TimedCourse,
    timing: Timing,
    knots: np.ndarray,
    degree: int,
    delays: tuple[float, float],
    third: np.ndarray,
) -> Motion:
    """Lay splines along a timing; see `control_points_along`.

    `third` are the third control points from the start and the end, (2, c), where accelerations are given; else NaN.
    """
    t_end = timing.t_end + sum(delays)
    points = control_points_along(course, timing, knots, degree, delays)
    places = greville(knots, degree)
    # Splines from means of rates miss the curves by a small error that grows along the motion.
    count = 1 + (len(places) - degree) // _ANCHORED
    anchors = np.linspace(0.0, 1.0, count + 1)
    inner = np.clip(anchors * t_end - delays[0], 0.0, timing.t_end)
    targets = course.curves(timing, inner)[0]
    for _ in range(2):
        reached = Motion(t_end, knots, degree, points).at(anchors * t_end)[0]
        points = points + _smoothly(anchors, targets - reached, places).T
    # A given acceleration changes the speed a little. So do all rates beyond, so that no acceleration overshoots there.
    for targets, second, ahead in ((third[0], 1, 1.0), (third[1], -2, -1.0)):
        next_point = second + int(ahead)
        step = places[next_point] - places[second]
        slope = np.nan_to_num(targets - points[:, next_point]) / step
        beyond = ahead * (ahead * (places - places[second])).clip(min=0.0)
        points = points + slope[:, None] * beyond * (1.0 - np.abs(beyond)) ** 2
    return Motion(t_end, knots, degree, points)


def _smoothly(
    anchors: np.ndarray, values: np.ndarray, places: np.ndarray
) -> np.ndarray:
    """Interpolate values, (A, c), given at anchors from 0 to 1, at places, (P,), with zero slope at both ends."""
    knots = clamped_knots(3, anchors)
    slopes = collocation(knots, 3, np.array([0.0, 1.0]), 1)
    matrix = np.vstack([collocation(knots, 3, anchors), slopes])
    right_side = np.vstack([values, np.zeros((2, values.shape[1]))])
    return Spline(knots, np.linalg.solve(matrix, right_side), 3)(places)
