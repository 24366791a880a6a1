"""The points between two corners, and their fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brachis.cam.blends import blend_size
from brachis.cam.corners import Corner
from brachis.cam.deviations import deviations
from brachis.cam.fit import fit_points
from brachis.cam.least_squares import Fit, Tolerance
from brachis.cam.points import Array, Points
from brachis.cam.scatter import Scatter

_OF_SCATTER = 6.0
_ROUNDING = 1e-6
_DRAWN, _TINY = 1e-3, 1e-8
"""By how much a distance may be overestimated, as a part of the tolerance and in m or rad."""
_SHARPEST = np.deg2rad(150.0)
_LEAST_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Stretch:
    """Points from one corner to the next.

    Attributes
    ----------
    points : Points
        With the corners, at their places, as first and last ones.
    given : slice
        Those that are the user's, without the corners.
    fit : Fit
    distances, angles : ndarray
        How far the given points are from the curve, m and rad.
    """

    points: Points
    given: slice
    fit: Fit
    distances: Array
    angles: Array

    @property
    def length(self) -> float:
        """Range of sigma, about the arc length, m."""
        return float(self.fit.breaks[-1])

    @property
    def sigma(self) -> Array:
        """Where the given points are."""
        return self.fit.sigma[self.given]


def fit_between(
    points: Points, corners: tuple[Corner, ...], tolerance: Tolerance, scatter: Scatter, doubt: str | None = None
) -> list[Stretch]:
    """Cut points at their corners and fit a curve to each stretch.

    What of the points is hardly meant, `doubt`, is the hint where that cannot be done.

    Raises
    ------
    TaskError
        The path turns back, or there is no smooth curve within the tolerance.
    """
    for sharp in corners:
        if sharp.angle > _SHARPEST:
            problem = f"the path turns back, by {np.rad2deg(sharp.angle):.4g} degrees"
            found, hint = points.described(sharp.index), "A path that stops there is for two tasks"
            raise points.wrong(sharp.index, problem, found=found, allowed="corners up to 150 degrees", hint=hint)
    starts, ends = [None, *corners], [*corners, None]
    stretches = []
    for start, end in zip(starts, ends, strict=True):
        given = np.arange(0 if start is None else start.after, len(points) if end is None else end.before)
        before, after = ([] if corner is None else [corner.index] for corner in (start, end))
        whole = points.only(np.concatenate([before, given, after]).astype(int))
        position = whole.position.copy()
        for corner, row in ((start, 0), (end, -1)):
            if corner is not None:
                position[row] = corner.place
        whole = replace(whole, position=position)
        chosen = slice(len(before), len(before) + len(given))
        fit = _fitted(whole, tolerance, scatter, doubt)
        distances, angles = _checked(whole, fit, tolerance)
        stretches.append(Stretch(whole, chosen, fit, distances[chosen], angles[chosen]))
    return stretches


def _checked(points: Points, fit: Fit, tolerance: Tolerance) -> tuple[Array, Array]:
    """Return distances and angles of points from their fit, by another formula than the fit's.

    Raises
    ------
    TaskError
        A point is farther away than the tolerance allows.
    """
    distances, angles = deviations(points, fit.spline)
    for found, allowed, per, unit in (
        (distances, tolerance.position, 1e-3, "mm"),
        (angles, tolerance.orientation, np.pi / 180.0, "deg"),
    ):
        i = int(np.argmax(found))
        if found[i] > allowed * (1.0 + _DRAWN) + _TINY:
            problem = "the fitted curve does not pass the points within the tolerance"
            hint = "Raise the tolerance, or cut the path into several"
            away = f"{points.described(i)}, {found[i] / per:.4g} {unit} off"
            raise points.wrong(i, problem, found=away, allowed=f"{allowed / per:.4g} {unit}", hint=hint)
    return distances, angles


def blend_between(first: Stretch, second: Stretch, corner: Corner, tolerance: Tolerance) -> float:
    """Return the size of the blend that keeps all points near a corner within the tolerance, m.

    Raises
    ------
    TaskError
        The points leave no room.
    """
    corner_at = first.points.described(len(first.points) - 1)
    wrong = first.points.wrong
    shortest = min(first.length, second.length)
    widest = blend_size(corner.angle, tolerance.corner, shortest)
    taken = max(
        float(first.distances[first.sigma > first.length - widest].max(initial=0.0)),
        float(second.distances[second.sigma < widest].max(initial=0.0)),
    )
    left = tolerance.corner - taken
    if left < _LEAST_SHARE * tolerance.corner:
        problem = f"the corner of {np.rad2deg(corner.angle):.4g} degrees cannot be rounded within the tolerance"
        found = f"points {1e3 * taken:.3g} mm from the fit at {corner_at}"
        hint = "Give a larger tolerance.corner"
        raise wrong(-1, problem, found=found, allowed=f"{1e3 * tolerance.corner:.3g} mm", hint=hint)
    return blend_size(corner.angle, left, shortest)


def _fitted(points: Points, tolerance: Tolerance, scatter: Scatter, doubt: str | None) -> Fit:
    """Fit one curve.

    Raises
    ------
    TaskError
    """
    try:
        fit = fit_points(points, tolerance, scatter)
    except ValueError as error:
        problem, allowed = "no smooth curve follows these points", "points that move on from each to the next"
        hint = doubt or "Does the path turn back, or stand still, near there?"
        raise points.wrong(
            0, problem, found=f"{error}, from {points.described(0)}", allowed=allowed, hint=hint
        ) from error
    ratios = fit.ratios(tolerance)
    i = int(np.argmax(ratios))
    if ratios[i] <= 1.0 + _ROUNDING:
        return fit
    of_turning, hint = bool(fit.position_errors[i] <= tolerance.position), "Is the row as it should be?"
    if of_turning:
        angles = np.rad2deg([fit.turning_errors[i], tolerance.orientation])
        found, allowed = (f"{angle:.3g} deg" for angle in angles)
        hint = f"The data are {scatter.of_turning()}" if scatter.turning else hint
    else:
        found, allowed = (f"{1e3 * value:.3g} mm" for value in (fit.position_errors[i], tolerance.position))
        wanted = _OF_SCATTER * scatter.deviation
        more = f"; give a tolerance of {1e3 * wanted:.2g} mm or more" if wanted > tolerance.position else ""
        hint = f"The data are {scatter}{more}" if scatter.deviation else hint
    problem = f"no smooth curve is within the tolerance of {'orientation' if of_turning else 'position'}"
    raise points.wrong(i, problem, found=f"{found} at {points.described(i)}", allowed=allowed, hint=doubt or hint)
