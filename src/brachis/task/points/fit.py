"""A smooth curve within a tolerance of points, with few knots; and how far points are from it, by another formula.

The curve is a quintic B-spline, C4, through the first and the last point; of all with the same knots it has the least
sum of squared distances. Intervals in which the tolerance is exceeded are halved; then knots that are not needed are
taken away, and fewer ones spread in the same proportion are tried.

For the distances the curve is drawn as a polygon of many sides. Stretch by stretch of the points, the nearest of its
corners to each is found in a k-d tree of those near where the stretch before ended: a path may cross itself, or
go round several times. The nearest place on the two sides at this corner is a place on the curve, to which distance and
angle are taken. Where the fit took the point to be is not known here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.common.arrays import spread
from brachis.task.point_data import FitTolerance
from brachis.task.points.checks import Scatter
from brachis.task.points.points import (
    Array,
    Points,
    angles_between,
    project_on_sides,
    steps_of,
    sum_up,
)

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
"""Of all fitted curves: C4 at their knots."""
_NOISY_POINTS = 10
"""Least number of points in an interval where points scatter: with fewer a curve would follow the scatter."""
_SMALL = 0.3
"""Part of the tolerance up to which scatter is small."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A B-spline near points.

    Attributes
    ----------
    spline : BSpline
        Position and turning over sigma from 0 on, about the arc length, m.
    breaks : (N + 1,) ndarray
        Its knots, each once.
    sigma : (n,) ndarray
        For every point, the nearest place on the curve.
    position_errors : (n,) ndarray
        Distances, m.
    turning_errors : (n,) ndarray
        Angles there, rad.
    """

    spline: BSpline
    breaks: Array
    sigma: Array
    position_errors: Array
    turning_errors: Array

    def ratios(self, tolerance: FitTolerance) -> Array:
        """Return for every point how much of the tolerance it takes, (n,)."""
        turning = self.turning_errors / tolerance.orientation
        return np.maximum(self.position_errors / tolerance.position, turning)

    def worst(self, tolerance: FitTolerance) -> Array:
        """Return the largest of `ratios` in every interval, (N,)."""
        worst = np.zeros(len(self.breaks) - 1)
        np.maximum.at(worst, self.intervals, self.ratios(tolerance))
        return worst

    @property
    def intervals(self) -> np.ndarray:
        """The interval of every point, (n,)."""
        return np.searchsorted(self.breaks[1:-1], self.sigma, side="right")


def _fit_over(points: Points, sigma: Array, breaks: Array) -> Fit:
    """Return the spline with given knots whose squared distances from the points are least; it passes both ends.

    Parameters
    ----------
    points : Points
    sigma : (n,) ndarray
        Where on the curve the points are, roughly; their nearest places are then looked for.
    breaks : (N + 1,) ndarray
        Knots.

    Raises
    ------
    ValueError, LinAlgError
        The knots are too dense for the points.
    """
    from scipy.interpolate import BSpline, make_lsq_spline

    order = np.argsort(sigma, kind="stable")
    columns = points.columns
    weights = np.ones(len(points))
    weights[[0, -1]] = 1e3
    origin = columns[0]
    length = float(breaks[-1])
    knots = np.pad(breaks / length, DEGREE, mode="edge")
    inside = np.clip(sigma[order] / length, 0.0, 1.0)
    spline = make_lsq_spline(
        inside, columns[order] - origin, knots, k=DEGREE, w=weights[order]
    )
    if not np.isfinite(spline.c).all():
        raise ValueError("the knots are too dense for the points")
    control_points = spline.c + origin
    control_points[[0, -1]] = columns[[0, -1]]
    spline = BSpline(knots * length, control_points, DEGREE)
    return _measure(points, spline, breaks, sigma)


def _measure(points: Points, spline: BSpline, breaks: Array, sigma: Array) -> Fit:
    """Return the fit with the places on the curve that are nearest to the points, by Newton steps from `sigma`."""
    dimension = points.dimension
    sigma = sigma.copy()
    # Of a path that winds, a first rough curve is near points of other windings, too: these are not for the taking.
    far = 0.02 * (breaks[-1] - breaks[0])
    low = np.maximum(sigma - far, breaks[0])
    high = np.minimum(sigma + far, breaks[-1])
    for _ in range(2):
        tangent = spline(sigma, nu=1)[:, :dimension]
        off = points.position - spline(sigma)[:, :dimension]
        along = np.sum(off * tangent, axis=1)
        sigma += along / np.maximum(np.sum(tangent**2, axis=1), 1e-12)
        np.clip(sigma, low, high, out=sigma)
        sigma[[0, -1]] = breaks[[0, -1]]
    values = spline(sigma)
    distances = np.linalg.norm(values[:, :dimension] - points.position, axis=1)
    angles = angles_between(values[:, dimension:], points.turning)
    return Fit(spline, breaks, sigma, distances, angles)


def _over_arc_length(fit: Fit, points: Points) -> tuple[Array, Array]:
    """Return the points' places and the knots, measured by the arc length of the fitted position instead of sigma."""
    fine = spread(fit.breaks, 16)
    middle = (fine[1:] + fine[:-1]) / 2.0
    speed, between = (
        np.linalg.norm(fit.spline(at, nu=1)[:, : points.dimension], axis=1)
        for at in (fine, middle)
    )
    steps = np.diff(fine) * (speed[:-1] + 4.0 * between + speed[1:]) / 6.0
    lengths = sum_up(steps)
    return np.interp(fit.sigma, fine, lengths), np.interp(fit.breaks, fine, lengths)


def lengths_along(position: Array, deviation: float) -> Array:
    """Return the length along the path at each of n positions, (n, p), m; strictly ascending from zero.

    Where the points scatter, it is that of the polygon through the means of blocks of points, so long that the scatter
    of the means is small beside it.
    """
    count = len(position)
    block = _block(position, deviation)
    if block == 1:
        return sum_up(np.maximum(steps_of(position), 1e-9))
    edges = np.arange(0, count + 1, block)
    edges[-1] = count
    firsts = edges[:-1]
    means = np.add.reduceat(position, firsts) / np.diff(edges)[:, None]
    centres = (firsts + edges[1:] - 1) / 2.0
    corners = np.concatenate([position[:1], means, position[-1:]])
    chords = np.maximum(steps_of(corners), 1e-9)
    index = np.concatenate([[-0.5], centres, [count - 0.5]])
    at_index = sum_up(chords)
    lengths = np.interp(np.arange(count), index, at_index)
    return lengths - lengths[0]


def _block(position: Array, deviation: float) -> int:
    """Return how many points are averaged: twice as many until the blocks are far apart beside the scatter."""
    count = len(position)
    block = 1
    while deviation > 0.0 and 8 * block < count:
        step = float(np.median(steps_of(position[::block])))
        if step > 20.0 * deviation / block**0.5:
            break
        block *= 2
    return block


def fit_points(points: Points, tolerance: FitTolerance, scatter: Scatter) -> Fit:
    """Return a curve within the tolerance of points, or the one that is nearest to it.

    Parameters
    ----------
    points : Points
        At least two; the position moves from each to the next.
    tolerance : FitTolerance
    scatter : Scatter
        Of the points.
    """
    sigma = lengths_along(points.position, scatter.deviation)
    if len(points) <= DEGREE:
        return _interpolate(points, sigma)
    every = -(-len(points) // 8_000)  # points that are looked at while knots are added
    chosen = np.unique(np.append(np.arange(0, len(points), every), len(points) - 1))
    fits = []
    for least in _least_points(tolerance, scatter):
        rough = _add_knots(
            points.only(chosen),
            sigma[chosen],
            _first_breaks(points, sigma),
            tolerance,
            least,
        )
        if rough is None:
            break
        places, breaks = _over_arc_length(rough, points)
        along = np.interp(sigma, sigma[chosen], np.maximum.accumulate(places))
        fit = _add_knots(points, along, breaks, tolerance, least)
        if fit is None:
            break
        if fit.ratios(tolerance).max() <= 1.0:
            return _use_fewest_knots(
                points, _remove_knots(points, fit, tolerance), tolerance
            )
        fits.append(fit)
    if not fits or (not scatter.noisy(tolerance) and len(points) <= 2_000):
        return _interpolate(points, fits[-1].sigma if fits else sigma)
    return min(fits, key=lambda fit: float(fit.ratios(tolerance).max()))


def _least_points(tolerance: FitTolerance, scatter: Scatter) -> tuple[int, ...]:
    """List the least numbers of points an interval may have, in the order in which they are tried.

    Scatter that is small beside the tolerance may be followed where the path bends.
    """
    if not scatter.noisy(tolerance):
        return (1,)
    is_small = (
        scatter.deviation <= _SMALL * tolerance.position
        and scatter.turning <= _SMALL * tolerance.orientation
    )
    return (_NOISY_POINTS, _NOISY_POINTS // 2, 2, 1) if is_small else (_NOISY_POINTS,)


def _first_breaks(points: Points, sigma: Array) -> Array:
    """Return the knots to begin with: as many intervals as the path is longer than what it extends over."""
    count = max(1, min(int(sigma[-1] / points.extent), len(points) // _NOISY_POINTS))
    return np.linspace(0.0, float(sigma[-1]), count + 1)


def _add_knots(
    points: Points, sigma: Array, breaks: Array, tolerance: FitTolerance, least: int
) -> Fit | None:
    """Halve the intervals in which the tolerance is exceeded, until none is or none can be; None where no fit is.

    No interval gets fewer points than `least`.
    """
    fit = None
    for _ in range(40):
        try:
            fit = _fit_over(points, sigma, breaks)
        except (ValueError, np.linalg.LinAlgError):
            return fit
        bad = fit.worst(tolerance) > 1.0
        counts = np.bincount(fit.intervals, minlength=len(breaks) - 1)
        halved = np.flatnonzero(bad & (counts >= 2 * least))
        if not halved.size:
            return fit
        sigma = fit.sigma
        breaks = np.union1d(breaks, (breaks[halved] + breaks[halved + 1]) / 2.0)
    return fit


def _remove_knots(points: Points, fit: Fit, tolerance: FitTolerance) -> Fit:
    """Take knots away, many at a time, as long as all points stay within the tolerance."""
    needed = np.empty(0)
    for _ in range(12):
        removed = _removable(fit, tolerance, needed)
        if not removed.size:
            break
        left = np.setdiff1d(fit.breaks, removed)
        trial = _fit_over(points, fit.sigma, left)
        back = removed[_near_bad(left, trial.worst(tolerance) > 1.0, removed)]
        if back.size:
            needed = np.append(needed, back)
            if len(back) == len(removed):
                continue
            trial = _fit_over(points, fit.sigma, np.union1d(left, back))
            if trial.ratios(tolerance).max() > 1.0:
                needed = np.append(needed, removed)
                continue
        fit = trial
    return fit


def _near_bad(breaks: Array, bad: np.ndarray, removed: Array) -> np.ndarray:
    """Tell which of the removed knots lie in a bad interval, or in one beside it."""
    wide = bad.copy()
    wide[1:] |= bad[:-1]
    wide[:-1] |= bad[1:]
    return wide[np.searchsorted(breaks, removed) - 1]


def _use_fewest_knots(points: Points, fit: Fit, tolerance: FitTolerance) -> Fit:
    """Spread fewer knots as densely in proportion, over the arc length, as long as all points are within the tolerance.

    Their number is halved between one that will do and one that will not.
    """
    sigma, breaks = _over_arc_length(fit, points)
    most = len(breaks) - 1
    fewest = most // 2
    trial = _fit_over(points, sigma, breaks)
    if trial.ratios(tolerance).max() <= 1.0:
        fit = trial
    while most - fewest > 1:
        count = (most + fewest) // 2
        fewer = np.quantile(breaks, np.linspace(0.0, 1.0, count + 1))
        trial = _fit_over(points, sigma, fewer)
        if trial.ratios(tolerance).max() <= 1.0:
            most = count
            fit = trial
        else:
            fewest = count
    return fit


def _removable(fit: Fit, tolerance: FitTolerance, needed: Array) -> Array:
    """Choose knots that are not neighbours, those with the least of the tolerance taken beside them first."""
    worst = fit.worst(tolerance)
    beside = np.maximum(worst[:-1], worst[1:])
    taken = np.zeros(len(beside) + 2, dtype=bool)
    for i in np.argsort(beside):
        if (
            beside[i] < 0.95
            and not np.any(needed == fit.breaks[i + 1])
            and not (taken[i] or taken[i + 2])
        ):
            taken[i + 1] = True
    return fit.breaks[1:-1][taken[1:-1]]


def _interpolate(points: Points, sigma: Array) -> Fit:
    """Return the spline through all points: through few of them a polynomial, without inner knots."""
    from scipy.interpolate import make_interp_spline

    degree = min(len(points) - 1, DEGREE)
    spline = make_interp_spline(sigma, points.columns, k=degree)
    if degree < DEGREE:
        at = np.linspace(0.0, sigma[-1], DEGREE + 1)
        spline = make_interp_spline(at, spline(at), k=DEGREE)
    return _measure(points, spline, np.unique(spline.t), sigma)


def deviations(points: Points, spline: BSpline) -> tuple[Array, Array]:
    """Return the distances, m, and the angles, rad, between points and a curve, (n,) each.

    Parameters
    ----------
    points : Points
        In the order in which the curve passes them; it begins at the first one.
    spline : BSpline
        Position and turning, as `Points.columns`.
    """
    breaks = np.unique(spline.t)
    count = max(64, 20_000 // (len(breaks) - 1))
    sigma = spread(breaks, count)
    dimension = points.dimension
    place = spline(sigma)[:, :dimension]
    nearest = _nearest(points.position, place)
    distances = np.full(len(points), np.inf)
    at = np.zeros(len(points))
    for offset in (-1, 0):
        first = np.clip(nearest + offset, 0, len(place) - 2)
        begin = place[first]
        side = place[first + 1] - begin
        share, away = project_on_sides(points.position, begin, side)
        nearer = away < distances
        distances[nearer] = away[nearer]
        at[nearer] = (sigma[first] + share * (sigma[first + 1] - sigma[first]))[nearer]
    curve = spline(at)
    distances = np.linalg.norm(points.position - curve[:, :dimension], axis=1)
    return distances, angles_between(curve[:, dimension:], points.turning)


def _nearest(position: Array, place: Array) -> Array:
    """Return the polygon's nearest corner to each of n points, (n,), in their order."""
    from scipy.spatial import cKDTree

    along = sum_up(steps_of(place))
    nearest = np.zeros(len(position), dtype=int)
    reached = 0.0
    for stretch, length in _stretches(position, along[-1]):
        beyond = 0.01 * along[-1]  # of the stretch's ends
        low, high = np.searchsorted(
            along, [reached - beyond, reached + length + beyond]
        )
        low = max(0, low - 1)
        high = high + 1
        nearest[stretch] = low + cKDTree(place[low:high]).query(position[stretch])[1]
        reached = along[nearest[stretch][-1]]
    return nearest


def _stretches(position: Array, total: float) -> Iterator[tuple[slice, float]]:
    """Cut n points into stretches, with the length of each from the last point before it to its own last one, m.

    The points' polygon is at least as long as the path between them, but for the tolerance.
    """
    lengths = sum_up(steps_of(position))
    most = max(1, len(position) // 1_000)
    first = 0
    while first < len(position):
        before = lengths[max(first - 1, 0)]
        last = min(
            int(np.searchsorted(lengths, before + 0.005 * total, side="right")),
            first + most,
        )
        last = max(last, first + 1)
        yield slice(first, last), float(lengths[last - 1] - before)
        first = last
