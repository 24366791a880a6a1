"""What the columns of a table are: ``x``, ``x_mm``, ``X [mm]``, ``rx (deg)``, ``feed_mm/min``, ... in any order."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from brachis.arrays import with_like_signs
from brachis.cam.points import Array, Points
from brachis.cam.table import Table
from brachis.cam.units import ANGLES, LENGTHS, SPEEDS, Units
from brachis.errors import TaskError

POSITION: Final = ("x", "y", "z")
_QUATERNION: Final = ("qw", "qx", "qy", "qz")
_ROTATION_VECTOR: Final = ("rx", "ry", "rz")
_SPEED: Final = "feed"
_SPEED_NAMES: Final = ("feed", "feedrate", "f", "speed", "v")
_HEADING = re.compile(r"^([a-z]+?)(?:\s*[_ ]\s*([a-z/_]+)|\s*[\[(]\s*([a-z/]+)\s*[\])])?$")
_UNIT_LENGTH = 0.01
_DEFAULTS = Units(length="m", angle="rad")


def allowed_columns(rows: tuple[str, ...] | str) -> str:
    """Return the columns that a file may have, for messages."""
    return " | ".join(",".join(choice) for choice in _choices(rows))


def understood(
    header: tuple[str, ...], where: str, rows: tuple[str, ...] | str
) -> tuple[dict[str, tuple[int, str | None]], tuple[str, ...]]:
    """Return index and unit of every column by its name, and the names that belong to positions and orientations.

    Raises
    ------
    TaskError
        Columns are missing or unknown.
    """
    headings = {name: (column, unit) for column, name, unit in map(_heading, range(len(header)), header)}
    names = sorted(name for name in headings if name != _SPEED)
    choice = next((one for one in _choices(rows) if sorted(one) == names), None)
    if choice is None or len(headings) != len(header):
        problem = "wrong columns"
        hint = "The first line names the columns, separated by commas, semicolons, tabs or spaces; units may follow "
        hint += "(x_mm); a column feed may stand beside them"
        raise TaskError(problem, found=", ".join(header), allowed=allowed_columns(rows), where=where, hint=hint)
    return headings, choice


def points_of(table: Table, rows: tuple[str, ...] | str, units: Units, source: str) -> tuple[Points, tuple[str, ...]]:
    """Return the points of a table in SI units, and what was found out about the units.

    Parameters
    ----------
    table : Table
    rows : tuple of str or str
        Rows of the task space, or the word for one of poses.
    units : Units
        As the task states them.
    source : str
        The file, for messages.

    Raises
    ------
    TaskError
        Columns are missing or unknown, units contradict each other, or a quaternion has no unit length.
    """
    where = f"{source}: line {table.header_line}"
    headings, choice = understood(table.header, where, rows)
    stated: dict[str, dict[str, None]] = {}

    def column(name: str, kind: str, factors: dict[str, float]) -> Array:
        index, unit = headings[name]
        return table.values[:, index] * factors[_unit(name, unit, kind, factors, units, stated, where)]

    position = tuple(name for name in choice if name in POSITION)
    lengths = np.column_stack([column(name, "length", LENGTHS) for name in position])
    speed = column(_SPEED, "speed", SPEEDS) if _SPEED in headings else None
    others = choice[len(position) :]
    if others == _QUATERNION:
        turning = table.values[:, [headings[name][0] for name in others]]
    else:
        angles = [column(name, "angle", ANGLES) for name in others]
        turning = np.column_stack(angles) if angles else np.empty((len(lengths), 0))
    points = Points(lengths, _turning(turning, others, table, source), speed, table.lines, source)
    _check_speeds(points)
    return points, tuple(f"{kind} in {' and '.join(units)}, as the header says" for kind, units in stated.items())


def _choices(rows: tuple[str, ...] | str) -> tuple[tuple[str, ...], ...]:
    if isinstance(rows, tuple):
        return (rows,)
    return (POSITION, POSITION + _QUATERNION, POSITION + _ROTATION_VECTOR)


def _heading(index: int, text: str) -> tuple[int, str, str | None]:
    """Return column index, name and unit of a heading; a name that is not understood as it is written."""
    match = _HEADING.match(text.strip().lower())
    if match is None:
        return index, text, None
    unit = match[2] or match[3]
    name = _SPEED if match[1] in _SPEED_NAMES else match[1]
    return index, name, None if unit is None else unit.replace("_per_", "/").replace("_", "/")


def _unit(
    name: str,
    unit: str | None,
    kind: str,
    factors: dict[str, float],
    units: Units,
    stated: dict[str, dict[str, None]],
    where: str,
) -> str:
    """Return the unit of a column: the heading's, else the task's, else m or rad."""
    asked, found = getattr(units, kind), f"{unit} for {name}"
    if unit is not None:
        if unit not in factors:
            raise TaskError(f"unknown unit of {kind}", found=found, allowed=", ".join(factors), where=where)
        if asked is not None and factors[asked] != factors[unit]:
            raise TaskError("the header contradicts the task's units", found=found, allowed=asked, where=where)
        stated.setdefault(kind, {})[unit] = None
        return unit
    if asked is None and getattr(_DEFAULTS, kind) is None:
        hint = "Write feed_mm/min in the header, or units: {speed: mm/min} in the task"
        raise TaskError(f"the unit of {name} is not stated", allowed=", ".join(factors), where=where, hint=hint)
    return str(asked or getattr(_DEFAULTS, kind))


def _turning(values: Array, names: tuple[str, ...], table: Table, source: str) -> Array:
    """Return quaternions where the tool's orientation is given, or yaw, or nothing."""
    if names == _ROTATION_VECTOR:
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  (imports in 0.2 s)

        return with_like_signs(np.roll(Rotation.from_rotvec(values).as_quat(), 1, axis=1))
    if names != _QUATERNION:
        return values
    off = np.abs(np.linalg.norm(values, axis=1) - 1.0)
    if np.any(off > _UNIT_LENGTH):
        i = int(np.argmax(off > _UNIT_LENGTH))
        problem = f"the quaternion's length is {np.linalg.norm(values[i]):.6g}"
        where = f"{source}: line {table.lines[i]}"
        raise TaskError(problem, found=values[i].tolist(), allowed="qw, qx, qy, qz of length 1", where=where)
    return with_like_signs(values)


def _check_speeds(points: Points) -> None:
    if points.speed is None:
        return
    wrong = np.flatnonzero(points.speed <= 0.0)
    if wrong.size:
        i = int(wrong[0])
        problem = "a feed rate must be positive"
        raise points.wrong(i, problem, found=f"{points.speed[i]:g} m/s", allowed="more than 0")
