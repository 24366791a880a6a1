"""Segments out of points and of the curves that were fitted to them."""

from __future__ import annotations

from dataclasses import asdict
from math import degrees
from typing import TYPE_CHECKING

from brachis.errors import TaskError
from brachis.task.orientation import OrientationMode, Quaternion
from brachis.task.point_data import BSplineCurve, FitReport
from brachis.task.segments import BSplineSegment, SplineSegment, SplineThrough

if TYPE_CHECKING:
    from brachis.cam.curves import FittedCurve
    from brachis.cam.points import Points
    from brachis.cam.report import Report

_QUATERNION = 4
_LISTED = 10


def spline_through(
    points: Points, *, relative: bool, orientation: OrientationMode = None, blend: float | None = None
) -> SplineSegment:
    """Return the segment that passes through all points."""
    poses = points.turning.shape[1] == _QUATERNION
    places = [tuple(row) for row in (points.position if poses else points.columns).tolist()]
    turned = [Quaternion(quaternion=tuple(row)) for row in points.turning.tolist()] if poses else None
    spline = SplineThrough(
        through=tuple(places[1:]),
        orientations=tuple(turned[1:]) if turned else None,
        relative=relative,
        starts_at=places[0],
        starts_oriented=turned[0] if turned else None,
    )
    return SplineSegment(blend=blend, orientation=orientation, spline=spline)


def segments_along(
    curves: tuple[FittedCurve, ...],
    report: Report,
    *,
    source: str,
    relative: bool,
    orientation: OrientationMode = None,
    blend: float | None = None,
) -> list[BSplineSegment]:
    """Return a segment for every curve, with blends between; the first one has the report, `blend` is the last one's.

    The points come from `source`, as the user calls it.
    """
    segments, told = [], FitReport(**{**asdict(report), "source": source})
    for i, curve in enumerate(curves):
        shape = BSplineCurve(
            degree=curve.spline.k,
            knots=tuple(curve.spline.t.tolist()),
            control_points=tuple(tuple(row) for row in curve.spline.c.tolist()),
            relative=relative or i > 0,
            speeds=curve.speeds,
            fit=told if i == 0 else None,
        )
        size = blend if i == len(curves) - 1 else curve.blend
        segments.append(BSplineSegment(blend=size, orientation=orientation, bspline=shape))
    return segments


def corners_refused(report: Report, where: str) -> TaskError:
    """Return the error that there are corners, which lists them."""
    found = [f"{degrees(corner.angle):.3g} deg at row {corner.row}" for corner in report.corners]
    more = [f"{len(found) - _LISTED} more"] if len(found) > _LISTED else []
    hint = "Set corner: blend to round them within the tolerance"
    listed = ", ".join([*found[:_LISTED], *more])
    return TaskError(f"the points have {len(found)} corners", found=listed, allowed="none", where=where, hint=hint)
