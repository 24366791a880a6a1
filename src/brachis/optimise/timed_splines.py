"""Splines that follow a timing: where their knots stand, and their control points.

Accelerations of the fastest timing jump, and splines can only ramp: so knots stand close together where accelerations
jump, and far apart where they are nearly linear. The control points of the splines' rates are means of the curves'
rates, and are sharpened where these change smoothly: so no spline accelerates much more than its curve does near by.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from brachis import kernel
from brachis.common.arrays import greville
from brachis.kernel import Spline, collocation
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.motion import Motion
from brachis.timing import TimedCourse, Timing
from brachis.timing.joint_path import halfway

_FIRST_INTERVALS = 8
"""Intervals that are halved, no fewer."""
_PLACES_AN_INTERVAL = 250
"""Places for each of these."""
_LONGER = 4.5
"""Times the length of an interval that those beside it may have."""
_SWITCH = 0.2
"""Part of accelerations by which they change where the motion switches from one limit to another."""
_FEW = 5
"""Times within an interval that are needed to tell whether it is smooth. With 8 an arc of degree 5 was 0.1 % slower,
with 3 there were a third more intervals for the same time."""
_POINT = 1e-12
"""Half a chord below which it is a point, as a part of the time."""
_ANCHORED = 100
"""Intervals after which the splines are where the timing is."""


def breaks_for(
    course: TimedCourse, timing: Timing, tolerance: float, max_intervals: int
) -> np.ndarray:
    """Choose knots over which splines follow a timing.

    Intervals are halved, those first that lose most. An interval of length h loses h times how far accelerations are
    from linear within it, as a part of the limits. A jump of d2p/dt2 costs less: a ramp in its place takes the motion
    less far by the jump's height times h^2 / 24. None is shorter than the mean step of the timing: in a step the limits
    hold once.

    Parameters
    ----------
    course : TimedCourse
    timing : Timing
    tolerance : float
        Part of the time that all intervals together may lose.
    max_intervals : int
        Intervals with which halving ends, before those beside much shorter ones are halved too.

    Returns
    -------
    (N + 1,) ndarray
        In normalised time.
    """
    values = course.accelerations(timing)
    rate = timing.middle_rate
    acceleration = timing.acceleration
    t = 0.5 * (timing.times[1:] + timing.times[:-1]) / timing.t_end
    sizes = np.abs(values).max(axis=1)
    jumps = np.abs(np.diff(values, axis=0)).max(axis=1)
    # A smaller step is one of the limits themselves, which a ramp exceeds.
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
    """Halve intervals, (N + 1,), that are much longer than those beside them."""
    while True:
        steps = np.diff(breaks)
        beside = np.pad(steps, 1, constant_values=1.0)
        is_long = steps > _LONGER * np.minimum(beside[:-2], beside[2:])
        if not is_long.any():
            return breaks
        middles = 0.5 * (breaks[1:] + breaks[:-1])
        breaks = np.sort(np.append(breaks, middles[is_long]))


def control_points_along(
    course: TimedCourse,
    timing: Timing,
    knots: np.ndarray,
    degree: int,
    delays: tuple[float, float],
) -> np.ndarray:
    """Control points, (c, N + d), of splines whose rates have means of the curves' rates for control points.

    A control point of the rate belongs to d - 1 knots. Its mean is the chord over as many of these as are even beside
    their mean. So accelerations stay among those near by, whatever the knots. Beside its ends, for the delays, s, the
    timing keeps its rates.
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
    # Second moments of the means, and of control points beside their curve.
    beside = half**2 / 6.0 + windows.var(axis=1) / (2.0 * max(degree - 2, 1))
    rates = _sharpen(means, places, half, beside)
    first = course.curves(timing, np.array([-delays[0]]))[0]
    steps = (knots[degree + 1 : -1] - knots[1 : -degree - 1]) * t_end / degree
    points = first + np.cumsum(rates * steps[:, None], axis=0)
    return np.concatenate([first, points]).T


def _sharpen(
    means: np.ndarray, places: np.ndarray, half: np.ndarray, beside: np.ndarray
) -> np.ndarray:
    """Turn means of a curve, (w, c), over `half`, (w,), to both sides into control points of a spline that follows it.

    The curve's second derivative, times `beside`, (w,), lies between. It is taken for the smallest one near by, and for
    none where it changes its sign: so nothing swings beside a jump.
    """
    widths = np.diff(places)[:, None]
    slopes = np.diff(means, axis=0) / widths
    # Where means over different widths have the curve's slopes.
    taken = halfway(places) + np.diff(half**2) / (6.0 * widths[:, 0])
    bends = np.diff(slopes, axis=0) / np.diff(taken)[:, None]
    near = sliding_window_view(np.pad(bends, ((1, 1), (0, 0))), 3, axis=0)
    is_smooth = np.abs(np.sign(near).sum(axis=-1)) == 3
    smallest = np.sign(bends) * np.abs(near).min(axis=-1)
    sharpened = means.copy()
    sharpened[1:-1] -= beside[1:-1, None] * np.where(is_smooth, smallest, 0.0)
    return sharpened


def splines_along(
    course: TimedCourse,
    timing: Timing,
    knots: np.ndarray,
    degree: int,
    delays: tuple[float, float],
) -> Motion:
    """Lay splines along a timing; see `control_points_along`."""
    t_end = timing.t_end + sum(delays)
    points = control_points_along(course, timing, knots, degree, delays)
    places = greville(knots, degree)
    # Means of rates miss the curves by a little, which grows along the motion.
    count = 1 + (len(places) - degree) // _ANCHORED
    anchors = np.linspace(0.0, 1.0, count + 1)
    inner = np.clip(anchors * t_end - delays[0], 0.0, timing.t_end)
    targets = course.curves(timing, inner)[0]
    for _ in range(2):
        reached = Motion(t_end, knots, degree, points).at(anchors * t_end)[0]
        points = points + _smoothly(anchors, targets - reached, places).T
    return Motion(t_end, knots, degree, points)


def _smoothly(
    anchors: np.ndarray, values: np.ndarray, places: np.ndarray
) -> np.ndarray:
    """Interpolate values, (A, c), at anchors from 0 to 1, without a slope at the ends, at places, (P,)."""
    knots = clamped_knots(3, anchors)
    slopes = collocation(knots, 3, np.array([0.0, 1.0]), 1)
    matrix = np.vstack([collocation(knots, 3, anchors), slopes])
    right_side = np.vstack([values, np.zeros((2, values.shape[1]))])
    return Spline(knots, np.linalg.solve(matrix, right_side), 3)(places)
