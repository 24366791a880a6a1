"""Waypoints from CSV files.

The first line names the columns: the rows of the task space, or for poses ``x, y, z`` and, where the tool turns,
``qw, qx, qy, qz`` (unit quaternion) or ``rx, ry, rz`` (rotation vector, rad), in any order; for paths of joints the
joints' names. Lines that are empty or begin with ``#`` are skipped. The first row of numbers is where the segment
starts.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final, NoReturn

from brachis.errors import TaskError
from brachis.task.fields import LARGEST
from brachis.task.models import Task
from brachis.task.orientation import Attitude, Quaternion, RotationVector
from brachis.task.segments import CsvFile, CsvSegment, SplineSegment, SplineThrough
from brachis.task.text_file import read_text

_POSITION: Final = ("x", "y", "z")
_QUATERNION: Final = ("qw", "qx", "qy", "qz")
_ROTATION_VECTOR: Final = ("rx", "ry", "rz")
_POSE_COLUMNS: Final = (_POSITION, _POSITION + _QUATERNION, _POSITION + _ROTATION_VECTOR)
_FEWEST_ROWS = 2
_UNIT = 0.01
# What a path takes for standing still (m or rad).
_SAME = 1e-9


@dataclass(frozen=True)
class _Row:
    """Numbers of one line, by column."""

    line: int
    values: dict[str, float]

    def of(self, columns: tuple[str, ...]) -> tuple[float, ...]:
        return tuple(self.values[column] for column in columns)


@dataclass(frozen=True)
class _Table:
    """A CSV file."""

    path: Path
    columns: tuple[str, ...]
    rows: tuple[_Row, ...]


def expand_csv_files(task: Task, source: str, folder: Path) -> Task:
    """Return the task with a spline in place of every segment from a CSV file.

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
    path = tuple(
        _spline(segment, task, f"{source}: path[{i}]", folder) if isinstance(segment, CsvSegment) else segment
        for i, segment in enumerate(task.path)
    )
    return task.model_copy(update={"path": path})


def _spline(segment: CsvSegment, task: Task, where: str, folder: Path) -> SplineSegment:
    settings = segment.csv
    rows, of_joints = task.task_space, task.task_space == "joints"
    choices = () if of_joints else (rows,) if isinstance(rows, tuple) else _POSE_COLUMNS
    table = _read(settings, choices, f"{where}.csv.file", folder)
    position = table.columns if of_joints else rows if isinstance(rows, tuple) else _POSITION
    turning = table.columns != position
    if turning and segment.orientation is not None:
        problem = "the CSV file's columns say already how the tool turns"
        raise TaskError(problem, found=", ".join(table.columns), allowed="no orientation", where=f"{where}.orientation")
    _refuse_repetitions(table, position)
    points = [row.of(position) for row in table.rows]
    attitudes = [_attitude(row, table) for row in table.rows] if turning else None
    spline = SplineThrough(
        through=tuple(points[1:]),
        orientations=tuple(attitudes[1:]) if attitudes else None,
        relative=settings.relative,
        starts_at=points[0],
        starts_oriented=attitudes[0] if attitudes else None,
        joints=table.columns if of_joints else None,
    )
    return SplineSegment(blend=segment.blend, orientation=segment.orientation, spline=spline)


def _read(settings: CsvFile, choices: tuple[tuple[str, ...], ...], where: str, folder: Path) -> _Table:
    """Read a file whose columns are one of `choices`, and put them in that order; any columns where there are none."""
    path = folder / settings.file
    text = read_text(path, where=where, folder=folder, found=settings.file).removeprefix("\ufeff")
    reader = csv.reader(text.split("\n"), skipinitialspace=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:
        problem = f"not a CSV file: {error}"
        raise TaskError(problem, where=f"{path}: line {reader.line_num}") from None
    lines = [(line, cells) for line, cells in lines if any(cells) and not cells[0].startswith("#")]
    if not lines:
        problem = "the file is empty"
        raise TaskError(problem, allowed=_columns(choices) or "the names of the joints", where=str(path))
    header = lines[0][1]
    columns = next((choice for choice in choices or (tuple(header),) if sorted(choice) == sorted(header)), None)
    if columns is None:
        problem = "wrong columns"
        hint = "The first line names the columns; commas separate them"
        place = f"{path}: line {lines[0][0]}"
        raise TaskError(problem, found=", ".join(header), allowed=_columns(choices), where=place, hint=hint)
    rows = tuple(_Row(line, _numbers(cells, header, f"{path}: line {line}")) for line, cells in lines[1:])
    if len(rows) < _FEWEST_ROWS:
        problem = "a path needs its start and at least one waypoint"
        raise TaskError(problem, found=f"{len(rows)} rows of numbers", allowed="2 or more", where=str(path))
    return _Table(path, columns, rows)


def _columns(choices: tuple[tuple[str, ...], ...]) -> str:
    return " | ".join(",".join(choice) for choice in choices)


def _numbers(cells: list[str], header: list[str], where: str) -> dict[str, float]:
    if len(cells) != len(header):
        problem = "wrong number of values"
        raise TaskError(problem, found=len(cells), allowed=f"{len(header)}: {', '.join(header)}", where=where)
    values = {}
    for column, cell in zip(header, cells, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            problem = f"the value of column {column} is not a finite number"
            raise TaskError(problem, found=repr(cell), allowed="a number, with a decimal point", where=where)
        if abs(value) > LARGEST:
            problem = f"the value of column {column} is out of range"
            raise TaskError(problem, found=repr(cell), allowed=f"{-LARGEST:g} to {LARGEST:g}", where=where)
        values[column] = value
    return values


def _attitude(row: _Row, table: _Table) -> Attitude:
    if table.columns[-3:] == _ROTATION_VECTOR:
        rx, ry, rz = row.of(_ROTATION_VECTOR)
        return RotationVector(rotation_vector=(rx, ry, rz))
    w, x, y, z = row.of(_QUATERNION)
    length = math.hypot(w, x, y, z)
    if abs(length - 1.0) > _UNIT:
        problem = f"the quaternion's length is {length:.6g}"
        place = f"{table.path}: line {row.line}"
        raise TaskError(problem, found=[w, x, y, z], allowed="qw, qx, qy, qz of length 1", where=place)
    return Quaternion(quaternion=(w, x, y, z))


def _refuse_repetitions(table: _Table, rows: tuple[str, ...]) -> None:
    """Refuse a row whose position repeats its predecessor's: the curve would have to stop there.

    Where the position stands still in the whole file, the tool turns on the spot, and it is the angles that count.
    """
    compared = tuple(row for row in rows if row != "yaw")
    if all(_same(table.rows[0], row, compared) for row in table.rows):
        compared = table.columns
    for before, row in pairwise(table.rows):
        if _same(before, row, compared):
            _repeats(table, before, row, compared)


def _same(one: _Row, other: _Row, columns: tuple[str, ...]) -> bool:
    return math.dist(one.of(columns), other.of(columns)) < _SAME


def _repeats(table: _Table, before: _Row, row: _Row, columns: tuple[str, ...]) -> NoReturn:
    problem = f"the row repeats line {before.line}"
    found = ", ".join(f"{column} = {row.values[column]:.6g}" for column in columns)
    allowed = f"rows that differ from their predecessors in {', '.join(columns)}"
    raise TaskError(problem, found=found, allowed=allowed, where=f"{table.path}: line {row.line}")
