"""Tables of numbers as text: delimiters, decimal commas, byte order marks.

What the columns of a table are: ``x``, ``x_mm``, ``X [mm]``, ``rx (deg)``, ``feed_mm/min``, ... in any order.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NoReturn

import numpy as np

from brachis.common.arrays import with_like_signs
from brachis.errors import TaskError
from brachis.task.point_data import FileUnits
from brachis.task.points.points import Array, Indices, Points
from brachis.task.points.units import (
    ANGLES,
    CONVENTIONS,
    LENGTHS,
    SPEEDS,
    choices,
    rotation_by,
)

LARGEST = 1e12
"""Of a number in a table: beyond it squares and differences lose their meaning."""
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
    told : tuple of str
        What was found out about the form of the file.
    """

    header: tuple[str, ...]
    header_line: int
    values: Array
    lines: Indices
    told: tuple[str, ...]


def read_table(
    text: str,
    source: str,
    allowed: str,
    check: Callable[[tuple[str, ...], str], object],
) -> Table:
    """Read a table whose first line names the columns; lines that are empty or begin with ``#`` are skipped.

    Parameters
    ----------
    text : str
        Content of a file.
    source : str
        The file, for messages.
    allowed : str
        The columns that it may have, for messages.
    check : callable
        Refuses a header that is not understood, given its file and line.

    Raises
    ------
    TaskError
        A line has the wrong number of values, or one that is not a finite number; the message names line and column.
    """
    told = ["a byte order mark"] if text.startswith("\ufeff") else []
    lines = [
        (number, line)
        for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1)
        if line.strip(" \t;,\r") and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise TaskError("the file is empty", allowed=allowed, where=source)
    delimiter = next((one for one in _DELIMITERS if one in lines[0][1].strip()), ",")
    commas = delimiter != "," and any("," in line for _, line in lines[1:])
    if commas:
        _refuse_points_and_commas(lines[1:], source)
        lines = [
            lines[0],
            *((number, line.replace(",", ".")) for number, line in lines[1:]),
        ]
    told += [f"columns separated by {_DELIMITERS[delimiter]}"] * (delimiter != ",") + [
        "decimal commas"
    ] * commas
    (_, header), *rows = _cells(lines, delimiter, source)
    check(tuple(header), f"{source}: line {lines[0][0]}")
    numbers = np.array([number for number, _ in rows], dtype=int)
    return Table(
        tuple(header), lines[0][0], _numbers(rows, header, source), numbers, tuple(told)
    )


def _cells(
    lines: list[tuple[int, str]], delimiter: str, source: str
) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(
        (line.strip(" \r") for _, line in lines),
        delimiter=delimiter,
        skipinitialspace=True,
    )
    try:
        for (number, _), cells in zip(lines, reader, strict=False):
            yield number, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise TaskError(
            f"not a CSV file: {error}",
            where=f"{source}: line {lines[reader.line_num - 1][0]}",
        ) from None


def _numbers(
    rows: list[tuple[int, list[str]]], header: list[str], source: str
) -> Array:
    width = len(header)
    try:
        values = np.array(
            [[float(cell) for cell in cells] for _, cells in rows]
        ).reshape(len(rows), -1)
    except ValueError:  # no number, or rows of different lengths
        values = np.empty((0, 0))
    if values.shape != (len(rows), width) or not np.all(np.abs(values) <= LARGEST):
        _refuse(rows, header, source)
    return values


def _refuse(
    rows: list[tuple[int, list[str]]], header: list[str], source: str
) -> NoReturn:
    """Raise the error for the first row that is wrong."""
    for number, cells in rows:
        where = f"{source}: line {number}"
        if len(cells) != len(header):
            raise TaskError(
                "wrong number of values",
                found=len(cells),
                allowed=f"{len(header)}: {', '.join(header)}",
                where=where,
                hint="Decimal commas need columns separated by semicolons or tabs"
                if len(cells) > len(header)
                else None,
            )
        for column, cell in zip(header, cells, strict=True):
            value = _number(cell)
            if not math.isfinite(value):
                raise TaskError(
                    f"the value of column {column} is not a finite number",
                    found=repr(cell),
                    allowed="a number",
                    where=where,
                )
            if abs(value) > LARGEST:
                raise TaskError(
                    f"the value of column {column} is out of range",
                    found=repr(cell),
                    allowed=f"{-LARGEST:g} to {LARGEST:g}",
                    where=where,
                )
    raise TaskError("no rows of numbers", where=source)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _refuse_points_and_commas(lines: list[tuple[int, str]], source: str) -> None:
    """Refuse numbers with both: one of them would separate thousands, and nobody knows which."""
    for number, line in lines:
        if "," in line and "." in line:
            raise TaskError(
                "decimal points and commas in one line",
                found=repr(line.strip()[:60]),
                where=f"{source}: line {number}",
                hint="Write numbers without separators of thousands",
            )


POSITION: Final = ("x", "y", "z")
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
_UNIT_LENGTH = 0.01
_DEFAULTS = FileUnits(length="m", angle="rad")


def allowed_columns(rows: tuple[str, ...] | str) -> str:
    """Return the columns that a file may have, for messages."""
    return " | ".join(",".join(choice) for choice in _choices(rows))


def understood(
    header: tuple[str, ...],
    where: str,
    rows: tuple[str, ...] | str,
    stated: str | None = None,
) -> tuple[dict[str, tuple[int, str | None]], tuple[str, ...], str | None]:
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

    Returns
    -------
    headings : dict of str to (int, str or None)
        Index and unit of every column by its name.
    names : tuple of str
        Those that belong to positions and orientations.
    convention : str or None
        That of the orientations, where there are any.

    Raises
    ------
    TaskError
        Columns are missing or unknown, or the convention of their orientations is not known.
    """
    headings = {
        name: (column, unit)
        for column, name, unit in map(_heading, range(len(header)), header)
    }
    names = sorted(name for name in headings if name != _SPEED)
    choice = next((one for one in _choices(rows) if sorted(one) == names), None)
    if choice is None or len(headings) != len(header):
        problem = "wrong columns"
        hint = "The first line names the columns, separated by commas, semicolons, tabs or spaces; units may follow "
        hint += "(x_mm); a column feed may stand beside them"
        raise TaskError(
            problem,
            found=", ".join(header),
            allowed=allowed_columns(rows),
            where=where,
            hint=hint,
        )
    return headings, choice, _convention(choice, stated, where)


def _convention(names: tuple[str, ...], stated: str | None, where: str) -> str | None:
    """Return the convention of the orientations: the only one that the columns leave, or the one that is stated."""
    columns = names[len(POSITION) :]
    possible = _ORIENTATIONS.get(columns, ())
    if stated is None and len(possible) < 2:
        return possible[0] if possible else None
    if stated is None:
        raise TaskError(
            f"the columns {', '.join(columns)} do not say how the orientation is meant",
            allowed=f"csv.orientation: {choices(possible)}",
            where=where,
            hint="State it in the task, csv: {file: ..., orientation: ...}; another choice gives another motion",
        )
    if stated not in possible:
        usual = [
            ", ".join(each)
            for each, conventions in _ORIENTATIONS.items()
            if stated in conventions
        ]
        raise TaskError(
            f"csv.orientation is {stated}, which the columns of the file do not have",
            found=", ".join(names),
            allowed=f"columns {' | '.join(usual)} for {stated}",
            where=where,
            hint=f"Or csv.orientation: {choices(possible)}"
            if possible
            else "Leave csv.orientation away",
        )
    return stated


def points_of(
    table: Table,
    rows: tuple[str, ...] | str,
    units: FileUnits,
    source: str,
    stated: str | None = None,
) -> tuple[Points, tuple[str, ...]]:
    """Return the points of a table in SI units, and what was found out about the units.

    Parameters
    ----------
    table : Table
    rows : tuple of str or str
        Rows of the task space, or the word for one of poses.
    units : FileUnits
        As the task states them.
    source : str
        The file, for messages.
    stated : str, optional
        Convention of the orientations, as the task states it; needed where the columns leave it open.

    Raises
    ------
    TaskError
        See `understood`; or units are missing or contradict each other, or a quaternion has no unit length.
    """
    where = f"{source}: line {table.header_line}"
    headings, choice, convention = understood(table.header, where, rows, stated)
    in_header: dict[str, dict[str, None]] = {}
    need_angle = convention is not None and bool(CONVENTIONS[convention].euler)

    def column(name: str, kind: str, factors: dict[str, float]) -> Array:
        index, unit = headings[name]
        return (
            table.values[:, index]
            * factors[
                _unit(
                    name,
                    unit,
                    kind,
                    factors,
                    units,
                    None
                    if kind == "angle" and need_angle
                    else getattr(_DEFAULTS, kind),
                    in_header,
                    where,
                )
            ]
        )

    position = tuple(name for name in choice if name in POSITION)
    lengths = np.column_stack([column(name, "length", LENGTHS) for name in position])
    speed = column(_SPEED, "speed", SPEEDS) if _SPEED in headings else None
    others = choice[len(position) :]
    if convention is not None and convention.startswith("quaternion"):
        turning = table.values[:, [headings[name][0] for name in others]]
    else:
        angles = [column(name, "angle", ANGLES) for name in others]
        turning = np.column_stack(angles) if angles else np.empty((len(lengths), 0))
    if convention is not None:
        turning = _quaternions(turning, convention, table, source)
    points = Points(lengths, turning, speed, table.lines, source)
    _check_speeds(points)
    told = [
        f"{kind} in {' and '.join(units)}, as the header says"
        for kind, units in in_header.items()
    ]
    return points, (
        *told,
        *([f"orientations: {CONVENTIONS[convention].meaning}"] if convention else []),
    )


def _choices(rows: tuple[str, ...] | str) -> tuple[tuple[str, ...], ...]:
    if isinstance(rows, tuple):
        return (rows,)
    return (POSITION, *(POSITION + columns for columns in _ORIENTATIONS))


def _heading(index: int, text: str) -> tuple[int, str, str | None]:
    """Return column index, name and unit of a heading; a name that is not understood as it is written."""
    match = _HEADING.match(text.strip().lower())
    if match is None:
        return index, text, None
    unit = match[2] or match[3]
    name = _SPEED if match[1] in _SPEED_NAMES else match[1]
    return (
        index,
        name,
        None if unit is None else unit.replace("_per_", "/").replace("_", "/"),
    )


def _unit(
    name: str,
    unit: str | None,
    kind: str,
    factors: dict[str, float],
    units: FileUnits,
    default: str | None,
    in_header: dict[str, dict[str, None]],
    where: str,
) -> str:
    """Return the unit of a column: the heading's, else the task's, else the default."""
    asked = getattr(units, kind)
    found = f"{unit} for {name}"
    if unit is not None:
        if unit not in factors:
            raise TaskError(
                f"unknown unit of {kind}",
                found=found,
                allowed=", ".join(factors),
                where=where,
            )
        if asked is not None and factors[asked] != factors[unit]:
            raise TaskError(
                "the header contradicts the task's units",
                found=found,
                allowed=asked,
                where=where,
            )
        in_header.setdefault(kind, {})[unit] = None
        return unit
    if asked is None and default is None:
        usual = {"speed": "mm/min", "angle": "deg"}[kind]
        raise TaskError(
            f"the unit of {name} is not stated",
            allowed=", ".join(factors),
            where=where,
            hint=f"Write {name}_{usual} in the header, or units: {{{kind}: {usual}}} in the task",
        )
    return str(asked or default)


def _quaternions(values: Array, convention: str, table: Table, source: str) -> Array:
    """Return quaternions w, x, y, z from orientations in a convention, angles in rad."""
    quaternions = convention.startswith("quaternion")
    off = np.abs(np.linalg.norm(values, axis=1) - 1.0)
    if quaternions and np.any(off > _UNIT_LENGTH):
        i = int(np.argmax(off > _UNIT_LENGTH))
        raise TaskError(
            f"the quaternion's length is {np.linalg.norm(values[i]):.6g}",
            found=values[i].tolist(),
            allowed="a quaternion of length 1",
            where=f"{source}: line {table.lines[i]}",
        )
    return with_like_signs(
        np.roll(rotation_by(convention, values).as_quat(), 1, axis=1)
    )


def _check_speeds(points: Points) -> None:
    if points.speed is None:
        return
    wrong = np.flatnonzero(points.speed <= 0.0)
    if wrong.size:
        i = int(wrong[0])
        raise points.wrong(
            i,
            "a feed rate must be positive",
            found=f"{points.speed[i]:g} m/s",
            allowed="more than 0",
        )
