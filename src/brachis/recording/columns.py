"""What the columns of a recorded motion are: ``t``, ``time_ms``, ``j1``, ``q_j1``, ``j1_pos [deg]``, ``qd_j1``, ..."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from brachis.cam.table import Table
from brachis.cam.units import ANGLES, LENGTHS
from brachis.errors import TaskError

TIMES: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_TIME = ("t", "time", "timestamp")
_POSITION = ("{}", "q_{}", "pos_{}", "position_{}", "{}_pos", "{}_position")
_VELOCITY = ("qd_{}", "dq_{}", "v_{}", "vel_{}", "velocity_{}", "{}_vel", "{}_velocity")
_ACCELERATION = ("qdd_{}", "ddq_{}", "a_{}", "acc_{}", "acceleration_{}", "{}_acc", "{}_acceleration")
_UNITS = "|".join({**TIMES, **ANGLES, **LENGTHS})
_STATED = re.compile(rf"^(.+?)\s*(?:[\[(]\s*([a-z0-9/^]+)\s*[\])]|_((?:{_UNITS})(?:(?:/|_|_per_)s(?:\^?2)?)?))$")
_DIGITS = 12
_LISTED = 8

Kind = Literal["t", "q", "qdot", "qddot"]
_WORDS: Final = {"t": "time", "q": "position", "qdot": "velocity", "qddot": "acceleration"}
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
                raise TaskError(f"unknown unit of {name}", found=unit, allowed=", ".join(known), where=f"units.{name}")


@dataclass(frozen=True)
class _Column:
    """A column that is understood: what it is, of which joint, and the unit that the header states."""

    kind: Kind
    joint: str
    unit: str | None


def allowed_columns(joints: Sequence[str]) -> str:
    """Say which columns a file has, for messages."""
    first = joints[0]
    return (
        f"t, then {', '.join(joints)} (or q_{first}, ...), and qd_{first}, ..., qdd_{first}, ... where rates are known"
    )


def understood(header: Sequence[str], joints: Sequence[str], where: str) -> dict[int, _Column]:
    """Return what the columns are, by their index; those of other quantities are left out.

    Raises
    ------
    TaskError
        Time or a joint's position is missing or stands there twice, or only some joints have velocities or
        accelerations.
    """
    known: dict[str, tuple[Kind, str]] = dict.fromkeys(_TIME, ("t", ""))
    for joint in joints:
        known |= {form.format(joint.lower()): ("qddot", joint) for form in _ACCELERATION}
        known |= {form.format(joint.lower()): ("qdot", joint) for form in _VELOCITY}
        known |= {form.format(joint.lower()): ("q", joint) for form in _POSITION}
    found: dict[int, _Column] = {}
    for i, text in enumerate(header):
        name, unit = text.strip().lower(), None
        match = None if name in known else _STATED.match(name)
        if match is not None:
            name, unit = match[1], (match[2] or match[3]).replace("_per_", "/").replace("_", "/").replace("s2", "s^2")
        if name in known:
            found[i] = _Column(*known[name], unit)
    listed = [(column.kind, column.joint) for column in found.values()]
    wanted: list[tuple[Kind, str]] = [("t", ""), *(("q", joint) for joint in joints)]
    rates: tuple[Kind, ...] = ("qdot", "qddot")
    wanted += [(kind, joint) for kind in rates if any(kind == one for one, _ in listed) for joint in joints]
    for kind, joint in wanted:
        if listed.count((kind, joint)) != 1:
            what = f"the {_WORDS[kind]} of {joint!r}" if joint else "the time"
            problem = f"{what} {'is missing' if (kind, joint) not in listed else 'stands there twice'}"
            names = ", ".join(header[:_LISTED]) + (", ..." if len(header) > _LISTED else "")
            raise TaskError(problem, found=names, allowed=allowed_columns(joints), where=where)
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
    table: Table, columns: dict[int, _Column], kind: Kind, joint: str, base: str, units: Units, where: str
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
    i = next(i for i, column in columns.items() if (column.kind, column.joint) == (kind, joint))
    factors, asked = {"s": (TIMES, units.time), "rad": (ANGLES, units.angle), "m": (LENGTHS, units.length)}[base]
    per = _PER[kind]
    stated, values = columns[i].unit, table.values[:, i]
    unit = (asked or base) if stated is None else stated.removesuffix(per)
    if unit not in factors or (stated is not None and not stated.endswith(per)):
        allowed = ", ".join(f"{name}{per}" for name in factors)
        raise TaskError(f"unknown unit of column {table.header[i]}", found=stated, allowed=allowed, where=where)
    if asked is not None and factors[asked] != factors[unit]:
        problem = "the header contradicts the units asked for"
        raise TaskError(problem, found=f"{unit} for {table.header[i]}", allowed=asked, where=where)
    decimals = next((d for d in range(_DIGITS) if np.array_equal(np.round(values, d), values)), None)
    rounding = 0.0 if decimals is None or not np.ptp(values) else 0.5 * 10.0**-decimals * factors[unit]
    return Quantity(values * factors[unit], f"{unit}{per}", rounding)
