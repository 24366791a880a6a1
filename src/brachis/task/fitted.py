"""Segments along points from files and arrays: a spline through all points, or smooth curves within a tolerance."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from brachis.common.files import read_text
from brachis.common.words import write_count
from brachis.errors import TaskError
from brachis.task.messages import validate
from brachis.task.models import Task
from brachis.task.orientation import Attitude, OrientationMode, Rotate, TurnTo
from brachis.task.point_data import (
    CornerMode,
    FileUnits,
    FitReport,
    FitTolerance,
    PointFile,
)
from brachis.task.points.checks import refuse_repetitions
from brachis.task.points.curves import FittedCurve, cut_at_corners, fit_curves
from brachis.task.points.gcode import SUFFIXES, read_gcode
from brachis.task.points.points import Points, Rows, points_from
from brachis.task.points.tables import read_points, read_table
from brachis.task.program import PathPart
from brachis.task.segments import (
    BSplineSegment,
    CsvSegment,
    Segment,
    SplineSegment,
    SplineThrough,
)

_P = TypeVar("_P", Task, PathPart)
_HAS_UNIT = re.compile(r"[_ (\[](deg|degrees|mm|cm)[)\]]?$", re.IGNORECASE)
"""Ending of a column name that states a unit other than rad or m."""


def segments_along(
    points: Points, segment: CsvSegment, where: str
) -> list[SplineSegment | BSplineSegment]:
    """Return the segments along points, beginning at the first point.

    Parameters
    ----------
    points : Points
    segment : CsvSegment
        Settings of the path along the points. Its file is the user's name for the points.
    where : str
        Key of the task that names the points, for messages.

    Raises
    ------
    TaskError
        The points are wrong, or no smooth curve lies within the tolerance; the message names the row.
    """
    settings = segment.csv
    if points.has_quaternions and segment.orientation is not None:
        raise TaskError(
            "the points already have orientations",
            found="orientations",
            allowed="no orientation",
            where=f"{where}.orientation",
        )
    stops = settings.corner == "stop"
    sections: Sequence[Points | FittedCurve]
    if settings.tolerance is not None:
        sections, report = fit_curves(points, settings.tolerance, stops=stops)
    elif points.speed is not None and segment.speed is None:
        raise TaskError(
            "feed rates need a path fitted within a tolerance",
            found="feed rates",
            allowed="feed rates together with a tolerance",
            where=where,
            hint="Set csv.tolerance, or remove the feed rates",
        )
    else:
        sections, report = cut_at_corners(points, stops=stops)
    _check_corners(report, segment, where)
    fit: FitReport | None = report.model_copy(update={"source": settings.file})
    segments: list[SplineSegment | BSplineSegment] = []
    for section in sections:
        keys = _shared_keys(segment)
        if section is not sections[-1]:
            blend = None if isinstance(section, Points) else section.blend
            keys |= {"blend": blend, "stop": blend is None, "dwell": 0.0}
        if isinstance(section, Points):
            spline = _spline_through(section, fit, settings)
            segments.append(SplineSegment(spline=spline, **keys))
        else:
            keys["bspline"] = {
                "degree": section.spline.k,
                "knots": section.spline.t.tolist(),
                "control_points": section.spline.c.tolist(),
                "relative": settings.relative or fit is None,
                "speeds": section.speeds,
                "fit": fit,
            }
            segments.append(BSplineSegment(**keys))
        fit = None  # only the first segment has the report
    return segments


def _shared_keys(segment: CsvSegment) -> dict[str, Any]:
    """Return the keys of a file segment that apply to the last curve of the file."""
    shared = ("orientation", "speed", "blend", "stop", "dwell")
    return {key: getattr(segment, key) for key in shared}


def _spline_through(
    points: Points, fit: FitReport | None, settings: PointFile
) -> SplineThrough:
    """Return the spline through the points of one section of a file; `fit` is None except for the first section.

    After a corner, the waypoints begin with the corner itself, so that the spline also passes a very close next point.
    """
    first = 1 if fit else 0
    keys: dict[str, Any] = {"relative": settings.relative, "fit": fit}
    places = points.columns.tolist()
    if points.has_quaternions:
        places = points.position.tolist()
        turns = [Attitude(quaternion_wxyz=turn) for turn in points.turning.tolist()]
        keys |= {"orientations": turns[first:], "starts_oriented": turns[0]}
    return SplineThrough(through=places[first:], starts_at=places[0], **keys)


def _check_corners(report: FitReport, segment: CsvSegment, where: str) -> None:
    """Refuse corners if the task forbids them, and turns that would have to continue across corners.

    Raises
    ------
    TaskError
        The message lists the corners.
    """
    if not report.corners:
        return
    if segment.csv.corner == "refuse":
        raise TaskError(
            f"the points have {write_count(len(report.corners), 'corner')}",
            found=report.listed_corners,
            allowed="no corners",
            where=f"{where}.corner",
            hint="Set corner: blend to round the corners within the tolerance, or corner: stop to stop at them",
        )
    if isinstance(segment.orientation, Rotate | TurnTo):
        raise TaskError(
            "the tool cannot turn at a constant rate over corners",
            found=report.listed_corners,
            where=f"{where}.orientation",
            hint="Give an orientation for every point, or orientation: tangent",
        )


def expand_csv_files(task: Task, source: str, folder: Path) -> Task:
    """Return the task with every file segment replaced by curves.

    Parameters
    ----------
    task : Task
        The task as the user wrote it.
    source : str
        File name or other origin of the task, for messages.
    folder : Path
        Folder to which file names are relative.

    Raises
    ------
    TaskError
        A file is missing or wrong; the message names the line.
    """
    parts = [
        _expand(
            part, part.task_space or task.task_space, f"{source}: program[{i}].", folder
        )
        if isinstance(part, PathPart)
        else part
        for i, part in enumerate(task.program)
    ]
    if parts:
        return task.model_copy(update={"program": tuple(parts)})
    return _expand(task, task.task_space, f"{source}: ", folder)


def _expand(stated: _P, rows: Rows, where: str, folder: Path) -> _P:
    """Return a task or a part of a program, given with the beginning of its keys, without file segments."""
    path: list[Segment] = []
    for i, segment in enumerate(stated.path):
        if isinstance(segment, CsvSegment):
            path += _read(segment, rows, f"{where}path[{i}]", folder)
        else:
            path.append(segment)
    # The empty path of a move stays unset: a task with path: [] is wrong.
    return stated.model_copy(update={"path": tuple(path)}) if path else stated


def _read(
    segment: CsvSegment, rows: Rows, where: str, folder: Path
) -> list[SplineSegment | BSplineSegment]:
    """Return the segments along the points of a file; `rows` are the rows of the task space."""
    path = folder / segment.csv.file
    text = read_text(
        path,
        where=f"{where}.csv.file",
        folder=folder,
        found=segment.csv.file,
        # 100,000 poses with feed rates at full precision take 17 million bytes.
        largest=64_000_000,
    )
    if rows == "joints":
        return [_along_joints(segment, text, path, where)]
    if path.suffix.lower() in SUFFIXES:
        if segment.csv.orientation is not None:
            raise TaskError(
                "G-code has no orientations",
                found=segment.csv.orientation,
                allowed="no csv.orientation",
                where=f"{where}.csv.file",
            )
        points = read_gcode(text, rows, str(path))
    else:
        points = read_points(text, rows, segment.csv, str(path))
    _check_count(len(points), path)
    return segments_along(points, segment, where)


def _along_joints(
    segment: CsvSegment, text: str, path: Path, where: str
) -> SplineSegment:
    """Return the spline through all rows of a file that has a column for each joint, in rad or m."""
    settings = segment.csv
    usual = PointFile(file=settings.file)
    for key in ("orientation", "units", "tolerance", "corner"):
        if getattr(settings, key) != getattr(usual, key):
            raise TaskError(
                "this key does not apply to a joint path, which passes through all rows, in rad and m",
                allowed=f"no {key}",
                where=f"{where}.csv.{key}",
            )
    table = read_table(text, str(path), "the names of the joints")
    # A single match may be the name of a joint.
    if all(_HAS_UNIT.search(column) for column in table.header):
        raise TaskError(
            "a joint path is in rad and m",
            found=f"columns {', '.join(table.header)}",
            allowed="the names of the joints, without a unit",
            where=table.where,
            hint="Convert the numbers to rad and m, and name the columns like the joints",
        )
    _check_count(len(table.values), path)
    nothing = table.values[:, :0]
    refuse_repetitions(Points(table.values, nothing, None, table.lines, str(path)))
    start, *through = table.values.tolist()
    spline = SplineThrough(
        through=tuple(through),
        relative=settings.relative,
        starts_at=start,
        joints=table.header,
    )
    return SplineSegment(spline=spline, **_shared_keys(segment))


def _check_count(rows: int, path: Path) -> None:
    if rows < 2:
        raise TaskError(
            "a path needs a start and at least one waypoint",
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
    corner: CornerMode = "blend",
    orientation: OrientationMode = None,
    relative: bool = False,
) -> tuple[SplineSegment | BSplineSegment, ...]:
    """Return the segments of a path along points, including the first point, for the ``path`` of a task.

    Parameters
    ----------
    points : array_like, (n, p) or (n, 4, 4), or sequence of transforms
        Positions, in the rows of the task space; homogeneous matrices; or objects that have such a matrix, such as
        Pinocchio's ``SE3`` or SciPy's ``RigidTransform``.
    tolerance : mapping or FitTolerance, optional
        ``{"position": "0.05 mm", "orientation": "0.1 deg"}`` as in a task file. By default the path passes through all
        points.
    orientations : Rotation, or array_like, (n, 3, 3) or (n,), optional
        Orientations of the tool at the positions: SciPy rotations (``Rotation.from_quat(q)`` takes quaternions x, y, z,
        w), rotation matrices, or yaw angles.
    speed : float or array_like, (n,), optional
        A single number is a process speed, held along the whole path. An array contains the maximum speed on the way to
        each point, or NaN if none is prescribed. An array requires a tolerance.
    units : mapping or FileUnits, optional
        ``{"length": "mm", "angle": "deg", "speed": "mm/min"}``. By default m, rad (for yaw) and m/s.
    corner : {"blend", "refuse", "stop"}, optional
        As in a task file.
    orientation : optional
        How the tool turns along the path, as in a task file, if no orientations are given.
    relative : bool, optional
        Whether the points are moved to the start of the segment, as in a task file.

    Returns
    -------
    tuple of SplineSegment or BSplineSegment
        One segment, or one for each section between corners.

    Raises
    ------
    TaskError
        The points are wrong, or no smooth curve lies within the tolerance; the message names the row, counted from 0.

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
    settings = {
        "file": "points",
        "relative": relative,
        "units": units or {},
        "tolerance": tolerance,
        "corner": corner,
    }
    file = validate(PointFile, settings, "fit_path")
    content: dict[str, Any] = {"csv": file, "orientation": orientation}
    if isinstance(speed, int | float):
        content["speed"] = speed
        speed = None
    segment = validate(CsvSegment, content, "fit_path")
    points = points_from(points, orientations, speed, segment.csv.units, "points")
    return tuple(segments_along(points, segment, "points"))
