"""A joint trajectory that was made elsewhere, as it stands in its file.

What the columns of a recorded motion are: ``t``, ``time_ms``, ``j1``, ``q_j1``, ``j1_pos [deg]``, ``qd_j1``, ...
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, NoReturn

import numpy as np

from brachis.common.arrays import freeze
from brachis.common.files import check_kind, read_text
from brachis.errors import TaskError, write_count
from brachis.robot import Robot
from brachis.task.points.tables import Table, read_table
from brachis.task.points.units import ANGLES, LENGTHS

TIMES: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_TIME = ("t", "time", "timestamp")
_POSITION = ("{}", "q_{}", "pos_{}", "position_{}", "{}_pos", "{}_position")
_VELOCITY = ("qd_{}", "dq_{}", "v_{}", "vel_{}", "velocity_{}", "{}_vel", "{}_velocity")
_ACCELERATION = (
    "qdd_{}",
    "ddq_{}",
    "a_{}",
    "acc_{}",
    "acceleration_{}",
    "{}_acc",
    "{}_acceleration",
)
_UNITS = "|".join({**TIMES, **ANGLES, **LENGTHS})
_STATED = re.compile(
    rf"^(.+?)\s*(?:[\[(]\s*([a-z0-9/^]+)\s*[\])]|_((?:{_UNITS})(?:(?:/|_|_per_)s(?:\^?2)?)?))$"
)
_DIGITS = 12
_LISTED = 8

Kind = Literal["t", "q", "qdot", "qddot"]
_WORDS: Final = {
    "t": "time",
    "q": "position",
    "qdot": "velocity",
    "qddot": "acceleration",
}
_PER: Final = {"t": "", "q": "", "qdot": "/s", "qddot": "/s^2"}


@dataclass(frozen=True)
class Units:
    """Units of the numbers in a file; None: as the header says, else s, rad and m.

    Attributes
    ----------
    angle, length, time : str or None
        Out of ``rad``, ``deg``, ...; ``m``, ``mm``, ...; ``s``, ``ms``, ...
    """

    angle: str | None = None
    length: str | None = None
    time: str | None = None

    def __post_init__(self) -> None:
        """Refuse unknown units.

        Raises
        ------
        TaskError
        """
        for name, known in (("angle", ANGLES), ("length", LENGTHS), ("time", TIMES)):
            unit = getattr(self, name)
            if unit is not None and unit not in known:
                raise TaskError(
                    f"unknown unit of {name}",
                    found=unit,
                    allowed=", ".join(known),
                    where=f"units.{name}",
                )


@dataclass(frozen=True)
class _Column:
    """A column that is understood: what it is, of which joint, and the unit that the header states."""

    kind: Kind
    joint: str
    unit: str | None


def allowed_columns(joints: Sequence[str]) -> str:
    """Say which columns a file has, for messages."""
    first = joints[0]
    rates = f"qd_{first}, ..., qdd_{first}, ... where rates are known"
    return f"t, then {', '.join(joints)} (or q_{first}, ...), and {rates}"


def understood(
    header: Sequence[str], joints: Sequence[str], where: str
) -> dict[int, _Column]:
    """Return what the columns are, by their index; those of other quantities are left out.

    Raises
    ------
    TaskError
        Time or a joint's position is missing or stands there twice, or only some joints have velocities or
        accelerations.
    """
    known: dict[str, tuple[Kind, str]] = dict.fromkeys(_TIME, ("t", ""))
    for joint in joints:
        known |= {
            form.format(joint.lower()): ("qddot", joint) for form in _ACCELERATION
        }
        known |= {form.format(joint.lower()): ("qdot", joint) for form in _VELOCITY}
        known |= {form.format(joint.lower()): ("q", joint) for form in _POSITION}
    found: dict[int, _Column] = {}
    for i, text in enumerate(header):
        name, unit = text.strip().lower(), None
        match = None if name in known else _STATED.match(name)
        if match is not None:
            name, unit = (
                match[1],
                (match[2] or match[3])
                .replace("_per_", "/")
                .replace("_", "/")
                .replace("s2", "s^2"),
            )
        if name in known:
            found[i] = _Column(*known[name], unit)
    listed = [(column.kind, column.joint) for column in found.values()]
    wanted: list[tuple[Kind, str]] = [("t", ""), *(("q", joint) for joint in joints)]
    rates: tuple[Kind, ...] = ("qdot", "qddot")
    wanted += [
        (kind, joint)
        for kind in rates
        if any(kind == one for one, _ in listed)
        for joint in joints
    ]
    for kind, joint in wanted:
        if listed.count((kind, joint)) != 1:
            what = f"the {_WORDS[kind]} of {joint!r}" if joint else "the time"
            problem = f"{what} {'is missing' if (kind, joint) not in listed else 'stands there twice'}"
            names = ", ".join(header[:_LISTED]) + (
                ", ..." if len(header) > _LISTED else ""
            )
            raise TaskError(
                problem, found=names, allowed=allowed_columns(joints), where=where
            )
    return found


@dataclass(frozen=True, eq=False)
class Quantity:
    """A column in SI units.

    Attributes
    ----------
    values : (K,) ndarray
    unit : str
        In which the file has it.
    rounding : float
        Half of the last digit that it has there, in SI units; 0 where it has a dozen decimals.
    """

    values: np.ndarray
    unit: str
    rounding: float


def in_si(
    table: Table,
    columns: dict[int, _Column],
    kind: Kind,
    joint: str,
    base: str,
    units: Units,
    where: str,
) -> Quantity:
    """Return a column in SI units.

    Parameters
    ----------
    table : Table
    columns : dict
        Of `understood`.
    kind : {"t", "q", "qdot", "qddot"}
    joint : str
    base : {"s", "rad", "m"}
        SI unit of the joint's position, or of time.
    units : Units
        As the user states them.
    where : str
        Line of the header, for messages.

    Raises
    ------
    TaskError
        A unit is unknown, or the header and the user contradict each other.
    """
    i = next(
        i
        for i, column in columns.items()
        if (column.kind, column.joint) == (kind, joint)
    )
    factors, asked = {
        "s": (TIMES, units.time),
        "rad": (ANGLES, units.angle),
        "m": (LENGTHS, units.length),
    }[base]
    per = _PER[kind]
    stated, values = columns[i].unit, table.values[:, i]
    unit = (asked or base) if stated is None else stated.removesuffix(per)
    if unit not in factors or (stated is not None and not stated.endswith(per)):
        allowed = ", ".join(f"{name}{per}" for name in factors)
        raise TaskError(
            f"unknown unit of column {table.header[i]}",
            found=stated,
            allowed=allowed,
            where=where,
        )
    if asked is not None and factors[asked] != factors[unit]:
        problem = "the header contradicts the units asked for"
        raise TaskError(
            problem, found=f"{unit} for {table.header[i]}", allowed=asked, where=where
        )
    decimals = next(
        (d for d in range(_DIGITS) if np.array_equal(np.round(values, d), values)), None
    )
    rounding = (
        0.0
        if decimals is None or not np.ptp(values)
        else 0.5 * 10.0**-decimals * factors[unit]
    )
    return Quantity(values * factors[unit], f"{unit}{per}", rounding)


FEWEST = 5
"""Rows; a polynomial through so many gives the derivatives."""
_LARGEST_FILE = 64_000_000
_STILL = 1e-12
"""rad or m: what moves less between rows with all digits stands still."""
_SHOWS, _CLEAR = 2.2, 24.0
"""Of the rounding: a digit has changed, which flicker does not; and the digit moves through a dozen."""
_MANY_TURNS = 6.0 * np.pi


@dataclass(frozen=True, eq=False)
class Recording:
    """Positions of a robot's joints at K times.

    Attributes
    ----------
    t : (K,) ndarray
        From 0 on, s.
    q : (K, n) ndarray
        rad or m.
    qdot, qddot : (K, n) ndarray or None
        Where the file says them; rad/s or m/s, rad/s^2 or m/s^2.
    rounding : (n,) ndarray
        Half of the last digit of every joint's positions, rad or m, where the file has few digits; else 0.
    units : tuple of str
        Of every joint's positions: rad or m.
    source : str
        The file.
    told : tuple of str
        What was found out about it.
    """

    t: np.ndarray
    q: np.ndarray
    qdot: np.ndarray | None
    qddot: np.ndarray | None
    rounding: np.ndarray
    units: tuple[str, ...]
    source: str
    told: tuple[str, ...]

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        rates = (name for name in ("qdot", "qddot") if getattr(self, name) is not None)
        freeze(self, "t", "q", "rounding", *rates)


def read_recording(
    path: str | os.PathLike[str], robot: Robot, units: Units
) -> Recording:
    """Read a CSV file of time and joint positions, and of velocities where it has them.

    Rows in which the robot stands still before and after the motion are left out.

    Parameters
    ----------
    path : path
    robot : Robot
        Its joints name the columns.
    units : Units

    Raises
    ------
    TaskError
        The file cannot be read, columns are missing, times do not ascend, or nothing moves.
    """
    source, joints = Path(path), robot.joint_names
    check_kind(source, "a CSV file", TaskError)
    text = read_text(
        source, where=str(source), folder=Path.cwd(), largest=_LARGEST_FILE
    )
    allowed = allowed_columns(joints)
    table = read_table(
        text,
        str(source),
        allowed,
        lambda header, where: understood(header, joints, where),
    )
    where = f"{source}: line {table.header_line}"
    columns = understood(table.header, joints, where)
    time = in_si(table, columns, "t", "", "s", units, where)
    bases = tuple(zip(joints, robot.position_units, strict=True))
    parts = [
        in_si(table, columns, "q", name, unit, units, where) for name, unit in bases
    ]
    t, q = time.values, np.column_stack([part.values for part in parts])

    def rates(kind: Kind) -> np.ndarray | None:
        if not any(column.kind == kind for column in columns.values()):
            return None
        return np.column_stack(
            [
                in_si(table, columns, kind, name, unit, units, where).values
                for name, unit in bases
            ]
        )

    _check_times(t, table, source)
    _check_angles(q, robot, units, source)
    told = [
        *table.notes,
        f"units: {', '.join(dict.fromkeys(part.unit for part in (time, *parts)))}",
    ]
    ignored = [name for i, name in enumerate(table.header) if i not in columns]
    told += [f"left out the columns {', '.join(ignored)}"] if ignored else []
    rounding = np.array([part.rounding for part in parts])
    read = Recording(
        t,
        q,
        rates("qdot"),
        rates("qddot"),
        rounding,
        robot.position_units,
        str(source),
        tuple(told),
    )
    return _trimmed(read)


def _check_times(t: np.ndarray, table: Table, source: Path) -> None:
    if len(t) < FEWEST:
        raise TaskError(
            "too few rows for a motion",
            found=len(t),
            allowed=f"{FEWEST} or more",
            where=str(source),
        )
    back = np.flatnonzero(np.diff(t) <= 0.0)
    if back.size:
        i = int(back[0]) + 1
        where = f"{source}: line {table.lines[i]}"
        raise TaskError(
            "times do not ascend", found=f"{t[i]:g} s after {t[i - 1]:g} s", where=where
        )


def _check_angles(q: np.ndarray, robot: Robot, units: Units, source: Path) -> None:
    """Refuse degrees that were taken for radians: no joint turns so often."""
    far = np.abs(q).max(axis=0) > np.maximum(_MANY_TURNS, 1.5 * _reach(robot))
    bad = np.flatnonzero(far & robot.revolute)
    if bad.size and units.angle is None:
        joint = int(bad[0])
        found = f"{np.abs(q[:, joint]).max():.4g} rad at {robot.joint_names[joint]}"
        hint = 'Degrees? Say so: units={"angle": "deg"}, or --angle deg; rad where it is meant so'
        raise TaskError(
            "an angle is hardly meant", found=found, where=str(source), hint=hint
        )


def _reach(robot: Robot) -> np.ndarray:
    """Return the farther end of every joint's range, (n,); 0 where it has none."""
    ends = np.maximum(
        np.abs(robot.limits.position_lower), np.abs(robot.limits.position_upper)
    )
    return np.asarray(np.where(np.isfinite(ends), ends, 0.0))


def _trimmed(recording: Recording) -> Recording:
    """Leave out rows in which nothing moves before the motion begins and after it has ended."""
    t, q = recording.t, recording.q
    first, last = (
        _beginning(t, q, recording),
        len(t) - 1 - _beginning(-t[::-1], q[::-1], recording),
    )
    if last - first + 1 < FEWEST:
        _refuse(f"the robot moves in fewer than {FEWEST} rows", recording)
    told = recording.told
    for rows, time, when in (
        (first, t[first] - t[0], "before"),
        (len(t) - 1 - last, t[-1] - t[last], "after"),
    ):
        if rows:
            many = f"{rows} row{'s' * (rows > 1)}"
            told = (
                *told,
                f"left out {time:.6g} s {when} the motion, in which the robot stands still ({many})",
            )
    kept = slice(first, last + 1)
    rates = {
        name: part[kept]
        for name in ("qdot", "qddot")
        if (part := getattr(recording, name)) is not None
    }
    return replace(recording, t=t[kept] - t[first], q=q[kept], **rates, told=told)


def _beginning(t: np.ndarray, q: np.ndarray, recording: Recording) -> int:
    """Return the row at which motion sets in.

    Where digits are few, a gentle motion has been going on for a while when the last digit shows it: it goes as the
    cube of time, and is so far after twice the time where it is eight times as large.
    """
    away = np.abs(q - q[0])
    shown = np.flatnonzero(
        (away > np.maximum(_STILL, _SHOWS * recording.rounding)).any(axis=1)
    )
    if not shown.size:
        _refuse("the robot does not move", recording)
    clear = np.flatnonzero(
        (away > np.maximum(_STILL, _CLEAR * recording.rounding)).any(axis=1)
    )
    lead = t[clear[0]] - t[shown[0]] if clear.size else 0.0
    return int(
        np.clip(
            np.searchsorted(t, t[shown[0]] - lead, side="right") - 1, 0, shown[0] - 1
        )
    )


def _refuse(problem: str, recording: Recording) -> NoReturn:
    raise TaskError(
        problem,
        found=write_count(len(recording.t), "row"),
        allowed="a motion",
        where=recording.source,
    )
