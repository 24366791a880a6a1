"""A joint trajectory that was made elsewhere, as it stands in its file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from brachis.arrays import freeze
from brachis.cam.table import Table, read_table
from brachis.errors import TaskError
from brachis.recording.columns import Units, allowed_columns, in_si, understood
from brachis.robot import Robot
from brachis.task.text_file import read_text

FEWEST = 5
"""Rows; a polynomial through so many gives the derivatives."""
_LARGEST_FILE = 64_000_000
_STILL = 1e-12
"""rad or m: what moves less between rows with all digits stands still."""
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
    qdot : (K, n) ndarray or None
        Where the file says it; rad/s or m/s.
    rounding : float
        Half of the last digit of the positions, rad or m, where the file has few digits; else 0.
    source : str
        The file.
    told : tuple of str
        What was found out about it.
    """

    t: np.ndarray
    q: np.ndarray
    qdot: np.ndarray | None
    rounding: float
    source: str
    told: tuple[str, ...]

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, "t", "q", *(["qdot"] if self.qdot is not None else []))


def read_recording(path: str | os.PathLike[str], robot: Robot, units: Units) -> Recording:
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
    text = read_text(source, where=str(source), folder=Path.cwd(), largest=_LARGEST_FILE)
    allowed = allowed_columns(joints)
    table = read_table(text, str(source), allowed, lambda header, where: understood(header, joints, where))
    where = f"{source}: line {table.header_line}"
    columns = understood(table.header, joints, where)
    time = in_si(table, columns, "t", "", "s", units, where)
    bases = tuple(zip(joints, robot.position_units, strict=True))
    parts = [in_si(table, columns, "q", name, unit, units, where) for name, unit in bases]
    t, q, qdot = time.values, np.column_stack([part.values for part in parts]), None
    if any(column.kind == "qdot" for column in columns.values()):
        rates = (in_si(table, columns, "qdot", name, unit, units, where) for name, unit in bases)
        qdot = np.column_stack([part.values for part in rates])
    _check_times(t, table, source)
    _check_angles(q, robot, units, source)
    told = [*table.told, f"units: {', '.join(dict.fromkeys(part.unit for part in (time, *parts)))}"]
    ignored = [name for i, name in enumerate(table.header) if i not in columns]
    told += [f"left out the columns {', '.join(ignored)}"] if ignored else []
    rounding = max(part.rounding for part in parts)
    return _trimmed(Recording(t, q, qdot, rounding, str(source), tuple(told)))


def _check_times(t: np.ndarray, table: Table, source: Path) -> None:
    if len(t) < FEWEST:
        raise TaskError("too few rows for a motion", found=len(t), allowed=f"{FEWEST} or more", where=str(source))
    back = np.flatnonzero(np.diff(t) <= 0.0)
    if back.size:
        i = int(back[0]) + 1
        where = f"{source}: line {table.lines[i]}"
        raise TaskError("times do not ascend", found=f"{t[i]:g} s after {t[i - 1]:g} s", where=where)


def _check_angles(q: np.ndarray, robot: Robot, units: Units, source: Path) -> None:
    """Refuse degrees that were taken for radians: no joint turns so often."""
    far = np.abs(q).max(axis=0) > np.maximum(_MANY_TURNS, 1.5 * _reach(robot))
    bad = np.flatnonzero(far & robot.revolute)
    if bad.size and units.angle is None:
        joint = int(bad[0])
        found = f"{np.abs(q[:, joint]).max():.4g} rad at {robot.joint_names[joint]}"
        hint = "Degrees? Ask for units of the angle, deg; rad where it is meant so"
        raise TaskError("an angle is hardly meant", found=found, where=str(source), hint=hint)


def _reach(robot: Robot) -> np.ndarray:
    """Return the farther end of every joint's range, (n,); 0 where it has none."""
    ends = np.maximum(np.abs(robot.limits.position_lower), np.abs(robot.limits.position_upper))
    return np.asarray(np.where(np.isfinite(ends), ends, 0.0))


def _trimmed(recording: Recording) -> Recording:
    """Leave out rows in which nothing moves before the motion begins and after it has ended."""
    t, q = recording.t, recording.q
    still = max(_STILL, 2.2 * recording.rounding)  # the last digit may flicker
    moving = np.flatnonzero(np.abs(q - q[0]).max(axis=1) > still)
    if not moving.size:
        _refuse("the robot does not move", recording)
    first = int(moving[0]) - 1
    last = int(np.flatnonzero(np.abs(q - q[-1]).max(axis=1) > still)[-1]) + 1
    if last - first + 1 < FEWEST:
        _refuse(f"the robot moves in fewer than {FEWEST} rows", recording)
    told = recording.told
    for rows, time, when in ((first, t[first] - t[0], "before"), (len(t) - 1 - last, t[-1] - t[last], "after")):
        if rows:
            many = f"{rows} row{'s' * (rows > 1)}"
            told = (*told, f"left out {time:.6g} s {when} the motion, in which the robot stands still ({many})")
    kept = slice(first, last + 1)
    qdot = None if recording.qdot is None else recording.qdot[kept]
    return Recording(t[kept] - t[first], q[kept], qdot, recording.rounding, recording.source, told)


def _refuse(problem: str, recording: Recording) -> NoReturn:
    raise TaskError(problem, found=f"{len(recording.t)} rows", allowed="a motion", where=recording.source)
