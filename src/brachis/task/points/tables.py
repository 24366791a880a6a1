"""Tables of numbers as text, with any delimiter, decimal commas or byte order mark; and columns of points.

Columns are named ``x``, ``x_mm``, ``X [mm]``, ``rx (deg)``, ``feed_mm/min``, ... in any order.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from brachis.common.arrays import with_like_signs
from brachis.errors import TaskError
from brachis.task.fields import LARGEST, POSITION
from brachis.task.point_data import PointFile
from brachis.task.points.points import Array, Indices, Points, Rows
from brachis.task.points.units import (
    CONVENTIONS,
    UNITS,
    choices,
    quaternions_of,
    rotation_by,
)

_DELIMITERS: Final = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "spaces"}


@dataclass(frozen=True, eq=False)
class Table:
    """A table of numbers with named columns.

    Attributes
    ----------
    header : tuple of str
    where : str
        Location of the header, for messages.
    body : dict of int to str
        The other lines, with decimal points, by line number counted from 1.
    delimiter : str
    source : str
        Name of the file, for messages.
    notes : tuple of str
        Findings about the format of the file.
    """

    header: tuple[str, ...]
    where: str
    body: dict[int, str]
    delimiter: str
    source: str
    notes: tuple[str, ...]

    @property
    def lines(self) -> Indices:
        """Line numbers of the rows in the file, (n,)."""
        return np.array(list(self.body))

    @cached_property
    def values(self) -> Array:
        """The numbers of the table in the units of the file, (n, c).

        Raises
        ------
        TaskError
            A line has the wrong number of values or a value that is not a finite number; the message names line and
            column.
        """
        if not self.body:
            raise TaskError("the file contains no rows of numbers", where=self.source)
        values = []
        for number, line in self.body.items():
            where = f"{self.source}: line {number}"
            cells = _cells(line, self.delimiter, where)
            values.append(_numbers(cells, self.header, where))
        return np.array(values)


def read_table(text: str, source: str, allowed: str) -> Table:
    """Return a table whose first line names the columns; empty lines and lines that begin with ``#`` are skipped.

    Parameters
    ----------
    text : str
        Content of a file.
    source : str
        The file, for messages.
    allowed : str
        The possible columns, for messages.

    Raises
    ------
    TaskError
        The file is empty or not a table.
    """
    notes = ["a byte order mark"] if text.startswith("\ufeff") else []
    body = {
        number: line.strip(" \r")
        for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1)
        if line.strip(" \t;,\r") and not line.lstrip().startswith("#")
    }
    if not body:
        raise TaskError("the file is empty", allowed=allowed, where=source)
    number = next(iter(body))
    first = body.pop(number)
    where = f"{source}: line {number}"
    delimiter = next((mark for mark in _DELIMITERS if mark in first), ",")
    if delimiter != ",":
        notes.append(f"columns separated by {_DELIMITERS[delimiter]}")
        if any("," in line for line in body.values()):
            notes.append("decimal commas")
            body = {
                number: _with_point(line, f"{source}: line {number}")
                for number, line in body.items()
            }
    header = tuple(_cells(first, delimiter, where))
    return Table(header, where, body, delimiter, source, tuple(notes))


def _with_point(line: str, where: str) -> str:
    """Replace decimal commas by points, and refuse a line with both, because one would separate thousands."""
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
    ("o", "a", "t"): ("euler_zyz",),
    ("a", "e", "r"): ("euler_zyz",),
    ("i", "j", "k"): (),
}
"""Columns of orientations and their possible conventions, which have their numbers in this order. The tool axis has no
convention."""
_SPEED: Final = "feed"
_SPEED_NAMES: Final = ("feed", "feedrate", "f", "speed", "v")
_HEADING = re.compile(
    r"^([a-z]+?|q[1-4])(?:\s*[_ ]\s*([a-z/_]+)|\s*[\[(]\s*([a-z/]+)\s*[\])])?$"
)


def _allowed_columns(rows: Rows) -> str:
    """Return the possible columns of a file, for messages."""
    return " | ".join(",".join(choice) for choice in _choices(rows))


def _choices(rows: Rows) -> tuple[tuple[str, ...], ...]:
    position: tuple[str, ...] = POSITION
    if isinstance(rows, tuple):
        if "axis" not in rows:
            return (rows,)
        position = rows[:-1]
    return (position, *(position + columns for columns in _ORIENTATIONS))


def _read_columns(
    table: Table, rows: Rows, stated: str | None
) -> tuple[dict[str, tuple[int, str | None]], tuple[str, ...], str | None]:
    """Return the meaning of each column of a table.

    Parameters
    ----------
    table : Table
    rows : tuple of str or str
        Rows of the task space, or its name if it is a task space of poses.
    stated : str, optional
        Convention of the orientations that the task states.

    Returns
    -------
    places : dict of str to (int, str or None)
        Index and unit of each column, by name.
    names : tuple of str
        Names of the columns of positions and orientations.
    convention : str or None
        Convention of the orientations; None if there are no orientations.

    Raises
    ------
    TaskError
        Columns are missing or unknown, or the convention of their orientations is unknown.
    """
    places = {}
    for column, text in enumerate(table.header):
        name, unit = _heading(text)
        places[name] = (column, unit)
    names = sorted(name for name in places if name != _SPEED)
    choice = next(
        (columns for columns in _choices(rows) if sorted(columns) == names), None
    )
    if choice is None or len(places) != len(table.header):
        raise TaskError(
            "the columns are wrong",
            found=", ".join(table.header),
            allowed=_allowed_columns(rows),
            where=table.where,
            hint="The first line names the columns, separated by commas, semicolons, tabs or spaces; units may follow "
            "names (x_mm); a column feed may be added",
        )
    return places, choice, _convention(choice, stated, table.where)


def _heading(text: str) -> tuple[str, str | None]:
    """Return the name and unit in a column heading, or an unknown heading unchanged."""
    match = _HEADING.match(text.strip().lower())
    if match is None:
        return text, None
    name = _SPEED if match[1] in _SPEED_NAMES else match[1]
    unit = match[2] or match[3]
    return name, unit and unit.replace("_per_", "/").replace("_", "/")


def _convention(names: tuple[str, ...], stated: str | None, where: str) -> str | None:
    """Return the convention of the orientations: the stated one, or the only one that fits the columns."""
    columns = tuple(name for name in names if name not in POSITION)
    possible = _ORIENTATIONS.get(columns, ())
    if stated is None and len(possible) > 1:
        raise TaskError(
            f"the columns {', '.join(columns)} do not state the convention of the orientation",
            allowed=f"csv.orientation: {choices(possible)}",
            where=where,
            hint="State it in the task, csv: {file: ..., orientation: ...}; a wrong convention gives a wrong motion",
        )
    if stated is not None and stated not in possible:
        usual = [
            ", ".join(column_names)
            for column_names, conventions in _ORIENTATIONS.items()
            if stated in conventions
        ]
        hint = "Remove csv.orientation"
        if possible:
            hint = f"Or csv.orientation: {choices(possible)}"
        raise TaskError(
            f"csv.orientation is {stated}, which does not fit the columns of the file",
            found=", ".join(names),
            allowed=f"columns {' | '.join(usual)} for {stated}",
            where=where,
            hint=hint,
        )
    return stated or next(iter(possible), None)


def _factor_of(
    name: str, kind: str, unit: str | None, task_unit: str | None, where: str
) -> float:
    """Return the factor from the unit of a column to SI units; the unit must not differ from that in the task.

    Raises
    ------
    TaskError
    """
    factors = UNITS[kind]
    if unit is None:
        usual = {"speed": "mm/min", "angle": "deg"}[kind]
        raise TaskError(
            f"the unit of {name} is not stated",
            allowed=", ".join(factors),
            where=where,
            hint=f"Write {name}_{usual} in the header, or units: {{{kind}: {usual}}} in the task",
        )
    if unit not in factors:
        problem = f"unknown unit of {kind}"
        allowed = ", ".join(factors)
    elif task_unit is None or factors[task_unit] == factors[unit]:
        return factors[unit]
    else:
        problem = "the header contradicts the units in the task"
        allowed = task_unit
    raise TaskError(problem, found=f"{unit} for {name}", allowed=allowed, where=where)


def read_points(text: str, rows: Rows, settings: PointFile, source: str) -> Points:
    """Return the points of a table in SI units, with notes on how the table was read.

    Parameters
    ----------
    text : str
        The table.
    rows : tuple of str or str
        Rows of the task space, or its name if it is a task space of poses.
    settings : PointFile
        Units and convention of the orientations that the task states.
    source : str
        Name of the file, for messages.

    Raises
    ------
    TaskError
        Columns are missing or unknown, units are missing or contradict each other, a quaternion or an axis does not
        have unit length, or a feed rate is not positive.
    """
    table = read_table(text, source, _allowed_columns(rows))
    places, names, convention = _read_columns(table, rows, settings.orientation)
    is_euler = convention and CONVENTIONS[convention].euler
    defaults = {"length": "m", "angle": None if is_euler else "rad"}
    notes = [*table.notes]

    def read(names: Sequence[str], kind: str) -> Array:
        """Return the columns of one kind of quantity, in SI units."""
        chosen = [places[name] for name in names]
        task_unit = getattr(settings.units, kind)
        usual = task_unit or defaults.get(kind)
        factors = [
            _factor_of(name, kind, unit or usual, task_unit, table.where)
            for name, (_, unit) in zip(names, chosen, strict=True)
        ]
        stated = dict.fromkeys(unit for _, unit in chosen if unit is not None)
        if stated:
            notes.append(f"{kind} in {' and '.join(stated)}, as stated in the header")
        return table.values[:, [place for place, _ in chosen]] * np.array(factors)

    position = [name for name in names if name in POSITION]
    turning_names = names[len(position) :]
    lengths = read(position, "length")
    speed = read([_SPEED], "speed")[:, 0] if _SPEED in places else None
    has_axis = turning_names == ("i", "j", "k")
    if has_axis or (convention and convention.startswith("quaternion")):
        turning = table.values[:, [places[name][0] for name in turning_names]]
    else:
        turning = read(turning_names, "angle")
    points = Points(lengths, turning, speed, table.lines, source)
    if convention:
        points = _with_quaternions(points, convention)
        notes.append(f"orientations: {CONVENTIONS[convention].meaning}")
    if has_axis:
        if rows == "pose":
            raise TaskError(
                "the columns i, j, k state the tool's axis but not its roll",
                found="task_space pose",
                allowed="task_space pose_free_roll",
                where=table.where,
                hint="Give orientations, such as qw,qx,qy,qz, if the roll matters",
            )
        points = _with_rolls(points)
        notes.append("orientations: i, j, k are the direction of the tool's z axis")
    if speed is not None:
        for i in np.flatnonzero(speed <= 0.0).tolist():
            raise points.wrong(
                i,
                "a feed rate must be positive",
                found=f"{speed[i]:g} m/s",
                allowed="more than 0",
            )
    return replace(points, notes=tuple(notes))


def _check_lengths(points: Points, name: str) -> None:
    """Refuse rows of `turning` that do not have unit length; the error names the first one."""
    lengths = np.linalg.norm(points.turning, axis=1)
    for i in np.flatnonzero(np.abs(lengths - 1.0) > 0.01).tolist():
        raise points.wrong(
            i,
            f"the {name}'s length is {lengths[i]:.6g}",
            found=str(points.turning[i].tolist()),
            allowed=f"{name} of length 1",
        )


def _with_quaternions(points: Points, convention: str) -> Points:
    """Return points with orientations in a convention, angles in rad, converted to quaternions w, x, y, z."""
    if convention.startswith("quaternion"):
        _check_lengths(points, "quaternion")
    quaternions = quaternions_of(rotation_by(convention, points.turning))
    return replace(points, turning=with_like_signs(quaternions))


def _with_rolls(points: Points) -> Points:
    """Return points with quaternions w, x, y, z in place of directions of the tool's z axis.

    From each direction to the next, the tool turns about their common normal; it never rolls about its own axis.
    """
    from scipy.spatial.transform import Rotation

    _check_lengths(points, "axis")
    axes = points.turning / np.linalg.norm(points.turning, axis=1)[:, None]
    is_down = bool(axes[0, 2] < 0.0)
    upright = Rotation.from_rotvec([np.pi * is_down, 0.0, 0.0])
    before = np.concatenate([upright.apply([[0.0, 0.0, 1.0]]), axes[:-1]])
    cosines = np.sum(before * axes, axis=1)
    for i in np.flatnonzero(cosines < -1.0 + 1e-6).tolist():
        raise points.wrong(
            i,
            "the tool axis reverses from one row to the next",
            hint="Add rows in between",
        )
    half_turns = np.column_stack([np.cross(before, axes), 1.0 + cosines])
    turns = Rotation.from_quat(half_turns)
    step = 1
    while step < len(axes):  # cumulative products of the turns
        turns = turns.concatenate([turns[:step], turns[step:] * turns[:-step]])
        step *= 2
    return replace(points, turning=with_like_signs(quaternions_of(turns * upright)))
