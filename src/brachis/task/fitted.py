"""Segments out of points: a spline through all of them, or smooth curves within a tolerance."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import degrees
from typing import TYPE_CHECKING, Any, Literal

from brachis.errors import TaskError, write_count
from brachis.task.bspline_curve import BSplineCurve
from brachis.task.orientation import Attitude, OrientationMode, Rotate, TurnTo
from brachis.task.point_data import FitReport, FitTolerance
from brachis.task.segments import BSplineSegment, SplineSegment
from brachis.task.shapes import SplineThrough

if TYPE_CHECKING:
    from brachis.cam.curves import FittedCurve
    from brachis.cam.points import Points
    from brachis.cam.report import Report

_QUATERNION = 4
_LISTED = 10


@dataclass(frozen=True)
class Wanted:
    """What is asked of a path along points; see the task file's ``csv``.

    Attributes
    ----------
    source : str
        What the user calls the points.
    where : str
        Where the task names them, for messages.
    tolerance : FitTolerance or None
    corner : {"blend", "refuse"}
    relative : bool
    orientation : optional
        How the tool turns.
    blend : float or None
        The last segment's.
    """

    source: str
    where: str
    tolerance: FitTolerance | None
    corner: Literal["blend", "refuse"]
    relative: bool
    orientation: OrientationMode
    blend: float | None = None


def segments_along(points: Points, wanted: Wanted, told: tuple[str, ...] = ()) -> list[SplineSegment | BSplineSegment]:
    """Return the segments along points, whose first one is where they start.

    Parameters
    ----------
    points : Points
    wanted : Wanted
    told : tuple of str, optional
        What was found out when the points were read.

    Raises
    ------
    TaskError
        Points are wrong, or there is no smooth curve within the tolerance; the message names the row.
    """
    # Imported here: tasks without points need neither NumPy nor SciPy.
    from brachis.cam.curves import fit_curves, interpolated  # noqa: PLC0415
    from brachis.cam.least_squares import Tolerance  # noqa: PLC0415

    if points.turning.shape[1] == _QUATERNION and wanted.orientation is not None:
        problem = "the points' orientations say already how the tool turns"
        where = f"{wanted.where}.orientation"
        raise TaskError(problem, found="orientations", allowed="no orientation", where=where)
    if wanted.tolerance is None:
        if points.speed is not None:
            problem = "feed rates are read along a fitted path alone"
            hint = "Give a tolerance, or leave the feed rates out"
            raise TaskError(
                problem, found="feed rates", allowed="a tolerance beside them", where=wanted.where, hint=hint
            )
        return [_spline_through(points, _named(interpolated(points, told), wanted), wanted)]
    position, orientation, corner = (getattr(wanted.tolerance, name) for name in FitTolerance.model_fields)
    curves, report = fit_curves(points, Tolerance(position, orientation, corner or position), told)
    if len(curves) > 1:
        _check_corners(report, wanted)
    named = _named(report, wanted)
    return [_segment(i, curve, len(curves), named, wanted) for i, curve in enumerate(curves)]


def _named(report: Report, wanted: Wanted) -> FitReport:
    return FitReport(**{**asdict(report), "source": wanted.source})


def _spline_through(points: Points, report: FitReport, wanted: Wanted) -> SplineSegment:
    poses = points.turning.shape[1] == _QUATERNION
    places = [tuple(row) for row in (points.position if poses else points.columns).tolist()]
    turned = [Attitude(quaternion_wxyz=turn) for turn in points.turning.tolist()] if poses else None
    spline = SplineThrough(
        through=tuple(places[1:]),
        orientations=tuple(turned[1:]) if turned else None,
        relative=wanted.relative,
        starts_at=places[0],
        starts_oriented=turned[0] if turned else None,
        fit=report,
    )
    return SplineSegment(blend=wanted.blend, orientation=wanted.orientation, spline=spline)


def _segment(i: int, curve: FittedCurve, count: int, report: FitReport, wanted: Wanted) -> BSplineSegment:
    """Return the segment of curve `i`; the first one has the report, all but the last one a blend of their own."""
    control_points: Any = curve.spline.c.tolist()  # SciPy's stubs take it for a vector
    shape = BSplineCurve(
        degree=curve.spline.k,
        knots=tuple(curve.spline.t.tolist()),
        control_points=tuple(map(tuple, control_points)),
        relative=wanted.relative or i > 0,
        speeds=curve.speeds,
        fit=report if i == 0 else None,
    )
    blend = wanted.blend if i == count - 1 else curve.blend
    return BSplineSegment(blend=blend, orientation=wanted.orientation, bspline=shape)


def _check_corners(report: Report, wanted: Wanted) -> None:
    """Refuse corners where they are not to be rounded, and turns that would have to go on over them.

    Raises
    ------
    TaskError
        It lists the corners.
    """
    found = [f"{degrees(corner.angle):.3g} deg at row {corner.row}" for corner in report.corners]
    listed = ", ".join([*found[:_LISTED], *([f"{len(found) - _LISTED} more"] if len(found) > _LISTED else [])])
    if wanted.corner == "refuse":
        hint = "Set corner: blend to round them within the tolerance"
        where = f"{wanted.where}.corner"
        raise TaskError(
            f"the points have {write_count(len(found), 'corner')}", found=listed, allowed="none", where=where, hint=hint
        )
    if isinstance(wanted.orientation, Rotate | TurnTo):
        hint = "Give an orientation for every point, or orientation: tangent"
        where = f"{wanted.where}.orientation"
        raise TaskError("the tool cannot turn at a constant rate over corners", found=listed, where=where, hint=hint)
