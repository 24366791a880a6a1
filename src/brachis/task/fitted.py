"""Segments out of points: a spline through all of them, or smooth curves within a tolerance.

Segments from files of points: interpolated by a spline, or fitted by smooth curves within a tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from brachis.common.files import read_text
from brachis.errors import TaskError, write_count
from brachis.task.models import Task
from brachis.task.orientation import Attitude, OrientationMode, Rotate, TurnTo
from brachis.task.point_data import FitReport, FitTolerance, PointFile
from brachis.task.segments import (
    BSplineCurve,
    BSplineSegment,
    CsvSegment,
    Segment,
    SplineSegment,
    SplineThrough,
)

if TYPE_CHECKING:
    from brachis.task.points.curves import FittedCurve
    from brachis.task.points.points import Points

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


def segments_along(
    points: Points, wanted: Wanted, told: tuple[str, ...] = ()
) -> list[SplineSegment | BSplineSegment]:
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
        Points are wrong, or no smooth curve lies within the tolerance; the message names the row.
    """
    # Imported here: tasks without points need neither NumPy nor SciPy.
    from brachis.task.points.curves import check_interpolation, fit_curves
    from brachis.task.points.least_squares import Tolerance

    if points.turning.shape[1] == _QUATERNION and wanted.orientation is not None:
        raise TaskError(
            "the points' orientations say already how the tool turns",
            found="orientations",
            allowed="no orientation",
            where=f"{wanted.where}.orientation",
        )
    if wanted.tolerance is None:
        if points.speed is not None:
            raise TaskError(
                "feed rates are read along a fitted path alone",
                found="feed rates",
                allowed="a tolerance beside them",
                where=wanted.where,
                hint="Give a tolerance, or leave the feed rates out",
            )
        return [_spline_through(points, check_interpolation(points, told), wanted)]
    position, orientation, corner = (
        getattr(wanted.tolerance, name) for name in FitTolerance.model_fields
    )
    curves, report = fit_curves(
        points, Tolerance(position, orientation, corner or position), told
    )
    if len(curves) > 1:
        _check_corners(report, wanted)
    report = report.model_copy(update={"source": wanted.source})
    return [
        _segment(i, curve, len(curves), report, wanted)
        for i, curve in enumerate(curves)
    ]


def _spline_through(points: Points, report: FitReport, wanted: Wanted) -> SplineSegment:
    poses = points.turning.shape[1] == _QUATERNION
    places = [
        tuple(row) for row in (points.position if poses else points.columns).tolist()
    ]
    turned = (
        [Attitude(quaternion_wxyz=turn) for turn in points.turning.tolist()]
        if poses
        else None
    )
    spline = SplineThrough(
        through=tuple(places[1:]),
        orientations=tuple(turned[1:]) if turned else None,
        relative=wanted.relative,
        starts_at=places[0],
        starts_oriented=turned[0] if turned else None,
        fit=report.model_copy(update={"source": wanted.source}),
    )
    return SplineSegment(
        blend=wanted.blend, orientation=wanted.orientation, spline=spline
    )


def _segment(
    i: int, curve: FittedCurve, count: int, report: FitReport, wanted: Wanted
) -> BSplineSegment:
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


def _check_corners(report: FitReport, wanted: Wanted) -> None:
    """Refuse corners where they are not to be rounded, and turns that would have to go on over them.

    Raises
    ------
    TaskError
        It lists the corners.
    """
    found = [
        f"{degrees(corner.angle):.3g} deg at row {corner.row}"
        for corner in report.corners
    ]
    listed = ", ".join(
        [
            *found[:_LISTED],
            *([f"{len(found) - _LISTED} more"] if len(found) > _LISTED else []),
        ]
    )
    if wanted.corner == "refuse":
        raise TaskError(
            f"the points have {write_count(len(found), 'corner')}",
            found=listed,
            allowed="none",
            where=f"{wanted.where}.corner",
            hint="Set corner: blend to round them within the tolerance",
        )
    if isinstance(wanted.orientation, Rotate | TurnTo):
        raise TaskError(
            "the tool cannot turn at a constant rate over corners",
            found=listed,
            where=f"{wanted.where}.orientation",
            hint="Give an orientation for every point, or orientation: tangent",
        )


_LARGEST_FILE = 64_000_000
"""Bytes: 100,000 poses with feed rates at full precision take 17 million."""


def expand_csv_files(task: Task, source: str, folder: Path) -> Task:
    """Return the task with curves in place of every segment from a file.

    Parameters
    ----------
    task : Task
        A task as it is written.
    source : str
        File name, or what else the task came from, for messages.
    folder : Path
        What the files' paths are relative to.

    Raises
    ------
    TaskError
        A file is missing or wrong; the message names its line.
    """
    if not any(isinstance(segment, CsvSegment) for segment in task.path):
        return task
    path: list[Segment] = []
    for i, segment in enumerate(task.path):
        path += (
            _read(segment, task, f"{source}: path[{i}]", folder)
            if isinstance(segment, CsvSegment)
            else [segment]
        )
    return task.model_copy(update={"path": tuple(path)})


def _read(
    segment: CsvSegment, task: Task, where: str, folder: Path
) -> list[SplineSegment | BSplineSegment]:
    settings = segment.csv
    if task.task_space == "joints":
        return [_along_joints(segment, where, folder)]
    points, told = _points_of(settings, task, f"{where}.csv.file", folder)
    wanted = Wanted(
        source=settings.file,
        where=where,
        tolerance=settings.tolerance,
        corner=settings.corner,
        relative=settings.relative,
        orientation=segment.orientation,
        blend=segment.blend,
    )
    return segments_along(points, wanted, told)


def _points_of(
    settings: PointFile, task: Task, where: str, folder: Path
) -> tuple[Points, tuple[str, ...]]:
    from brachis.task.points.gcode import SUFFIXES, read_gcode
    from brachis.task.points.tables import (
        allowed_columns,
        points_of,
        read_table,
        understood,
    )

    path = folder / settings.file
    text = read_text(
        path, where=where, folder=folder, found=settings.file, largest=_LARGEST_FILE
    )
    if path.suffix.lower() in SUFFIXES:
        if settings.orientation is not None:
            raise TaskError(
                "G-code has no orientations",
                found=settings.orientation,
                allowed="no csv.orientation",
                where=where,
            )
        points, told = read_gcode(text, task.task_space, str(path))
    else:
        rows = task.task_space
        check = partial(understood, rows=rows, stated=settings.orientation)
        table = read_table(text, str(path), allowed_columns(rows), check)
        points, of_units = points_of(
            table, rows, settings.units, str(path), settings.orientation
        )
        told = (*table.told, *of_units)
    _check_count(len(points), path)
    return points, told


def _along_joints(segment: CsvSegment, where: str, folder: Path) -> SplineSegment:
    """Return the spline through all rows of a file whose columns are joints, in rad and m."""
    from brachis.task.points.checks import refuse_repetitions
    from brachis.task.points.points import Points
    from brachis.task.points.tables import read_table

    settings = segment.csv
    plain = PointFile(file=segment.csv.file)
    for key in ("orientation", "units", "tolerance", "corner"):
        if getattr(settings, key) != getattr(plain, key):
            raise TaskError(
                "a path of joints passes all rows, which are in rad and m",
                allowed=f"no {key}",
                where=f"{where}.csv.{key}",
            )
    path = folder / settings.file
    text = read_text(
        path,
        where=f"{where}.csv.file",
        folder=folder,
        found=settings.file,
        largest=_LARGEST_FILE,
    )
    table = read_table(
        text, str(path), "the names of the joints", lambda _header, _where: None
    )
    _check_count(len(table.values), path)
    refuse_repetitions(
        Points(table.values, table.values[:, :0], None, table.lines, str(path))
    )
    start, *through = (tuple(row) for row in table.values.tolist())
    spline = SplineThrough(
        through=tuple(through),
        relative=settings.relative,
        starts_at=start,
        joints=table.header,
    )
    return SplineSegment(
        blend=segment.blend, orientation=segment.orientation, spline=spline
    )


def _check_count(rows: int, path: Path) -> None:
    if rows < 2:
        raise TaskError(
            "a path needs its start and at least one waypoint",
            found=f"{write_count(rows, 'row')} of numbers",
            allowed="2 or more",
            where=str(path),
        )
