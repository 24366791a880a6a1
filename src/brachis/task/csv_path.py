"""Segments from files of points: interpolated by a spline, or fitted by smooth curves within a tolerance."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from brachis.errors import TaskError
from brachis.task.fitted import Wanted, segments_along
from brachis.task.models import Task
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
    return task.model_copy(update={"path": tuple(path)})


def _read(segment: CsvSegment, task: Task, where: str, folder: Path) -> list[SplineSegment | BSplineSegment]:
    settings = segment.csv
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
        points, told = read_gcode(text, task.task_space, str(path))
    else:
        rows = task.task_space
        check = partial(understood, rows=rows)
        table = read_table(text, str(path), allowed_columns(rows), check)
        points, of_units = points_of(table, task.task_space, Units(**settings.units.model_dump()), str(path))
        told = (*table.told, *of_units)
    if len(points) < 2:  # noqa: PLR2004
        problem = "a path needs its start and at least one waypoint"
        raise TaskError(problem, found=f"{len(points)} rows of numbers", allowed="2 or more", where=str(path))
    return points, told
