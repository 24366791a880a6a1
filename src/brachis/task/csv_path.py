"""Segments from files of points: interpolated by a spline, or fitted by smooth curves within a tolerance."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from brachis.errors import TaskError, write_count
from brachis.task.fitted import Wanted, segments_along
from brachis.task.models import Task
from brachis.task.point_data import PointFile
from brachis.task.segments import BSplineSegment, CsvSegment, Segment, SplineSegment
from brachis.task.shapes import SplineThrough
from brachis.task.text_file import read_text

if TYPE_CHECKING:
    from brachis.cam.points import Points

_FEWEST_ROWS = 2
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
    return task.model_copy(update={"path": tuple(path)})


def _read(segment: CsvSegment, task: Task, where: str, folder: Path) -> list[SplineSegment | BSplineSegment]:
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


def _points_of(settings: PointFile, task: Task, where: str, folder: Path) -> tuple[Points, tuple[str, ...]]:
    from brachis.cam.columns import allowed_columns, points_of, understood  # noqa: PLC0415
    from brachis.cam.gcode import SUFFIXES, read_gcode  # noqa: PLC0415
    from brachis.cam.table import read_table  # noqa: PLC0415
    from brachis.cam.units import Units  # noqa: PLC0415

    path = folder / settings.file
    text = read_text(path, where=where, folder=folder, found=settings.file, largest=_LARGEST_FILE)
    if path.suffix.lower() in SUFFIXES:
        if settings.orientation is not None:
            problem = "G-code has no orientations"
            raise TaskError(problem, found=settings.orientation, allowed="no csv.orientation", where=where)
        points, told = read_gcode(text, task.task_space, str(path))
    else:
        rows = task.task_space
        check = partial(understood, rows=rows, stated=settings.orientation)
        table = read_table(text, str(path), allowed_columns(rows), check)
        units = Units(**settings.units.model_dump())
        points, of_units = points_of(table, rows, units, str(path), settings.orientation)
        told = (*table.told, *of_units)
    _check_count(len(points), path)
    return points, told


def _along_joints(segment: CsvSegment, where: str, folder: Path) -> SplineSegment:
    """Return the spline through all rows of a file whose columns are joints, in rad and m."""
    from brachis.cam.checks import refuse_repetitions  # noqa: PLC0415
    from brachis.cam.points import Points  # noqa: PLC0415
    from brachis.cam.table import read_table  # noqa: PLC0415

    settings, plain = segment.csv, PointFile(file=segment.csv.file)
    for key in ("orientation", "units", "tolerance", "corner"):
        if getattr(settings, key) != getattr(plain, key):
            problem = "a path of joints passes all rows, which are in rad and m"
            raise TaskError(problem, allowed=f"no {key}", where=f"{where}.csv.{key}")
    path = folder / settings.file
    text = read_text(path, where=f"{where}.csv.file", folder=folder, found=settings.file, largest=_LARGEST_FILE)
    table = read_table(text, str(path), "the names of the joints", lambda _header, _where: None)
    _check_count(len(table.values), path)
    refuse_repetitions(Points(table.values, table.values[:, :0], None, table.lines, str(path)))
    start, *through = (tuple(row) for row in table.values.tolist())
    spline = SplineThrough(through=tuple(through), relative=settings.relative, starts_at=start, joints=table.header)
    return SplineSegment(blend=segment.blend, orientation=segment.orientation, spline=spline)


def _check_count(rows: int, path: Path) -> None:
    if rows < _FEWEST_ROWS:
        problem = "a path needs its start and at least one waypoint"
        raise TaskError(problem, found=f"{write_count(rows, 'row')} of numbers", allowed="2 or more", where=str(path))
