"""Segments out of points: a spline through all of them, or smooth curves within a tolerance.

Segments from files of points: interpolated by a spline, or fitted by smooth curves within a tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from pydantic import ValidationError

from brachis.common.files import read_text
from brachis.errors import TaskError, write_count
from brachis.task.fields import Model, plain
from brachis.task.messages import task_error
from brachis.task.models import Task
from brachis.task.orientation import Attitude, OrientationMode, Rotate, TurnTo
from brachis.task.point_data import FileUnits, FitReport, FitTolerance, PointFile
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
_M = TypeVar("_M", bound=Model)
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
    points: Points, wanted: Wanted, notes: tuple[str, ...] = ()
) -> list[SplineSegment | BSplineSegment]:
    """Return the segments along points, whose first one is where they start.

    Parameters
    ----------
    points : Points
    wanted : Wanted
    notes : tuple of str, optional
        What was found out when the points were read.

    Raises
    ------
    TaskError
        Points are wrong, or no smooth curve lies within the tolerance; the message names the row.
    """
    # Imported here: tasks without points need neither NumPy nor SciPy.
    from brachis.task.points.curves import check_interpolation, fit_curves

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
        return [_spline_through(points, check_interpolation(points, notes), wanted)]
    curves, report = fit_curves(points, wanted.tolerance, notes)
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
    points, notes = _points_of(settings, task, f"{where}.csv.file", folder)
    wanted = Wanted(
        source=settings.file,
        where=where,
        tolerance=settings.tolerance,
        corner=settings.corner,
        relative=settings.relative,
        orientation=segment.orientation,
        blend=segment.blend,
    )
    return segments_along(points, wanted, notes)


def _points_of(
    settings: PointFile, task: Task, where: str, folder: Path
) -> tuple[Points, tuple[str, ...]]:
    from brachis.task.points.gcode import SUFFIXES, read_gcode
    from brachis.task.points.tables import (
        allowed_columns,
        points_of,
        read_columns,
        read_table,
    )

    path = folder / settings.file
    text = read_text(
        path, where=where, folder=folder, found=settings.file, largest=_LARGEST_FILE
    )
    rows = task.task_space
    if path.suffix.lower() in SUFFIXES:
        if settings.orientation is not None:
            raise TaskError(
                "G-code has no orientations",
                found=settings.orientation,
                allowed="no csv.orientation",
                where=where,
            )
        points, notes = read_gcode(text, rows, str(path))
    else:
        check = partial(read_columns, rows=rows, stated=settings.orientation)
        table = read_table(text, str(path), allowed_columns(rows), check)
        columns = check(table.header, f"{path}: line {table.header_line}")
        points, of_units = points_of(table, columns, settings.units, str(path))
        notes = (*table.notes, *of_units)
    _check_count(len(points), path)
    return points, notes


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


def fit_path(
    points: Any,
    *,
    tolerance: Mapping[str, float | str] | FitTolerance | None = None,
    orientations: Any = None,
    speed: Any = None,
    units: Mapping[str, str] | FileUnits | None = None,
    corner: Literal["blend", "refuse"] = "blend",
    orientation: OrientationMode = None,
    relative: bool = False,
) -> tuple[SplineSegment | BSplineSegment, ...]:
    """Return the segments of a path along points, the first one included; for the ``path`` of a task.

    Parameters
    ----------
    points : array_like, (n, p) or (n, 4, 4), or sequence of transforms
        Positions in the rows of the task space; or homogeneous matrices; or objects with such a matrix: Pinocchio's
        ``SE3``, or SciPy's ``RigidTransform``.
    tolerance : mapping or FitTolerance, optional
        ``{"position": "0.05 mm", "orientation": "0.1 deg"}`` as in a task file; without it the path passes all points.
    orientations : Rotation, or array_like, (n, 3, 3) or (n,), optional
        Of the tool, beside positions: SciPy's rotations (``Rotation.from_quat(q)`` takes quaternions x, y, z, w);
        rotation matrices; yaw.
    speed : array_like, (n,), optional
        Speed of the tool on the way to each point; NaN where none is prescribed. With a tolerance only.
    units : mapping or FileUnits, optional
        ``{"length": "mm", "angle": "deg", "speed": "mm/min"}``; m, rad (of yaw) and m/s unless given.
    corner : {"blend", "refuse"}, optional
        As in a task file.
    orientation : optional
        How the tool turns along the path where no orientations are given, as in a task file.
    relative : bool, optional
        Whether the path may start anywhere, as in a task file.

    Returns
    -------
    tuple of SplineSegment or BSplineSegment
        One, or as many as there are stretches between corners.

    Raises
    ------
    TaskError
        Points are wrong, or no smooth curve lies within the tolerance; the message names the row, from 0 on.

    Examples
    --------
    >>> import numpy as np
    >>> angle = np.linspace(0.0, 1.5, 500)
    >>> circle = np.column_stack([200.0 * np.cos(angle), 200.0 * np.sin(angle)])
    >>> from brachis import fit_path
    >>> path = fit_path(circle, tolerance={"position": "0.01 mm"}, units={"length": "mm"})
    >>> path[0].bspline.fit.intervals < 5
    True
    """
    from brachis.task.points.points import points_from

    stated = _validate(FileUnits, units or {}, "units")
    given = points_from(points, orientations, speed, stated, "points")
    return tuple(
        segments_along(
            given,
            Wanted(
                "points",
                "points",
                None
                if tolerance is None
                else _validate(FitTolerance, tolerance, "tolerance"),
                corner,
                relative,
                orientation,
            ),
        )
    )


def _validate(model: type[_M], value: object, key: str) -> _M:
    try:
        return model.model_validate(plain(value))
    except ValidationError as error:
        raise task_error(error, key, model) from None
