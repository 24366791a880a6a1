"""Tables of numbers as text, with delimiters, decimal commas, byte order marks; and what the columns of points are.

Columns are named ``x``, ``x_mm``, ``X [mm]``, ``rx (deg)``, ``feed_mm/min``, ... in any order.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, TypeVar

import numpy as np

from brachis.common.arrays import with_like_signs
from brachis.errors import TaskError
from brachis.task.fields import LARGEST, POSITION
from brachis.task.point_data import FileUnits, PointFile
from brachis.task.points.points import Array, Indices, Points, PointsAndNotes, Rows
from brachis.task.points.units import (
    CONVENTIONS,
    UNITS,
    choices,
    quaternions_of,
    rotation_by,
)

_Found = TypeVar("_Found")
_DELIMITERS: Final = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "spaces"}


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers under column names.

    Attributes
    ----------
    header : tuple of str
    header_line : int
    values : (n, c) ndarray
        As written: in the file's units.
    lines : (n,) int ndarray
        Where in the file they stand, from 1 on.
    notes : tuple of str
        What was found out about the form of the file.
    """

    header: tuple[str, ...]
    header_line: int
    values: Array
    lines: Indices
    notes: tuple[str, ...]


def read_table(
    text: str,
    source: str,
    allowed: str,
    understand: Callable[[tuple[str, ...], str], _Found],
) -> tuple[Table, _Found]:
    """Read a table whose first line names the columns; lines that are empty or begin with ``#`` are skipped.

    Parameters
    ----------
    text : str
        Content of a file.
    source : str
        The file, for messages.
    allowed : str
        The columns that it may have, for messages.
    understand : callable
        Returns what a header says, or refuses it, given its file and line.

    Returns
    -------
    Table, and what `understand` returns

    Raises
    ------
    TaskError
        A line has the wrong number of values, or one that is not a finite number; the message names line and column.
    """
    notes = ["a byte order mark"] if text.startswith("\ufeff") else []
    lines = [
        (number, line.strip(" \r"))
        for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1)
        if line.strip(" \t;,\r") and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise TaskError("the file is empty", allowed=allowed, where=source)
    head, *body = lines
    delimiter = next((one for one in _DELIMITERS if one in head[1]), ",")
    if delimiter != ",":
        notes.append(f"columns separated by {_DELIMITERS[delimiter]}")
        if any("," in line for _, line in body):
            notes.append("decimal commas")
            body = [
                (number, _with_point(line, f"{source}: line {number}"))
                for number, line in body
            ]
    header_line, first = head
    where = f"{source}: line {header_line}"
    header = tuple(_cells(first, delimiter, where))
    found = understand(header, where)
    if not body:
        raise TaskError("the file has no rows of numbers", where=source)
    values = []
    for number, line in body:
        where = f"{source}: line {number}"
        values.append(_numbers(_cells(line, delimiter, where), header, where))
    numbers = np.array([number for number, _ in body])
    table = Table(header, header_line, np.array(values), numbers, tuple(notes))
    return table, found


def _with_point(line: str, where: str) -> str:
    """Write decimal commas as points, unless there are both: one of them would separate thousands."""
    if "," in line and "." in line:
        raise TaskError(
            "the line has both decimal points and decimal commas",
            found=repr(line[:60]),
            where=where,
            hint="Write numbers without thousands separators",
        )
    return line.replace(",", ".")


def _cells(line: str, delimiter: str, where: str) -> list[str]:
    reader = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
    try:
        (cells,) = reader
    except csv.Error as error:
        raise TaskError(f"not a CSV file: {error}", where=where) from None
    return [cell.strip() for cell in cells]


def _numbers(cells: list[str], header: tuple[str, ...], where: str) -> list[float]:
    """Return the numbers of a line.

    Raises
    ------
    TaskError
    """
    if len(cells) != len(header):
        hint = "Decimal commas need columns separated by semicolons or tabs"
        raise TaskError(
            "the row has the wrong number of values",
            found=len(cells),
            allowed=f"{len(header)}: {', '.join(header)}",
            where=where,
            hint=hint if len(cells) > len(header) else None,
        )
    values = [_number(cell) for cell in cells]
    for value, column, cell in zip(values, header, cells, strict=True):
        if not abs(value) <= LARGEST:
            finite = math.isfinite(value)
            problem = "is out of range" if finite else "is not a finite number"
            raise TaskError(
                f"the value of column {column} {problem}",
                found=repr(cell),
                allowed=f"{-LARGEST:g} to {LARGEST:g}" if finite else "a number",
                where=where,
            )
    return values


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


_QUATERNION: Final = ("qw", "qx", "qy", "qz")
_ORIENTATIONS: Final = {
    _QUATERNION: ("quaternion_wxyz",),
    ("q1", "q2", "q3", "q4"): ("quaternion_wxyz", "quaternion_xyzw"),
    ("rx", "ry", "rz"): ("rotation_vector", "rpy", "staubli_xyz", "fanuc_wpr"),
    ("a", "b", "c"): ("kuka_abc", "rpy"),
    ("w", "p", "r"): ("fanuc_wpr",),
    ("roll", "pitch", "yaw"): ("rpy",),
}
"""Columns of orientations, and the conventions that each may be in: the numbers of a convention are in this order."""
_SPEED: Final = "feed"
_SPEED_NAMES: Final = ("feed", "feedrate", "f", "speed", "v")
_HEADING = re.compile(
    r"^([a-z]+?|q[1-4])(?:\s*[_ ]\s*([a-z/_]+)|\s*[\[(]\s*([a-z/]+)\s*[\])])?$"
)


def _allowed_columns(rows: Rows) -> str:
    """Return the columns that a file may have, for messages."""
    return " | ".join(",".join(choice) for choice in _choices(rows))


def _choices(rows: Rows) -> tuple[tuple[str, ...], ...]:
    if isinstance(rows, tuple):
        return (rows,)
    return (POSITION, *(POSITION + columns for columns in _ORIENTATIONS))


@dataclass(frozen=True)
class _Columns:
    """What the columns of a table of points are.

    Attributes
    ----------
    places : dict of str to (int, str or None)
        Index and unit of every column by its name.
    names : tuple of str
        Those that belong to positions and orientations.
    convention : str or None
        That of the orientations, where there are any.
    where : str
        Place of the header, for messages.
    """

    places: dict[str, tuple[int, str | None]]
    names: tuple[str, ...]
    convention: str | None
    where: str


def _read_columns(
    header: tuple[str, ...],
    where: str,
    rows: Rows,
    stated: str | None,
) -> _Columns:
    """Return what the columns of a table are.

    Parameters
    ----------
    header : tuple of str
    where : str
        Its place, for messages.
    rows : tuple of str or str
        Rows of the task space, or the word for one of poses.
    stated : str, optional
        Convention of the orientations, as the task states it.

    Raises
    ------
    TaskError
        Columns are missing or unknown, or the convention of their orientations is not known.
    """
    places = {}
    for column, text in enumerate(header):
        name, unit = _heading(text)
        places[name] = (column, unit)
    names = sorted(name for name in places if name != _SPEED)
    choice = next((one for one in _choices(rows) if sorted(one) == names), None)
    if choice is None or len(places) != len(header):
        raise TaskError(
            "the columns are wrong",
            found=", ".join(header),
            allowed=_allowed_columns(rows),
            where=where,
            hint="The first line names the columns, separated by commas, semicolons, tabs or spaces; units may follow "
            "names (x_mm); a column feed may be added",
        )
    return _Columns(places, choice, _convention(choice, stated, where), where)


def _heading(text: str) -> tuple[str, str | None]:
    """Return name and unit of a heading; a name that is not understood as it is written."""
    match = _HEADING.match(text.strip().lower())
    if match is None:
        return text, None
    name = _SPEED if match[1] in _SPEED_NAMES else match[1]
    unit = match[2] or match[3]
    return name, unit and unit.replace("_per_", "/").replace("_", "/")


def _convention(names: tuple[str, ...], stated: str | None, where: str) -> str | None:
    """Return the convention of the orientations: the only one that the columns leave, or the one that is stated."""
    columns = names[len(POSITION) :]
    possible = _ORIENTATIONS.get(columns, ())
    if stated is None and len(possible) > 1:
        raise TaskError(
            f"the columns {', '.join(columns)} do not state the convention of the orientation",
            allowed=f"csv.orientation: {choices(possible)}",
            where=where,
            hint="State it in the task, csv: {file: ..., orientation: ...}; another choice gives another motion",
        )
    if stated is not None and stated not in possible:
        usual = [
            ", ".join(each)
            for each, conventions in _ORIENTATIONS.items()
            if stated in conventions
        ]
        hint = "Remove csv.orientation"
        if possible:
            hint = f"Or csv.orientation: {choices(possible)}"
        raise TaskError(
            f"csv.orientation is {stated}, which the columns of the file do not have",
            found=", ".join(names),
            allowed=f"columns {' | '.join(usual)} for {stated}",
            where=where,
            hint=hint,
        )
    return stated or next(iter(possible), None)


def _unit_of(name: str, kind: str, columns: _Columns, units: FileUnits) -> str:
    """Return the unit of a column: the heading's, else the task's, else the default.

    Raises
    ------
    TaskError
    """
    unit = columns.places[name][1]
    factors = UNITS[kind]
    asked = getattr(units, kind)
    if unit is None:
        convention = columns.convention
        is_euler = convention is not None and CONVENTIONS[convention].euler
        defaults = {"length": "m", "angle": "" if is_euler else "rad"}
        asked = asked or defaults.get(kind)
        if asked:
            return str(asked)
        usual = {"speed": "mm/min", "angle": "deg"}[kind]
        raise TaskError(
            f"the unit of {name} is not stated",
            allowed=", ".join(factors),
            where=columns.where,
            hint=f"Write {name}_{usual} in the header, or units: {{{kind}: {usual}}} in the task",
        )
    problem = None
    if unit not in factors:
        problem = f"unknown unit of {kind}"
        asked = ", ".join(factors)
    elif asked is not None and factors[asked] != factors[unit]:
        problem = "the header contradicts the task's units"
    if problem:
        found = f"{unit} for {name}"
        raise TaskError(problem, found=found, allowed=asked, where=columns.where)
    return unit


def read_points(
    text: str, rows: Rows, settings: PointFile, source: str
) -> PointsAndNotes:
    """Return the points of a table in SI units, and notes on how it was read.

    Parameters
    ----------
    text : str
        The table.
    rows : tuple of str or str
        Rows of the task space, or the word for one of poses.
    settings : PointFile
        Units, and convention of the orientations, as the task states them.
    source : str
        The file, for messages.

    Raises
    ------
    TaskError
        Columns are missing or unknown, units are missing or contradict each other, a quaternion has no unit length, or
        a feed rate is not positive.
    """
    understand = partial(_read_columns, rows=rows, stated=settings.orientation)
    table, columns = read_table(text, source, _allowed_columns(rows), understand)
    notes = [*table.notes]
    units = settings.units

    def read(names: Sequence[str], kind: str) -> Array:
        """Read columns of one kind of quantity in SI units."""
        chosen = [columns.places[name] for name in names]
        factors = [UNITS[kind][_unit_of(name, kind, columns, units)] for name in names]
        stated = dict.fromkeys(unit for _, unit in chosen if unit is not None)
        if stated:
            notes.append(f"{kind} in {' and '.join(stated)}, as the header says")
        return table.values[:, [place for place, _ in chosen]] * np.array(factors)

    position = [name for name in columns.names if name in POSITION]
    others = columns.names[len(position) :]
    convention = columns.convention or ""
    lengths = read(position, "length")
    speed = read([_SPEED], "speed")[:, 0] if _SPEED in columns.places else None
    if convention.startswith("quaternion"):
        chosen = [columns.places[name][0] for name in others]
        turning = table.values[:, chosen]
    else:
        turning = read(others, "angle")
    points = Points(lengths, turning, speed, table.lines, source)
    if convention:
        points = _with_quaternions(points, convention)
    if speed is not None and np.any(speed <= 0.0):
        i = int(np.argmax(speed <= 0.0))
        raise points.wrong(
            i,
            "a feed rate must be positive",
            found=f"{speed[i]:g} m/s",
            allowed="more than 0",
        )
    if convention:
        notes.append(f"orientations: {CONVENTIONS[convention].meaning}")
    return points, tuple(notes)


def _with_quaternions(points: Points, convention: str) -> Points:
    """Return points with quaternions w, x, y, z for orientations in a convention, angles in rad."""
    values = points.turning
    off = np.abs(np.linalg.norm(values, axis=1) - 1.0)
    if convention.startswith("quaternion") and np.any(off > 0.01):
        i = int(np.argmax(off > 0.01))
        raise points.wrong(
            i,
            f"the quaternion's length is {np.linalg.norm(values[i]):.6g}",
            found=str(values[i].tolist()),
            allowed="a quaternion of length 1",
        )
    quaternions = quaternions_of(rotation_by(convention, values))
    return replace(points, turning=with_like_signs(quaternions))
