"""From points to curves: checks, corners, fits between successive corners, speeds along the fits, and a report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.errors import TaskError
from brachis.task.point_data import FitReport, FitTolerance, FoundCorner
from brachis.task.points.checks import (
    Scatter,
    plausibility_note,
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
from brachis.task.points.fit import Fit, fit_points
from brachis.task.points.points import Array, Points, sum_up

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Run = tuple[tuple[float, float], ...]
"""A table of pairs (sigma, speed), m and m/s, interpolated linearly."""


@dataclass(frozen=True, eq=False)
class FittedCurve:
    """A curve from one corner to the next.

    Attributes
    ----------
    points : Points
        The points, with the corners as first and last point.
    fit : Fit
        The fit, with errors only at the user's points, without the corners.
    speeds : tuple of Run
        Tables of the speeds prescribed along the curve.
    blend : float or None
        Length that the blend at the end of the curve cuts from this and from the next curve, m; None for the last
        curve.
    """

    points: Points
    fit: Fit
    speeds: tuple[Run, ...]
    blend: float | None = None

    @property
    def spline(self) -> BSpline:
        """Spline of the position, m, and turning (see `Points`) over a parameter close to the arc length, m."""
        return self.fit.spline

    @property
    def length(self) -> float:
        """Range of sigma, which is close to the arc length, m."""
        return float(self.fit.breaks[-1])


def _fit_between(
    points: Points,
    corners: tuple[Corner, ...],
    tolerance: FitTolerance,
    scatter: Scatter,
    note: str | None,
) -> list[FittedCurve]:
    """Cut points at their corners and fit a curve to each section.

    `note` is a remark on implausible points, which becomes the hint of the error.

    Raises
    ------
    TaskError
        No smooth curve lies within the tolerance.
    """
    curves = []
    for start, end in pairwise([None, *corners, None]):
        before = [start.index] if start else []
        after = [end.index] if end else []
        first = start.after if start else 0
        rows = range(first, end.before if end else len(points))
        of_user = slice(len(before), len(before) + len(rows))
        section = points.only([*before, *rows, *after])  # copies
        if start is not None:
            section.position[0] = start.place
        if end is not None:
            section.position[-1] = end.place
        fit = _fit_one(section, tolerance, scatter, note)
        speeds = speed_runs(fit.sigma, section.speed)
        curves.append(FittedCurve(section, fit.only(of_user), speeds))
    return curves


def _blend_between(
    first: FittedCurve, second: FittedCurve, corner: Corner, tolerance: FitTolerance
) -> float:
    """Return the size of the blend that keeps all points close to a corner within the tolerance, m.

    Raises
    ------
    TaskError
        The points leave no room for a blend.
    """
    shortest = min(first.length, second.length)
    widest = blend_size(corner.angle, tolerance.at_corners, shortest)
    is_last = first.fit.sigma > first.length - widest
    is_first = second.fit.sigma < widest
    taken = max(
        float(first.fit.position_errors[is_last].max(initial=0.0)),
        float(second.fit.position_errors[is_first].max(initial=0.0)),
    )
    remaining = tolerance.at_corners - taken
    if remaining < 0.05 * tolerance.at_corners:
        raise first.points.wrong(
            -1,
            f"the corner of {np.rad2deg(corner.angle):.4g} degrees cannot be rounded within the tolerance",
            found=f"points {1e3 * taken:.3g} mm from the fit at {first.points.describe(-1)}",
            allowed=f"{1e3 * tolerance.at_corners:.3g} mm",
            hint="Set a larger tolerance.corner, or corner: stop",
        )
    return blend_size(corner.angle, remaining, shortest)


def _fit_one(
    points: Points, tolerance: FitTolerance, scatter: Scatter, note: str | None
) -> Fit:
    """Fit one curve to points.

    Raises
    ------
    TaskError
    """
    fit = fit_points(points, tolerance, scatter).over_length(points.dimension)
    ratios = fit.ratios(tolerance)
    i = int(np.argmax(ratios))
    if ratios[i] <= 1.0 + 1e-6:
        return fit
    kind = "position"
    miss = f"{1e3 * fit.position_errors[i]:.3g} mm"
    allowed = f"{1e3 * tolerance.position:.3g} mm"
    looks = str(scatter) if scatter.deviation else ""
    advised = 6.0 * scatter.deviation
    if looks and advised > tolerance.position:
        looks += f"; set a tolerance of {1e3 * advised:.2g} mm or more"
    if fit.position_errors[i] <= tolerance.position:
        kind = "orientation"
        miss = f"{np.rad2deg(fit.turning_errors[i]):.3g} deg"
        allowed = f"{np.rad2deg(tolerance.orientation):.3g} deg"
        scattered = f"{np.rad2deg(scatter.turning):.2g} deg (standard deviation)"
        looks = f"orientations that scatter by {scattered}" if scatter.turning else ""
    hint = f"The data are {looks}" if looks else "Check this row"
    raise points.wrong(
        i,
        f"no smooth curve is within the tolerance of {kind}",
        found=f"{miss} at {points.describe(i)}",
        allowed=allowed,
        hint=note or hint,
    )


def speed_runs(sigma: Array, speed: Array | None) -> tuple[Run, ...]:
    """Return a table (sigma, speed), m and m/s, interpolated linearly, for each section with a prescribed speed.

    The speed of a point applies on the way to this point. The table contains the lower of the speeds before and after
    each point, so that it nowhere exceeds a prescribed speed. Rows that follow from linear interpolation are left out.

    Parameters
    ----------
    sigma : (n,) ndarray
        Places of the points on the curve, m.
    speed : (n,) ndarray or None
        Speeds on the way to the points, m/s; NaN where none is prescribed.
    """
    if speed is None or len(sigma) < 2:
        return ()
    sigma = np.maximum.accumulate(sigma)
    step_speeds = speed[1:]
    runs = []
    # The function returns slices in order, although the stubs do not state this.
    for run in np.ma.clump_unmasked(np.ma.masked_invalid(step_speeds)):  # type: ignore[no-untyped-call]
        speeds = step_speeds[run]
        values = np.minimum(np.append(speeds[0], speeds), np.append(speeds, speeds[-1]))
        changes = np.diff(values) != 0.0
        is_needed = np.append(True, changes) | np.append(changes, True)
        at = sigma[run.start : run.stop + 1]
        runs.append(
            tuple(zip(at[is_needed].tolist(), values[is_needed].tolist(), strict=True))
        )
    return tuple(runs)


def fit_curves(
    points: Points,
    tolerance: FitTolerance,
    *,
    stops: bool = False,
) -> tuple[tuple[FittedCurve, ...], FitReport]:
    """Return smooth curves within a tolerance of points, and a report of the findings.

    Parameters
    ----------
    points : Points
    tolerance : FitTolerance
    stops : bool, optional
        Whether the tool stops at corners. Otherwise corners are rounded.

    Raises
    ------
    TaskError
        The points are wrong, or no smooth curve lies within the tolerance; the message names the row.
    """
    count = len(points)
    points = without_repetitions(points, tolerance.position)
    scatter = scatter_of(points)
    refuse_spikes(points, scatter, tolerance.position)
    points = fill_gaps(points)
    corners = find_corners(points, scatter, tolerance.at_corners)
    for corner in () if stops else corners:
        degrees = np.rad2deg(corner.angle)
        if degrees > 150.0:
            raise points.wrong(
                corner.index,
                f"the path turns back by {degrees:.4g} degrees",
                allowed="corners up to 150 degrees",
                hint="Set corner: stop if the tool stops there",
            )
    note = plausibility_note(points)
    curves = _fit_between(points, corners, tolerance, scatter, note)
    starts = sum_up([curve.length for curve in curves]).tolist()
    reports = []
    for i, corner in enumerate(corners):
        blend = 0.0
        if not stops:
            blend = _blend_between(curves[i], curves[i + 1], corner, tolerance)
            curves[i] = replace(curves[i], blend=blend)
        reports.append(_report_corner(points, corner, starts[i + 1], blend))
    sigmas = [
        start + curve.fit.sigma for start, curve in zip(starts, curves, strict=False)
    ]
    along = np.maximum.accumulate(np.concatenate(sigmas))
    distances = np.concatenate([curve.fit.position_errors for curve in curves])
    angles = np.concatenate([curve.fit.turning_errors for curve in curves])
    report = FitReport(
        source=points.source,
        points=count,
        length=starts[-1],
        position_error=float(distances.max()),
        position_rms=float(np.sqrt(np.mean(distances**2))),
        position_tolerance=tolerance.position,
        orientation_error=float(angles.max()),
        orientation_tolerance=tolerance.orientation,
        intervals=sum(len(curve.fit.breaks) - 1 for curve in curves),
        corners=tuple(reports),
        told=(*points.notes, *[str(scatter)] * (scatter.deviation > 0.0)),
        doubt=note,
        profile=_profile(along, distances, angles),
    )
    return tuple(curves), report


def _report_corner(
    points: Points, corner: Corner, distance: float, blend: float
) -> FoundCorner:
    """Return the report on a corner at a given distance along the path, m, with the length of its blend, m."""
    row = int(points.rows[corner.index])
    return FoundCorner(row=row, angle=corner.angle, distance=distance, blend=blend)


def _profile(*columns: Array) -> tuple[Any, ...]:
    """Return the largest value of each column in successive groups of rows; there are at most 400 groups."""
    count = len(columns[0])
    starts = np.linspace(0, count, min(count, 400), endpoint=False).astype(int)
    largest = [np.maximum.reduceat(values, starts).tolist() for values in columns]
    return tuple(zip(*largest, strict=True))


def cut_at_corners(
    points: Points, *, stops: bool = False
) -> tuple[tuple[Points, ...], FitReport]:
    """Split the points into sections, one for each curve through them; return the sections and a report.

    Points are refused if the curvature of the curves would be mainly due to scatter.

    Parameters
    ----------
    points : Points
    stops : bool, optional
        Whether the tool stops at corners; sections then begin and end at corners. Otherwise all points form one
        section.

    Raises
    ------
    TaskError
        The points are too rough, repeat each other, or have spikes.
    """
    refuse_repetitions(points)
    scatter = scatter_of(points)
    refuse_spikes(points, scatter, 0.0)
    distances = sum_up(points.steps).tolist()
    length = distances[-1]
    largest = 0.5  # of the product of length and curvature due to scatter
    if scatter.curvature * length > largest:
        raise TaskError(
            "the points are too rough for a curve through all of them: the curvature would be noise",
            found=f"{scatter}, which alone give a curvature of {scatter.curvature:.2g} 1/m",
            allowed=f"less than {largest / length:.2g} 1/m",
            where=points.source,
            hint=f"Set a tolerance, for example tolerance: {{position: {6.0 * 1e3 * scatter.deviation:.1g} mm}}",
        )
    corners = find_corners(points, scatter, 0.0) if stops else ()
    cuts = [0, *(corner.index for corner in corners), len(points) - 1]
    report = FitReport(
        source=points.source,
        points=len(points),
        length=length,
        intervals=len(points) - 1,
        corners=tuple(
            _report_corner(points, corner, distances[corner.index], 0.0)
            for corner in corners
        ),
        told=points.notes,
        doubt=plausibility_note(points),
    )
    sections = (points.only(slice(first, last + 1)) for first, last in pairwise(cuts))
    return tuple(sections), report
