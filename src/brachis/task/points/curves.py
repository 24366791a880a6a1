"""From points to curves: checks, corners, a fit between every two of them, and a report.

The points between two corners, and their fit.

Speeds along a fitted curve, from those of its points.

What a fit says of itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import TaskError
from brachis.task.point_data import FitReport, FitTolerance, FoundCorner
from brachis.task.points.checks import (
    Scatter,
    of_size,
    refuse_repetitions,
    refuse_spikes,
    scatter_of,
    without_repetitions,
)
from brachis.task.points.corners import (
    Corner,
    blend_size,
    fill_gaps,
    find_corners,
)
from brachis.task.points.fit import Fit, deviations, fit_points
from brachis.task.points.points import Array, Points

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_SHARPEST = np.deg2rad(150.0)


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
    points: Points,
    corners: tuple[Corner, ...],
    tolerance: FitTolerance,
    scatter: Scatter,
    doubt: str | None = None,
) -> list[Stretch]:
    """Cut points at their corners and fit a curve to each stretch.

    `doubt` says what looks implausible in the points; it is the hint of the error.

    Raises
    ------
    TaskError
        The path turns back, or no smooth curve lies within the tolerance.
    """
    for sharp in corners:
        if sharp.angle > _SHARPEST:
            raise points.wrong(
                sharp.index,
                f"the path turns back, by {np.rad2deg(sharp.angle):.4g} degrees",
                found=points.describe(sharp.index),
                allowed="corners up to 150 degrees",
                hint="A path that stops there is for two tasks",
            )
    starts = [None, *corners]
    ends = [*corners, None]
    stretches = []
    for start, end in zip(starts, ends, strict=True):
        given = np.arange(
            0 if start is None else start.after,
            len(points) if end is None else end.before,
        )
        before, after = (
            [] if corner is None else [corner.index] for corner in (start, end)
        )
        whole = points.only(np.concatenate([before, given, after]).astype(int))
        position = whole.position.copy()
        for corner, row in ((start, 0), (end, -1)):
            if corner is not None:
                position[row] = corner.place
        whole = replace(whole, position=position)
        chosen = slice(len(before), len(before) + len(given))
        fit = _fit_one(whole, tolerance, scatter, doubt)
        distances, angles = _measure_deviations(whole, fit, tolerance)
        stretches.append(Stretch(whole, chosen, fit, distances[chosen], angles[chosen]))
    return stretches


def _measure_deviations(
    points: Points, fit: Fit, tolerance: FitTolerance
) -> tuple[Array, Array]:
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
        # `deviations` may overestimate by a thousandth of the tolerance and by 1e-8.
        if found[i] > allowed * (1.0 + 1e-3) + 1e-8:
            raise points.wrong(
                i,
                "the fitted curve does not pass the points within the tolerance",
                found=f"{points.describe(i)}, {found[i] / per:.4g} {unit} off",
                allowed=f"{allowed / per:.4g} {unit}",
                hint="Raise the tolerance, or cut the path into several",
            )
    return distances, angles


def blend_between(
    first: Stretch, second: Stretch, corner: Corner, tolerance: FitTolerance
) -> float:
    """Return the size of the blend that keeps all points near a corner within the tolerance, m.

    Raises
    ------
    TaskError
        The points leave no room.
    """
    corner_at = first.points.describe(len(first.points) - 1)
    wrong = first.points.wrong
    shortest = min(first.length, second.length)
    widest = blend_size(corner.angle, tolerance.at_corners, shortest)
    taken = max(
        float(first.distances[first.sigma > first.length - widest].max(initial=0.0)),
        float(second.distances[second.sigma < widest].max(initial=0.0)),
    )
    left = tolerance.at_corners - taken
    if left < 0.05 * tolerance.at_corners:
        raise wrong(
            -1,
            f"the corner of {np.rad2deg(corner.angle):.4g} degrees cannot be rounded within the tolerance",
            found=f"points {1e3 * taken:.3g} mm from the fit at {corner_at}",
            allowed=f"{1e3 * tolerance.at_corners:.3g} mm",
            hint="Give a larger tolerance.corner",
        )
    return blend_size(corner.angle, left, shortest)


def _fit_one(
    points: Points, tolerance: FitTolerance, scatter: Scatter, doubt: str | None
) -> Fit:
    """Fit one curve.

    Raises
    ------
    TaskError
    """
    try:
        fit = fit_points(points, tolerance, scatter)
    except ValueError as error:
        raise points.wrong(
            0,
            "no smooth curve follows these points",
            found=f"{error}, from {points.describe(0)}",
            allowed="points that move on from each to the next",
            hint=doubt or "Does the path turn back, or stand still, near there?",
        ) from error
    ratios = fit.ratios(tolerance)
    i = int(np.argmax(ratios))
    if ratios[i] <= 1.0 + 1e-6:
        return fit
    of_turning = bool(fit.position_errors[i] <= tolerance.position)
    hint = "Is the row as it should be?"
    if of_turning:
        angles = np.rad2deg([fit.turning_errors[i], tolerance.orientation])
        found, allowed = (f"{angle:.3g} deg" for angle in angles)
        hint = f"The data are {scatter.of_turning()}" if scatter.turning else hint
    else:
        found, allowed = (
            f"{1e3 * value:.3g} mm"
            for value in (fit.position_errors[i], tolerance.position)
        )
        wanted = 6.0 * scatter.deviation
        more = (
            f"; give a tolerance of {1e3 * wanted:.2g} mm or more"
            if wanted > tolerance.position
            else ""
        )
        hint = f"The data are {scatter}{more}" if scatter.deviation else hint
    raise points.wrong(
        i,
        f"no smooth curve is within the tolerance of {'orientation' if of_turning else 'position'}",
        found=f"{found} at {points.describe(i)}",
        allowed=allowed,
        hint=doubt or hint,
    )


Run = tuple[tuple[float, float], ...]


def speed_runs(sigma: Array, speed: Array | None) -> tuple[Run, ...]:
    """Return tables (sigma, speed), m and m/s, linear in between, of the stretches where a speed is prescribed.

    The speed of a point is that on the way to it. A point takes the lower one of the ways before and after, so that
    the table is nowhere above what was prescribed. What linear interpolation gives is left out.

    Parameters
    ----------
    sigma : (n,) ndarray
        Where the points are.
    speed : (n,) ndarray or None
        On the way to them, m/s; NaN where none is prescribed.
    """
    if speed is None or len(sigma) < 2:
        return ()
    sigma = np.maximum.accumulate(sigma)
    ways = speed[1:]
    given = np.isfinite(ways)
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], given, [False]]).astype(int))
    )
    runs = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        of_way = ways[first:last]
        values = np.minimum(np.append(of_way[0], of_way), np.append(of_way, of_way[-1]))
        kept = np.ones(len(values), dtype=bool)
        kept[1:-1] = (values[1:-1] != values[:-2]) | (values[1:-1] != values[2:])
        at = sigma[first : last + 1]
        runs.append(tuple(zip(at[kept].tolist(), values[kept].tolist(), strict=True)))
    return tuple(runs)


def profile_of(
    along: Array, distances: Array, angles: Array
) -> tuple[tuple[float, float, float], ...]:
    """Return the largest errors of successive groups of points, at most a few hundred groups."""
    starts = np.unique(
        np.linspace(0, len(along), min(len(along), 400), endpoint=False).astype(int)
    )
    largest = (
        np.maximum.reduceat(values, starts).tolist()
        for values in (along, distances, angles)
    )
    return tuple(zip(*largest, strict=True))


_ROUGH = 0.5
"""Of the curvature that scatter makes times the length of the path."""


@dataclass(frozen=True, eq=False)
class FittedCurve:
    """A curve between two corners.

    Attributes
    ----------
    spline : BSpline
        Position, m, and turning as in `Points`, over about the arc length, m.
    blend : float or None
        What the blend at its end takes from it and from the next curve, m; None at the last one.
    speeds : tuple of Run
        Tables of (sigma, speed), m and m/s.
    """

    spline: BSpline
    blend: float | None
    speeds: tuple[Run, ...]


def fit_curves(
    points: Points, tolerance: FitTolerance, told: tuple[str, ...] = ()
) -> tuple[tuple[FittedCurve, ...], FitReport]:
    """Return smooth curves within a tolerance of points, and what was found.

    Parameters
    ----------
    points : Points
    tolerance : FitTolerance
    told : tuple of str, optional
        What was found out before.

    Raises
    ------
    TaskError
        Points are wrong, or no smooth curve lies within the tolerance; the message names the row.
    """
    count = len(points)
    points, repeated = without_repetitions(points)
    scatter = scatter_of(points)
    refuse_spikes(points, scatter, tolerance.position)
    points, filled = fill_gaps(points)
    corners = find_corners(points, scatter, tolerance.at_corners)
    doubt = of_size(points)
    stretches = fit_between(points, corners, tolerance, scatter, doubt)
    blends = [
        blend_between(first, second, corner, tolerance)
        for first, second, corner in zip(
            stretches, stretches[1:], corners, strict=False
        )
    ]
    curves = tuple(
        FittedCurve(
            stretch.fit.spline,
            blend,
            speed_runs(stretch.fit.sigma, stretch.points.speed),
        )
        for stretch, blend in zip(stretches, [*blends, None], strict=True)
    )
    report = _report(
        stretches, tolerance, points=count, source=points.source, doubt=doubt
    )
    found = zip(
        corners,
        np.cumsum([stretch.length for stretch in stretches]),
        blends,
        strict=False,
    )
    told = (*told, *repeated, *filled, *((str(scatter),) if scatter.deviation else ()))
    remarks = tuple(
        FoundCorner(
            row=int(points.rows[corner.index]),
            angle=corner.angle,
            distance=float(distance),
            blend=blend,
        )
        for corner, distance, blend in found
    )
    return curves, report.model_copy(update={"corners": remarks, "told": told})


def _report(
    stretches: list[Stretch],
    tolerance: FitTolerance,
    *,
    points: int,
    source: str,
    doubt: str | None,
) -> FitReport:
    """Report on all stretches, but for their corners and what was told."""
    starts = np.cumsum([0.0, *(stretch.length for stretch in stretches)])
    along = np.concatenate(
        [
            start + stretch.sigma
            for start, stretch in zip(starts, stretches, strict=False)
        ]
    )
    distances = np.concatenate([stretch.distances for stretch in stretches])
    angles = np.concatenate([stretch.angles for stretch in stretches])
    return FitReport(
        source=source,
        points=points,
        length=float(starts[-1]),
        position_error=float(distances.max()),
        position_rms=float(np.sqrt(np.mean(distances**2))),
        position_tolerance=tolerance.position,
        orientation_error=float(angles.max()),
        orientation_tolerance=tolerance.orientation,
        intervals=sum(len(stretch.fit.breaks) - 1 for stretch in stretches),
        doubt=doubt,
        profile=profile_of(np.maximum.accumulate(along), distances, angles),
    )


def check_interpolation(points: Points, told: tuple[str, ...] = ()) -> FitReport:
    """Return what is said of a curve through all points, after a check that its curvature is not that of their scatter.

    Parameters
    ----------
    points : Points
    told : tuple of str, optional
        What was found out before.

    Raises
    ------
    TaskError
        So are repetitions and spikes.
    """
    refuse_repetitions(points)
    scatter = scatter_of(points)
    refuse_spikes(points, scatter, 0.0)
    length = float(points.steps.sum())
    if scatter.curvature * length > _ROUGH:
        raise TaskError(
            "the points are too rough for a curve through all of them: its curvature would be noise",
            found=f"{scatter}, which make a curvature of {scatter.curvature:.2g} 1/m by themselves",
            allowed=f"less than {_ROUGH / length:.2g} 1/m",
            where=points.source,
            hint=f"Give a tolerance, for example tolerance: {{position: {6.0 * 1e3 * scatter.deviation:.1g} mm}}",
        )
    return FitReport(
        source=points.source,
        points=len(points),
        length=length,
        position_error=0.0,
        position_rms=0.0,
        position_tolerance=0.0,
        orientation_error=0.0,
        orientation_tolerance=0.0,
        intervals=len(points) - 1,
        told=told,
        doubt=of_size(points),
    )
