"""A recorded motion: time and joint positions from a CSV file whose header names the columns and their units."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from brachis.common.files import check_kind, read_text
from brachis.common.words import write_count
from brachis.errors import InputError, TaskError, check_names
from brachis.robot import Robot
from brachis.task.points.tables import Table, read_table
from brachis.task.points.units import ANGLES, LENGTHS

TIMES: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_UNITS: Final = {
    "s": ("time", TIMES),
    "rad": ("angle", ANGLES),
    "m": ("length", LENGTHS),
    "deg": ("angle", ANGLES),
    "mm": ("length", LENGTHS),
    "nm": ("torque", {"nm": 1.0, "n": 1.0}),
}
"""The quantity that each SI unit measures, and the units that a file may use for this quantity, with their factors."""
_TIME_COLUMNS = ("t", "time", "timestamp")
_JOINT_COLUMNS: Final = {
    "tau": "tau_{0} torque_{0} effort_{0} {0}_tau {0}_torque {0}_effort",
    "qddot": "qdd_{0} ddq_{0} a_{0} acc_{0} acceleration_{0} {0}_acc {0}_acceleration",
    "qdot": "qd_{0} dq_{0} v_{0} vel_{0} velocity_{0} {0}_vel {0}_velocity",
    "q": "{0} q_{0} pos_{0} position_{0} {0}_pos {0}_position",
}
"""Column names of joint ``{0}``.

A name that appears in several rows has the meaning given in the last of these rows.
"""
_QUANTITIES: Final = {
    "t": ("time", ""),
    "q": ("position", ""),
    "qdot": ("velocity", "/s"),
    "qddot": ("acceleration", "/s^2"),
    "tau": ("torque", ""),
}
"""Name of each quantity, and the text that follows its unit of time, angle or length."""
_UNIT_WORDS = "|".join({**TIMES, **ANGLES, **LENGTHS})
_NAME_AND_UNIT = re.compile(
    rf"^(.+?)\s*(?:[\[(]\s*([a-z0-9/^]+)\s*[\])]|_((?:{_UNIT_WORDS})(?:(?:/|_|_per_)s(?:\^?2)?)?))$"
)
FEWEST_ROWS = 5
"""Minimum number of rows of a motion: derivatives come from a polynomial through five rows."""
_STILL = 1e-12
"""Motion between two rows, rad or m, below which a joint stands still if the file has all digits."""


def check_units(units: object) -> dict[str, str]:
    """Check the units that the user states for ``angle``, ``length`` and ``time``; drop entries that are None.

    Raises
    ------
    InputError
        A quantity or a unit is unknown.
    """
    if not isinstance(units, Mapping):
        raise InputError(
            "wrong type",
            where="units",
            found=repr(units),
            allowed='{"angle": "deg", "length": "mm", "time": "ms"}, or some of these keys',
        )
    known = dict(_UNITS.values())
    check_names("quantity", units, known, "units")
    stated = {name: unit for name, unit in units.items() if unit is not None}
    for name, unit in stated.items():
        check_names(f"unit of {name}", [unit], known[name], f"units.{name}")
    return stated


Columns = dict[tuple[str, str], tuple[int, str | None]]
"""Index of each column, and the unit that its header states, by quantity and joint (an empty string for time)."""


def _allowed_columns(joints: Sequence[str]) -> str:
    """Describe the expected columns of a file, for messages."""
    first = joints[0]
    rates = f"qd_{first}, ..., qdd_{first}, ... if rates are known"
    return f"t, then {', '.join(joints)} (or q_{first}, ...), and {rates}"


def _find_columns(header: Sequence[str], joints: Sequence[str], where: str) -> Columns:
    """Find the columns of time and joints. Other columns are ignored.

    Raises
    ------
    TaskError
        The time or the position of a joint is missing or occurs twice, or only some joints have velocities or
        accelerations.
    """
    meanings = dict.fromkeys(_TIME_COLUMNS, ("t", ""))
    for kind, forms in _JOINT_COLUMNS.items():
        for joint in joints:
            names = [form.format(joint.lower()) for form in forms.split()]
            meanings |= dict.fromkeys(names, (kind, joint))
    columns: Columns = {}
    problems = []
    for i, text in enumerate(header):
        name = text.lower()
        unit = None
        if name not in meanings and (match := _NAME_AND_UNIT.match(name)):
            name = match[1]
            unit = (match[2] or match[3]).replace("_per_", "/").replace("_", "/")
            unit = unit.replace("s2", "s^2")
        key = meanings.get(name)
        if key in columns:
            problems.append(f"{_describe(*key)} occurs twice")
        has_foreign_unit = key and key[0] == "tau" and unit not in (None, "nm", "n")
        if key is not None and not has_foreign_unit:
            columns[key] = (i, unit)
    with_torques = {joint for kind, joint in columns if kind == "tau"}
    if with_torques != set(joints):  # torques that only some joints have are left out
        columns = {key: column for key, column in columns.items() if key[0] != "tau"}
    kinds = dict.fromkeys(["q", *(kind for kind, joint in columns if joint)])
    required = [("t", ""), *((kind, joint) for kind in kinds for joint in joints)]
    missing = [key for key in required if key not in columns]
    problems += [f"{_describe(*key)} is missing" for key in missing]
    if problems:
        shown = [*header[:8], "..."] if len(header) > 8 else header
        raise TaskError(
            problems[0],
            found=", ".join(shown),
            allowed=_allowed_columns(joints),
            where=where,
        )
    return columns


def _describe(kind: str, joint: str) -> str:
    """Describe a column, for messages."""
    return f"the {_QUANTITIES[kind][0]} of {joint!r}" if joint else "the time"


def _read_column(
    table: Table,
    column: tuple[int, str | None],
    kind: str,
    base: str,
    units: Mapping[str, str],
) -> tuple[np.ndarray, str, float]:
    """Return a column in SI units, (K,), its unit in the file, and half a unit of its last digit in SI units.

    Parameters
    ----------
    table : Table
    column : (int, str or None)
        Index of the column, and the unit that its header states.
    kind : str
        Quantity in the column, a key of `_QUANTITIES`.
    base : {"s", "rad", "m"}
        SI unit of time, or of the joint's position.
    units : mapping
        Units of angles, lengths and times that the user states.

    Raises
    ------
    TaskError
        A unit is unknown, or the header and the user state different units.
    """
    i, stated = column
    name, factors = _UNITS[base]
    user_unit = units.get(name)
    _, per = _QUANTITIES[kind]
    values = table.values[:, i]
    if stated is None:
        stated = f"{user_unit or base}{per}"
    unit = stated.removesuffix(per)
    if unit not in factors or not stated.endswith(per):
        raise TaskError(
            f"unknown unit of column {table.header[i]}",
            found=stated,
            allowed=", ".join(f"{known}{per}" for known in factors),
            where=table.where,
        )
    if user_unit is not None and factors[user_unit] != factors[unit]:
        raise TaskError(
            "the unit in the header is not the requested unit",
            found=f"{unit} for {table.header[i]}",
            allowed=user_unit,
            where=table.where,
        )
    rounding = 0.0
    for decimals in range(12):  # further decimals do not matter
        if np.ptp(values) and np.array_equal(np.round(values, decimals), values):
            rounding = 0.5 * 10.0**-decimals * factors[unit]
            break
    return values * factors[unit], stated, rounding


class HasJoints(Protocol):
    """A robot, or the axes of a controller."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""

    @property
    def position_units(self) -> tuple[str, ...]:
        """Unit of each joint's position, ``rad`` or ``m``."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Positions of a robot's joints at K times, as read from a file.

    Attributes
    ----------
    t : (K,) ndarray
        Times of the rows, beginning with 0, s.
    q : (K, n) ndarray
        Joint positions, rad or m.
    qdot, qddot : (K, n) ndarray or None
        Velocities, rad/s or m/s, and accelerations, rad/s^2 or m/s^2, if the file has them.
    rounding : (n,) ndarray
        Half a unit of the last digit of every joint's positions, rad or m; 0 if the file has all digits.
    units : tuple of str
        Unit of every joint's positions: rad or m.
    source : str
        Name of the file that was read.
    notes : tuple of str
        Notes on how the file was read.
    tau : (K, n) ndarray or None
        Torques, Nm or N, if the file has them.
    begin : float
        Time of the first row that is kept, after the first row of the file, s.
    """

    t: np.ndarray
    q: np.ndarray
    qdot: np.ndarray | None
    qddot: np.ndarray | None
    rounding: np.ndarray
    units: tuple[str, ...]
    source: str
    notes: tuple[str, ...]
    tau: np.ndarray | None = None
    begin: float = 0.0


def read_recording(
    path: str | os.PathLike[str], robot: HasJoints, units: Mapping[str, str]
) -> Recording:
    """Read a CSV file of times and joint positions, with velocities and accelerations if it has them.

    Rows before and after the motion are left out, because the robot stands still in them.

    Parameters
    ----------
    path : path
    robot : Robot or ControllerAxes
        Robot, or axes of a controller, after whose joints the columns are named.
    units : mapping
        Units of ``angle``, ``length`` and ``time`` in columns whose header states no unit.

    Raises
    ------
    TaskError
        The file cannot be read, columns are missing, times do not ascend, or no joint moves.
    """
    source = Path(path)
    joints = robot.joint_names
    check_kind(source, "a CSV file", TaskError)
    text = read_text(source, where=str(source), folder=Path.cwd(), largest=64_000_000)
    table = read_table(text, str(source), _allowed_columns(joints))
    columns = _find_columns(table.header, joints, table.where)
    bases = {"": "s", **dict(zip(joints, robot.position_units, strict=True))}
    read = {
        (kind, joint): _read_column(
            table, column, kind, "nm" if kind == "tau" else bases[joint], units
        )
        for (kind, joint), column in columns.items()
    }
    t, time_unit, _ = read["t", ""]
    positions = [read["q", joint] for joint in joints]
    _, position_units, digits = zip(*positions, strict=True)
    rounding = np.array(digits)
    states = {}
    for kind in ("q", "qdot", "qddot", "tau"):
        if (kind, joints[0]) in read:
            states[kind] = np.column_stack([read[kind, joint][0] for joint in joints])
    q = states["q"]
    _check_times(t, table, source)
    if "angle" not in units and isinstance(robot, Robot):
        _check_angles(q, robot, source)
    stated = ", ".join(dict.fromkeys((time_unit, *position_units)))
    notes = [*table.notes, f"units: {stated}"]
    known = {i for i, _ in columns.values()}
    ignored = [name for i, name in enumerate(table.header) if i not in known]
    if ignored:
        notes.append(f"ignored columns: {', '.join(ignored)}")
    moving, left_out = _moving_rows(t, q, rounding, source)
    moved = {kind: values[moving] for kind, values in states.items()}
    return Recording(
        t[moving] - t[moving.start],
        moved["q"],
        moved.get("qdot"),
        moved.get("qddot"),
        rounding,
        robot.position_units,
        str(source),
        (*notes, *left_out),
        moved.get("tau"),
        float(t[moving.start] - t[0]),
    )


def _moving_rows(
    t: np.ndarray, q: np.ndarray, rounding: np.ndarray, source: Path
) -> tuple[slice, list[str]]:
    """Return the rows of the motion, and notes on the rows left out before and after it.

    Raises
    ------
    TaskError
        The motion has too few rows.
    """
    first = _first_row(t, q, rounding)
    end = len(t) - _first_row(-t[::-1], q[::-1], rounding)
    if end - first < FEWEST_ROWS:
        moves = f"moves in fewer than {FEWEST_ROWS} rows"
        raise TaskError(
            f"the robot {'does not move' if first == len(t) else moves}",
            found=write_count(len(t), "row"),
            allowed=f"{FEWEST_ROWS} or more rows in which a joint moves",
            where=str(source),
        )
    notes = []
    for when, still in (("before", t[: first + 1]), ("after", t[end - 1 :])):
        if len(still) > 1:
            rows = write_count(len(still) - 1, "row")
            time = f"{still[-1] - still[0]:.6g} s"
            notes.append(
                f"left out {time} {when} the motion, in which the robot stands still ({rows})"
            )
    return slice(first, end), notes


def _check_times(t: np.ndarray, table: Table, source: Path) -> None:
    """Raise an error if times do not ascend."""
    for i in np.flatnonzero(np.diff(t) <= 0.0):
        raise TaskError(
            "the times do not increase",
            found=f"{t[i + 1]:g} s after {t[i]:g} s",
            where=f"{source}: line {table.lines[i + 1]}",
        )


def _check_angles(q: np.ndarray, robot: Robot, source: Path) -> None:
    """Raise an error for angles so large that they must be degrees read as radians."""
    ends = [robot.limits.position_lower, robot.limits.position_upper]
    farthest = np.abs(ends).max(axis=0)
    reach = 1.5 * np.where(np.isfinite(farthest), farthest, 0.0)
    largest = np.abs(q).max(axis=0)
    # Without a range, three turns are plausible.
    is_far = robot.revolute & (largest > np.maximum(6.0 * np.pi, reach))
    if is_far.any():
        joint = int(np.argmax(is_far))
        raise TaskError(
            "implausible angle (degrees?)",
            found=f"{largest[joint]:.4g} rad at {robot.joint_names[joint]}",
            where=str(source),
            hint='If these are degrees, set units={"angle": "deg"} or --angle deg; if they are radians, set rad',
        )


def _first_row(t: np.ndarray, q: np.ndarray, rounding: np.ndarray) -> int:
    """Return the row at which the motion begins; the number of rows if nothing moves.

    If the file has few digits, a gentle motion has already continued for a while when the last digit changes. The
    travel of such a motion grows as the cube of time, so it is eight times as large after twice the time.
    """
    away = np.abs(q - q[0])
    # A flickering last digit changes by 2 roundings; 24 roundings are a dozen such changes.
    changed = away > np.maximum(_STILL, 2.2 * rounding)
    clear = away > np.maximum(_STILL, 24.0 * rounding)
    if not changed.any():
        return len(t)
    row = int(np.argmax(changed.any(axis=1)))
    lead = t[np.argmax(clear.any(axis=1))] - t[row] if clear.any() else 0.0
    before = np.searchsorted(t, t[row] - lead, side="right") - 1
    return int(np.clip(before, 0, row - 1))
