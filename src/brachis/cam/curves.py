"""From points to curves: checks, corners, a fit between every two of them, and a report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from brachis.cam.checks import of_size, refuse_repetitions, refuse_spikes, without_repetitions
from brachis.cam.corners import find_corners
from brachis.cam.gaps import with_gaps_filled
from brachis.cam.least_squares import Tolerance
from brachis.cam.points import Points
from brachis.cam.report import CornerRemark, Report, profile_of
from brachis.cam.scatter import scatter_of
from brachis.cam.speeds import Run, speed_runs
from brachis.cam.stretches import Stretch, blend_between, fit_between
from brachis.errors import TaskError

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_ROUGH = 0.5
"""Of the curvature that scatter makes times the length of the path."""
_ROOMY = 6.0


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
    points: Points, tolerance: Tolerance, told: tuple[str, ...] = ()
) -> tuple[tuple[FittedCurve, ...], Report]:
    """Return smooth curves within a tolerance of points, and what was found.

    Parameters
    ----------
    points : Points
    tolerance : Tolerance
    told : tuple of str, optional
        What was found out before.

    Raises
    ------
    TaskError
        Points are wrong, or there is no smooth curve within the tolerance; the message names the row.
    """
    count = len(points)
    points, repeated = without_repetitions(points)
    scatter = scatter_of(points)
    refuse_spikes(points, scatter, tolerance.position)
    points, filled = with_gaps_filled(points)
    corners = find_corners(points, scatter, tolerance.corner)
    doubt = of_size(points)
    stretches = fit_between(points, corners, tolerance, scatter, doubt)
    blends = [
        blend_between(first, second, corner, tolerance)
        for first, second, corner in zip(stretches, stretches[1:], corners, strict=False)
    ]
    curves = tuple(
        FittedCurve(stretch.fit.spline, blend, speed_runs(stretch.fit.sigma, stretch.points.speed))
        for stretch, blend in zip(stretches, [*blends, None], strict=True)
    )
    report = _report(stretches, tolerance, points=count, source=points.source, doubt=doubt)
    found = zip(corners, np.cumsum([stretch.length for stretch in stretches]), blends, strict=False)
    told = (*told, *repeated, *filled, *((str(scatter),) if scatter.deviation else ()))
    remarks = tuple(
        CornerRemark(int(points.rows[corner.index]), corner.angle, float(distance), blend)
        for corner, distance, blend in found
    )
    return curves, replace(report, corners=remarks, told=told)


def _report(stretches: list[Stretch], tolerance: Tolerance, *, points: int, source: str, doubt: str | None) -> Report:
    """Report on all stretches, but for their corners and what was told."""
    starts = np.cumsum([0.0, *(stretch.length for stretch in stretches)])
    along = np.concatenate([start + stretch.sigma for start, stretch in zip(starts, stretches, strict=False)])
    distances = np.concatenate([stretch.distances for stretch in stretches])
    angles = np.concatenate([stretch.angles for stretch in stretches])
    return Report(
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


def interpolated(points: Points, told: tuple[str, ...] = ()) -> Report:
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
    length = float(np.linalg.norm(np.diff(points.position, axis=0), axis=1).sum())
    if scatter.curvature * length > _ROUGH:
        problem = "the points are too rough for a curve through all of them: its curvature would be noise"
        hint = f"Give a tolerance, for example tolerance: {{position: {_ROOMY * 1e3 * scatter.deviation:.1g} mm}}"
        found = f"{scatter}, which make a curvature of {scatter.curvature:.2g} 1/m by themselves"
        allowed = f"less than {_ROUGH / length:.2g} 1/m"
        raise TaskError(problem, found=found, allowed=allowed, where=points.source, hint=hint)
    return Report(points.source, len(points), length, intervals=len(points) - 1, told=told, doubt=of_size(points))
