"""Splines that follow a timing: where their knots stand, and their control points.

Accelerations of the fastest timing jump, and splines can only ramp: so knots stand close together where accelerations
jump, and far apart where they are nearly linear. The control points of the splines' rates are means of the curves'
rates: no such spline accelerates more than the curve that it follows does near by.
"""

from __future__ import annotations

import heapq
import itertools

import numpy as np

from brachis.common import tolerances
from brachis.optimise.boundary import greville
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.timing import TimedCourse, Timing

_FIRST_INTERVALS = 8
"""Intervals that are halved, no fewer."""
_PLACES_AN_INTERVAL = 250
"""Places for each of these."""
_SHORTEST = 0.2
"""Shortest interval that is halved: this part of the tolerance, for each of the first intervals."""
_ANCHORED = 100
"""Intervals after which the splines are where the timing is."""


def breaks_for(
    course: TimedCourse, timing: Timing, tolerance: float, *, from_rest: bool
) -> np.ndarray:
    """Choose knots over which splines follow a timing.

    Intervals are halved, those first that lose most: their length times how far accelerations are from linear within
    them, as a part of the limits.

    Parameters
    ----------
    course : TimedCourse
    timing : Timing
    tolerance : float
        Part of the time that all intervals together may lose.
    from_rest : bool
        Whether accelerations vanish at both ends.

    Returns
    -------
    (N + 1,) ndarray
        In normalised time.
    """
    values = course.accelerations(timing)
    t = 0.5 * (timing.times[1:] + timing.times[:-1]) / timing.t_end
    if from_rest:
        # Accelerations begin and end at zero.
        values = np.pad(values, ((1, 1), (0, 0)), mode="edge")
        values = np.pad(values, ((1, 1), (0, 0)))
        t = np.concatenate([[0.0, tolerances.TIME], t, [1.0 - tolerances.TIME, 1.0]])

    def loss(low: float, high: float) -> float:
        first, last = np.searchsorted(t, [low, high])
        inside = values[max(first - 1, 0) : last + 1]
        at = t[max(first - 1, 0) : last + 1]
        if len(at) < 3:
            return 0.0
        part = (at - at[0]) / (at[-1] - at[0])
        line = inside[0] + part[:, None] * (inside[-1] - inside[0])
        return float(np.abs(inside - line).max() * (high - low))

    pieces = max(_FIRST_INTERVALS, len(course.path.p) // _PLACES_AN_INTERVAL)
    shortest = _SHORTEST * tolerance / pieces
    evenly = np.linspace(0.0, 1.0, pieces + 1)
    queue = [(-loss(*pair), *pair) for pair in itertools.pairwise(evenly)]
    heapq.heapify(queue)
    done = []
    lost = -sum(item[0] for item in queue)
    while lost > tolerance and queue:
        worst, low, high = heapq.heappop(queue)
        lost += worst
        if high - low < shortest:
            done.append(low)
            continue
        middle = 0.5 * (low + high)
        for part in ((low, middle), (middle, high)):
            own = loss(*part)
            lost += own
            heapq.heappush(queue, (-own, *part))
    begins = np.sort([*done, *(low for _, low, _ in queue)])
    return np.append(begins, 1.0)


def spline_along(
    course: TimedCourse,
    timing: Timing,
    knots: np.ndarray,
    degree: int,
    vanishing: tuple[int, int],
) -> np.ndarray:
    """Control points, (c, N + d), of splines whose rates have means of the curves' rates for control points.

    At the ends so many derivatives, from the acceleration on, vanish.

    A control point of the rate belongs to d - 1 knots. Its mean is weighted by the B-spline over these; for cubics this
    is the chord over an interval. Curves of degree 2 are met exactly, and accelerations stay among those near by.
    """
    t_end = timing.t_end
    windows = np.lib.stride_tricks.sliding_window_view(knots[2:-2], degree - 1)
    widths = windows[:, -1] - windows[:, 0]
    is_point = widths <= 0.0
    if degree == 3:
        y = course.curves(timing, windows.ravel() * t_end)[0]
        y = y.reshape(len(windows), 2, -1)
        rates = (y[:, 1] - y[:, 0]) / np.where(is_point, 1.0, widths * t_end)[:, None]
    else:
        rates = _weighted_rates(course, timing, windows)
    rates[is_point] = course.curves(timing, windows[is_point, 0] * t_end)[1]
    first = course.curves(timing, np.zeros(1))[0]
    rates = _without_bias(rates, knots, degree, vanishing)
    # What that takes from the rates is spread over all.
    places = _windows(knots[2:-2], degree - 1).mean(axis=1)
    end = course.curves(timing, np.array([t_end]))[1]
    rates = rates + (places**2 * (3.0 - 2.0 * places))[:, None] * (end - rates[-1])
    return np.concatenate([first, _integrate(first, rates, knots[1:-1], t_end)]).T


def _windows(knots: np.ndarray, count: int) -> np.ndarray:
    return np.lib.stride_tricks.sliding_window_view(knots, count)


def _integrate(
    first: np.ndarray, rates: np.ndarray, knots: np.ndarray, t_end: float
) -> np.ndarray:
    """Control points behind the first one, (w, c), of splines with these control points of the rate, (w, c)."""
    degree = len(knots) - len(rates)
    support = _windows(knots, degree + 1)
    steps = (support[:, -1] - support[:, 0]) * t_end / degree
    return np.asarray(first + np.cumsum(rates * steps[:, None], axis=0))


def _without_bias(
    rates: np.ndarray, knots: np.ndarray, degree: int, vanishing: tuple[int, int]
) -> np.ndarray:
    """Move the accelerations from where their means are taken to where they belong.

    Where intervals of different length meet these places differ. Slopes are the smaller ones of both sides, so that
    nothing swings beside a jump.
    """
    inner = _windows(knots[2:-2], degree)
    widths = (inner[:, -1] - inner[:, 0])[:, None] / (degree - 1)
    means = np.diff(rates, axis=0) / widths
    taken = inner.mean(axis=1)
    belong = inner[:, 1:-1].mean(axis=1) if degree > 2 else taken
    slopes = np.diff(means, axis=0) / np.diff(taken)[:, None]
    before = np.concatenate([slopes[:1], slopes])
    behind = np.concatenate([slopes, slopes[-1:]])
    smaller = np.where(np.abs(before) < np.abs(behind), before, behind)
    smaller = np.where(before * behind > 0.0, smaller, 0.0)
    moved = means + smaller * (belong - taken)[:, None]
    moved[: vanishing[0]] = 0.0
    moved[len(moved) - vanishing[1] :] = 0.0
    return np.concatenate([rates[:1], rates[:1] + np.cumsum(moved * widths, axis=0)])


def _weighted_rates(
    course: TimedCourse, timing: Timing, windows: np.ndarray
) -> np.ndarray:
    """Means of the curves' rates, (w, c), weighted by the B-splines over windows of knots, (w, k)."""
    from scipy.interpolate import BSpline

    count = windows.shape[1]
    if count == 1:
        return course.curves(timing, windows[:, 0] * timing.t_end)[1]
    nodes, weights = np.polynomial.legendre.leggauss(16)
    found = []
    for knots in windows:
        if knots[-1] <= knots[0]:
            found.append(np.zeros(course.curves(timing, np.zeros(1))[1].shape[1]))
            continue
        basis = BSpline.basis_element(knots)
        inner = np.unique(knots)
        half = 0.5 * np.diff(inner)
        t = (0.5 * (inner[1:] + inner[:-1])[:, None] + half[:, None] * nodes).ravel()
        share = (half[:, None] * weights).ravel() * basis(t)
        rates = course.curves(timing, t * timing.t_end)[1]
        found.append(share @ rates / share.sum())
    return np.array(found)


def fit(phase: Phase, course: TimedCourse, timing: Timing) -> np.ndarray:
    """Point x, (v,), of a phase that follows a timing; see `spline_along`."""
    knots = phase.knots
    t_end = timing.t_end
    ends = phase.boundary.start, phase.boundary.end
    first, last = (max(len(end[-1].derivatives) - 1, 0) for end in ends)
    points = spline_along(course, timing, knots, phase.degree, (first, last))
    places = greville(knots, phase.degree)
    # Means of rates miss the curves by a little, which grows along the motion.
    count = 1 + phase.intervals // _ANCHORED
    anchors = np.linspace(0.0, 1.0, count + 1)
    wanted = course.curves(timing, anchors * t_end)[0]
    for _ in range(2):
        reached = Motion(t_end, knots, phase.degree, points).at(anchors * t_end)[0]
        points = points + _smoothly(anchors, wanted - reached, places).T
    return phase.variables_from(Motion(t_end, knots, phase.degree, points))


def _smoothly(
    anchors: np.ndarray, values: np.ndarray, places: np.ndarray
) -> np.ndarray:
    """Interpolate values, (A, c), at anchors without a slope at the ends, at places, (P,)."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(anchors, values, bc_type="clamped")(places))
