"""A smooth curve within a tolerance of points, with few knots.

The curve is a quintic B-spline (C4) through the first and the last point, over roughly the arc length. Among all such
curves with the same knots, it has the least sum of squared distances from the points. Intervals in which the tolerance
is exceeded are halved. Then unnecessary knots are removed.

The place of a point along the curve follows from the points alone, and is then corrected by at most a few tolerances. A
path may therefore wind, cross itself, or be repeated: no point is assigned to a different turn, either by a first rough
curve or in the reported distances. The distances are measured to places on the curve in the order of the points, so
they are never too small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from brachis.common.arrays import spread
from brachis.task.point_data import FitTolerance
from brachis.task.points.checks import Scatter
from brachis.task.points.points import (
    Array,
    Points,
    angles_between,
    steps_of,
    sum_up,
)

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
"""Degree of all fitted curves, which are C4 at their knots."""
_NOISY_POINTS = 10
"""Minimum number of points in an interval if the points scatter. With fewer points, a curve would follow the
scatter."""
_AIM = 0.9
"""Fraction of the tolerance that a curve may use at points without scatter, because its error is larger between points.
With 1, the curves of 60 winding paths were up to 1.38 tolerances off between points; with 0.9, up to 1.06, for 2 % more
knots."""
_MANY = 15_000
"""Maximum number of points from which knots are chosen: 50,000 points of a raster took 9 s. Twenty turns of a helix
need 2,000 points.
"""
_REACH = 3.0
"""Maximum difference, in tolerances, between a place on the curve and the length along the points: more than the error
of these lengths, but less than the distance to another turn."""
_SMALL = 0.3
"""Fraction of the tolerance up to which scatter counts as small."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A B-spline fitted to points.

    Attributes
    ----------
    spline : BSpline
        Position and turning over sigma, which starts at 0 and is close to the arc length, m.
    breaks : (N + 1,) ndarray
        Knots of the spline, each listed once.
    sigma : (n,) ndarray
        Place on the curve that is nearest to each point.
    position_errors : (n,) ndarray
        Distances of the points from these places, m.
    turning_errors : (n,) ndarray
        Angles between given and fitted orientations there, rad.
    """

    spline: BSpline
    breaks: Array
    sigma: Array
    position_errors: Array
    turning_errors: Array

    def ratios(self, tolerance: FitTolerance) -> Array:
        """Return the errors relative to their tolerances, (n,): the larger of the two kinds of error at each point."""
        turning = self.turning_errors / tolerance.orientation
        return np.maximum(self.position_errors / tolerance.position, turning)

    def only(self, rows: slice) -> Fit:
        """Return the same fit, with errors only at some of the points."""
        return replace(
            self,
            sigma=self.sigma[rows],
            position_errors=self.position_errors[rows],
            turning_errors=self.turning_errors[rows],
        )

    def over_length(self, dimension: int) -> Fit:
        """Return the fit with sigma rescaled to end at the length of the curve; `dimension` counts position rows."""
        from scipy.integrate import simpson
        from scipy.interpolate import BSpline

        fine = spread(self.breaks, 32)
        speed = np.linalg.norm(self.spline(fine, nu=1)[:, :dimension], axis=1)
        scale = float(simpson(speed, x=fine)) / self.breaks[-1]
        return replace(
            self,
            spline=BSpline(scale * self.spline.t, self.spline.c, DEGREE),
            breaks=scale * self.breaks,
            sigma=scale * self.sigma,
        )

    def worst(self, tolerance: FitTolerance) -> float:
        """Return the largest error relative to its tolerance; see `ratios`."""
        return float(self.ratios(tolerance).max())

    def worst_between_knots(self, tolerance: FitTolerance) -> Array:
        """Return the largest of the `ratios` in each interval, (N,)."""
        worst = np.zeros(len(self.breaks) - 1)
        interval = np.searchsorted(self.breaks[1:-1], self.sigma, side="right")
        np.maximum.at(worst, interval, self.ratios(tolerance))
        return worst


@dataclass(frozen=True, eq=False)
class _Fitter:
    """Data shared by all fits to the same points.

    Attributes
    ----------
    points : Points
    lengths : (n,) ndarray
        Lengths along the path at the points, m, strictly ascending from zero.
    tolerance : FitTolerance
    """

    points: Points
    lengths: Array
    tolerance: FitTolerance

    def fit(self, breaks: Array) -> Fit:
        """Return the least-squares spline with these knots, (N + 1,), through the first and the last point.

        Every interval must contain a point, and there must be at least N + 5 points.
        """
        from scipy.interpolate import BSpline, make_lsq_spline

        columns = self.points.columns
        weights = np.ones(len(columns))
        weights[[0, -1]] = 1e3
        length = self.lengths[-1]
        knots = np.pad(breaks / length, DEGREE, mode="edge")
        offsets = columns - columns[0]
        places = self.lengths / length
        spline = make_lsq_spline(places, offsets, knots, k=DEGREE, w=weights)
        control_points = spline.c + columns[0]
        control_points[[0, -1]] = columns[[0, -1]]
        return self.measure(BSpline(knots * length, control_points, DEGREE))

    def interpolate(self) -> Fit:
        """Return the spline through all points; through a few points it is a polynomial without inner knots."""
        from scipy.interpolate import make_interp_spline

        degree = min(len(self.points) - 1, DEGREE)
        spline = make_interp_spline(self.lengths, self.points.columns, k=degree)
        if degree < DEGREE:
            at = np.linspace(0.0, self.lengths[-1], DEGREE + 1)
            spline = make_interp_spline(at, spline(at), k=DEGREE)
        return self.measure(spline)

    def measure(self, spline: BSpline) -> Fit:
        """Return the fit with the places on the curve nearest to the points, searched for close to `lengths`.

        Distances and angles are weighted by their tolerances, because angles locate scattered points better.
        """
        points = self.points
        dimension = points.dimension
        reach = _REACH * self.tolerance.position
        low = np.maximum(self.lengths - reach, 0.0)
        high = np.minimum(self.lengths + reach, self.lengths[-1])
        sizes = np.full(points.columns.shape[1], self.tolerance.orientation)
        sizes[:dimension] = self.tolerance.position
        sigma = self.lengths.copy()
        for _ in range(2):  # of Newton's method
            tangent = spline(sigma, nu=1) / sizes
            off = points.columns / sizes - spline(sigma) / sizes
            along = np.sum(off * tangent, axis=1)
            sigma += along / np.maximum(np.sum(tangent**2, axis=1), 1e-12)
            np.clip(sigma, low, high, out=sigma)
            sigma[[0, -1]] = self.lengths[[0, -1]]
        values = spline(sigma)
        off = values[:, :dimension] - points.position
        distances = np.linalg.norm(off, axis=1)
        angles = angles_between(values[:, dimension:], points.turning)
        return Fit(spline, np.unique(spline.t), sigma, distances, angles)


def lengths_along(position: Array, deviation: float) -> Array:
    """Return the length along the path at each of n positions, (n, p), m, strictly ascending from zero.

    If the points scatter, this is the length of the polygon through the means of blocks of points. The blocks are long
    compared with the scatter of the means.
    """
    count = len(position)
    block = _block(position, deviation)
    if block == 1:
        return sum_up(_arcs(position))
    edges = np.arange(0, count + 1, block)
    edges[-1] = count
    firsts = edges[:-1]
    means = np.add.reduceat(position, firsts) / np.diff(edges)[:, None]
    centres = (firsts + edges[1:] - 1) / 2.0
    corners = np.concatenate([position[:1], means, position[-1:]])
    index = np.concatenate([[-0.5], centres, [count - 0.5]])
    at_index = sum_up(_arcs(corners))
    lengths = np.interp(np.arange(count), index, at_index)
    return lengths - lengths[0]


def _arcs(position: Array) -> Array:
    """Return the arc lengths between n positions, (n - 1,), m, from circles through three successive positions."""
    chords = np.maximum(steps_of(position), 1e-9)
    directions = np.diff(position, axis=0) / chords[:, None]
    sine = steps_of(directions) * np.linalg.norm(
        directions[1:] + directions[:-1], axis=1
    )
    across = np.linalg.norm(position[2:] - position[:-2], axis=1)
    curvature = sine / np.maximum(across, 1e-300)
    around = np.pad(curvature, 1, mode="edge") if len(curvature) else np.zeros(2)
    half = np.clip(chords * (around[1:] + around[:-1]) / 4.0, 1e-9, 1.0)
    return chords * np.arcsin(half) / half


def _block(position: Array, deviation: float) -> int:
    """Return the number of points to average, doubled until blocks are far apart compared with the scatter."""
    count = len(position)
    block = 1
    while deviation > 0.0 and 8 * block < count:
        step = float(np.median(steps_of(position[::block])))
        if step > 20.0 * deviation / block**0.5:
            break
        block *= 2
    return block


def fit_points(points: Points, tolerance: FitTolerance, scatter: Scatter) -> Fit:
    """Return a curve with few knots within the tolerance of points, or the closest curve if there is none.

    If there are many points, knots are first chosen for some of the points, and then added for all points if needed.

    Parameters
    ----------
    points : Points
        At least two points; the position changes from each to the next.
    tolerance : FitTolerance
    scatter : Scatter
        Scatter of the points.
    """
    lengths = lengths_along(points.position, scatter.deviation)
    fitter = _Fitter(points, lengths, tolerance)
    if len(points) <= DEGREE:
        return fitter.interpolate()
    share = 1.0 if scatter.noisy(tolerance) else _AIM
    every = -(-len(points) // _MANY)
    some = np.unique(np.append(np.arange(0, len(points), every), len(points) - 1))
    fits = []
    for least in _least_points(tolerance, scatter):
        rough = _Fitter(points.only(some), lengths[some], _scale(tolerance, share))
        fit = _add_knots(rough, lengths[[0, -1]], least)
        worst = fit.worst(tolerance)
        if worst <= 1.0:
            aim = _scale(tolerance, max(worst, share))
            rough = replace(rough, tolerance=aim)
            fit = _remove_knots(rough, fit)
        fit = _add_knots(fitter, fit.breaks, least)
        if fit.worst(tolerance) <= 1.0:
            return fit
        fits.append(fit)
    if least == 1 and len(points) <= 2_000:
        return fitter.interpolate()
    return min(fits, key=lambda fit: fit.worst(tolerance))


def _scale(tolerance: FitTolerance, share: float) -> FitTolerance:
    """Return the tolerance with its position tolerance reduced to a fraction."""
    return tolerance.model_copy(update={"position": share * tolerance.position})


def _least_points(tolerance: FitTolerance, scatter: Scatter) -> tuple[int, ...]:
    """Return the minimum numbers of points per interval to try, in order.

    If the scatter is small compared with the tolerance, the curve may follow it where the path bends.
    """
    if not scatter.noisy(tolerance):
        return (1,)
    is_small = (
        scatter.deviation <= _SMALL * tolerance.position
        and scatter.turning <= _SMALL * tolerance.orientation
    )
    return (_NOISY_POINTS, _NOISY_POINTS // 2, 2, 1) if is_small else (_NOISY_POINTS,)


def _add_knots(fitter: _Fitter, breaks: Array, least: int) -> Fit:
    """Halve intervals, starting from `breaks`, until the tolerance is met or no interval can be halved.

    No interval gets fewer points than `least`. If an interval has too few points to be halved, its neighbours are
    halved.
    """
    lengths = fitter.lengths
    while True:
        fit = fitter.fit(breaks)
        firsts = np.searchsorted(lengths, breaks)
        firsts[-1] = len(lengths)
        bad = fit.worst_between_knots(fitter.tolerance) > 1.0
        has_points = np.diff(firsts) >= 2 * least
        stuck = np.pad(bad & ~has_points, 1)
        halved = (bad | stuck[:-2] | stuck[2:]) & has_points
        count = len(breaks) - 1 + np.count_nonzero(halved)
        if not halved.any() or count + DEGREE > len(lengths):
            return fit
        middles = (breaks[1:] + breaks[:-1]) / 2.0
        # Halve in the middle, or as close to it as possible with enough points on both sides.
        seconds = np.searchsorted(lengths, middles).clip(
            firsts[:-1] + least, firsts[1:] - least
        )
        low = lengths[seconds - 1]
        high = lengths[seconds]
        knots = np.where(
            (low < middles) & (middles <= high), middles, (low + high) / 2.0
        )
        breaks = np.union1d(breaks, knots[halved])


def _remove_knots(fitter: _Fitter, fit: Fit) -> Fit:
    """Remove knots, many at a time, as long as all points stay within the tolerance."""
    needed = np.empty(0)
    while True:
        worst = fit.worst_between_knots(fitter.tolerance)
        beside = np.maximum(worst[:-1], worst[1:])
        beside[np.isin(fit.breaks[1:-1], needed)] = np.inf
        # Never remove two neighbours at once, but only the one with more tolerance to spare.
        around = np.pad(beside, 1, constant_values=np.inf)
        chosen = (beside < 1.0) & (beside <= around[:-2]) & (beside < around[2:])
        removed = fit.breaks[1:-1][chosen]
        if not removed.size:
            return fit
        while removed.size:
            trial = fitter.fit(np.setdiff1d(fit.breaks, removed))
            bad = np.pad(trial.worst_between_knots(fitter.tolerance) > 1.0, 1)
            if not bad.any():
                fit = trial
                break
            near_bad = bad[:-2] | bad[1:-1] | bad[2:]
            back = near_bad[np.searchsorted(trial.breaks, removed) - 1]
            back |= not back.any()
            needed = np.append(needed, removed[back])
            removed = removed[~back]
