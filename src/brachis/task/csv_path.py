"""Segments from files of points: interpolated by a spline, or fitted by smooth curves within a tolerance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from brachis.errors import TaskError
from brachis.task.fitted import corners_refused, segments_along, spline_through
from brachis.task.models import Task
from brachis.task.orientation import Quaternion, Rotate, TurnTo
from brachis.task.point_data import PointFile
from brachis.task.segments import BSplineSegment, CsvSegment, Segment, SplineSegment
from brachis.task.text_file import read_text

if TYPE_CHECKING:
    from brachis.cam.points import Points

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
        path += _read(segment, task, f"{source}: path[{i}]", folder) if isinstance(segment, CsvSegment) else [segment]
    start = _start_of(path[0]) if task.path_start is None and task.start == "free" else task.path_start
    return Task.model_validate(task.model_copy(update={"path": tuple(path), "path_start": start}))


def _start_of(segment: Segment) -> tuple[float, ...] | None:
    """Return the place where a path begins that says so itself."""
    if isinstance(segment, SplineSegment) and not segment.spline.relative and segment.spline.starts_at:
        oriented = segment.spline.starts_oriented
        return (*segment.spline.starts_at, *(oriented.quaternion if isinstance(oriented, Quaternion) else ()))
    if isinstance(segment, BSplineSegment) and not segment.bspline.relative:
        return segment.bspline.control_points[0]
    return None


def _read(segment: CsvSegment, task: Task, where: str, folder: Path) -> list[Segment]:
    # Imported here: tasks without files need neither NumPy nor SciPy.
    from brachis.cam.checks import refuse_repetitions  # noqa: PLC0415
    from brachis.cam.curves import fit_curves, refuse_rough  # noqa: PLC0415
    from brachis.cam.least_squares import Tolerance  # noqa: PLC0415

    settings = segment.csv
    points, told = _points_of(settings, task, f"{where}.csv.file", folder)
    rows = task.task_space
    if isinstance(rows, str) and points.turning.shape[1] and segment.orientation is not None:
        problem = "the file's columns say already how the tool turns"
        raise TaskError(problem, found="orientations", allowed="no orientation", where=f"{where}.orientation")
    allowed = settings.tolerance
    if allowed is None:
        refuse_repetitions(points)
        refuse_rough(points)
        return [spline_through(points, relative=settings.relative, orientation=segment.orientation, blend=segment.blend)]
    corner = allowed.position if allowed.corner is None else allowed.corner
    curves, report = fit_curves(points, Tolerance(allowed.position, allowed.orientation, corner), told)
    if len(curves) > 1:
        if settings.corner == "refuse":
            raise corners_refused(report, f"{where}.csv.corner")
        if isinstance(segment.orientation, Rotate | TurnTo):
            problem = "the tool cannot turn at a constant rate over corners"
            hint = "Give orientations in the file, or orientation: tangent"
            raise TaskError(problem, found=f"{len(curves) - 1} corners", where=f"{where}.orientation", hint=hint)
    made = segments_along(
        curves,
        report,
        source=settings.file,
        relative=settings.relative,
        orientation=segment.orientation,
        blend=segment.blend,
    )
    return [*made]


def _points_of(settings: PointFile, task: Task, where: str, folder: Path) -> tuple[Points, tuple[str, ...]]:
    from brachis.cam.columns import allowed_columns, points_of  # noqa: PLC0415
    from brachis.cam.gcode import SUFFIXES, read_gcode  # noqa: PLC0415
    from brachis.cam.table import read_table  # noqa: PLC0415
    from brachis.cam.units import Units  # noqa: PLC0415

    path = folder / settings.file
    text = read_text(path, where=where, folder=folder, found=settings.file, largest=_LARGEST_FILE)
    if path.suffix.lower() in SUFFIXES:
        points, told = read_gcode(text, task.task_space, str(path))
    else:
        table = read_table(text, str(path), allowed_columns(task.task_space))
        points, of_units = points_of(table, task.task_space, Units(**settings.units.model_dump()), str(path))
        told = (*table.told, *of_units)
    if len(points) < 2:  # noqa: PLR2004
        problem = "a path needs its start and at least one waypoint"
        raise TaskError(problem, found=f"{len(points)} rows of numbers", allowed="2 or more", where=str(path))
    return points, told
