"""G-code: rapid and straight moves, arcs and feed rates (G0, G1, G2, G3, F) in any plane, absolute or incremental.

Moves are replaced by points on them, with arcs accurate to a micrometre. Codes that do not affect the path of the tool
tip (spindle, coolant, tool length, one work offset) are skipped and reported. Codes that would affect this path
(cycles, cutter compensation, rotary axes, subprograms, changes of the work offset) are refused, as are letters that may
change it. M2 and M30 end the program.
"""

from __future__ import annotations

import re
from cmath import phase
from dataclasses import dataclass, field
from itertools import compress
from math import acos, ceil, nan, pi, sqrt
from typing import Final

import numpy as np

from brachis.common.words import write_count
from brachis.errors import TaskError
from brachis.task.fields import POSITION
from brachis.task.points.points import Array, Points, Rows

SUFFIXES: Final = (".nc", ".ngc", ".gcode", ".tap")
_WORD = re.compile(
    r"((?<![0-9.])E|[A-DF-Z])\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?![0-9.]*E[0-9.+-])"
)
"""A letter and a number without exponent; an E directly after a number is not a word."""
_COMMENT = re.compile(r"\([^)]*\)|;.*$|%")
_MODES: Final = {
    **{f"G{number}": ("motion", f"G{number}") for number in range(4)},
    "G17": ("plane", [0, 1, 2]),
    "G18": ("plane", [2, 0, 1]),
    "G19": ("plane", [1, 2, 0]),
    "G90": ("absolute", True),
    "G91": ("absolute", False),
    "G90.1": ("absolute_centres", True),
    "G91.1": ("absolute_centres", False),
}
"""Settings made by codes. The setting of a plane contains the two axes of its arcs, then the axis along its normal."""
_UNITS: Final = {"G20": 0.0254, "G21": 1e-3}
_IGNORED: Final = {"G8", "G15", "G40", "G43", "G49", "G61", "G64", "G69", "G80", "G94"}
_OFFSET_CHANGES: Final = (
    "the work offset changes within the program, so the position of the tool is unknown"
)
_REFUSED: Final = {
    "G4": "a dwell cannot be read: split the file there and set dwell on the segment",
    "G7": "X would be a diameter; write radii (G8)",
    **dict.fromkeys(("G28", "G30"), "the reference position of the machine is unknown"),
    **dict.fromkeys(
        ("G73", "G76", *(f"G{number}" for number in range(81, 90))),
        "canned cycles cannot be read",
    ),
    **dict.fromkeys(("M97", "M98", "M99"), "subprograms cannot be read"),
}
"""Codes after which the position of the tool would be unknown to this reader, with the reason."""
_OFFSETS: Final = {"G54", "G55", "G56", "G57", "G58", "G59"}
_PIECES = 4
"""Minimum number of points on a move."""
_ROUND = 2e-3
"""Maximum difference of the radii at the start and end of an arc, as a fraction of the radius."""

_MOST_TURNS: Final = 1_000
"""Maximum number of turns of one arc. With a radius of 1 m the points of such an arc take 53 MB."""


@dataclass
class _Machine:
    """State after the words read so far; `at` is NaN for axes whose position has not been stated yet.

    `moves` contains the points on every move, (k, 3), with its speed and line.
    """

    source: str
    at: Array
    line: int = 0
    motion: str | None = None
    plane: list[int] = field(default_factory=lambda: [0, 1, 2])
    unit: float = 1e-3
    unit_stated: bool = False
    offset: str = "G54"
    ended: bool = False
    absolute: bool = True
    absolute_centres: bool = False
    feed: float = nan
    skipped: set[str] = field(default_factory=set)
    moves: list[tuple[Array, float, int]] = field(default_factory=list)

    def wrong(
        self, problem: str, found: str, allowed: str, hint: str | None = None
    ) -> TaskError:
        """Return the error for a mistake in the current line."""
        where = f"{self.source}: line {self.line}"
        return TaskError(problem, found=found, allowed=allowed, where=where, hint=hint)


def read_gcode(text: str, rows: Rows, source: str) -> Points:
    """Return the points of a program and notes on skipped codes.

    Parameters
    ----------
    text : str
        The program.
    rows : tuple of str or str
        Rows of the task space, or its name if it is a task space of poses; the program states the position.
    source : str
        The file, for messages.

    Raises
    ------
    TaskError
        The program contains unknown words or an invalid arc; the message names the line.
    """
    has_rows = isinstance(rows, tuple)
    names = tuple(row for row in rows if row != "axis") if has_rows else POSITION
    if not set(names) <= set(POSITION):
        raise TaskError(
            "G-code contains only positions",
            found=", ".join(names),
            allowed="x, y, z",
            where=source,
        )
    unknown = [nan if name in names else 0.0 for name in POSITION]
    machine = _Machine(source, np.array(unknown))
    for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        machine.line = number
        _obey(machine, _COMMENT.sub("", line.upper()).strip())
        if machine.ended:
            break
    counts = [len(places) for places, *_ in machine.moves]
    if sum(counts) < 2:
        missing = ", ".join(compress("XYZ", np.isnan(machine.at)))
        raise TaskError(
            "the program contains no motion",
            found=write_count(sum(counts), "point"),
            allowed="2 or more",
            where=source,
            hint=f"the program never states {missing}" if missing else None,
        )
    chosen = [POSITION.index(name) for name in names]
    moves, speeds, lines = zip(*machine.moves, strict=True)
    places = np.concatenate(moves)
    speed = np.repeat(speeds, counts)
    notes = ["G-code"]
    if not machine.unit_stated:
        notes.append(
            "lengths are read as millimetres, because the program contains neither G20 nor G21"
        )
    if machine.skipped:
        notes.append(f"skipped {', '.join(sorted(machine.skipped))}")
    return Points(
        places[:, chosen],
        places[:, :0],
        speed if np.any(np.isfinite(speed)) else None,
        np.repeat(lines, counts),
        source,
        notes=tuple(notes),
    )


def _obey(machine: _Machine, code: str) -> None:
    """Execute one line, from which comments have been removed."""
    values, codes = _read_words(machine, code)
    for mode in codes:
        _set_mode(machine, mode)
    if "F" in values:
        feed = values.pop("F")
        if not feed > 0.0:
            raise machine.wrong(
                "a feed rate must be positive", f"F{feed:g}", "more than 0"
            )
        machine.feed = feed * machine.unit / 60.0
    if not set("XYZIJKR") & set(values):
        machine.skipped |= set(values)
        return
    sets_place = "G92" in codes
    if sets_place and machine.moves:
        raise machine.wrong(_OFFSET_CHANGES, "G92", "G92 before the first move")
    motion = "G0" if sets_place else machine.motion
    _move(machine, motion, values, machine.absolute or sets_place)


def _read_words(machine: _Machine, code: str) -> tuple[dict[str, float], list[str]]:
    """Return the numbers of a line by letter, and its codes, such as G1 or M30."""
    unread = _WORD.sub("", code).strip()
    if unread:
        raise machine.wrong(
            "this is not understood",
            repr(unread[:40]),
            "G-code words, such as G1 X10 F600, without exponents; no / at the start of a line",
        )
    values: dict[str, float] = {}
    codes = []
    for letter, text in _WORD.findall(code):
        if letter in "GM":
            codes.append(f"{letter}{float(text):g}")
        elif letter in "ABCUVW":
            raise machine.wrong(
                "axes other than X, Y, Z cannot be read",
                letter + text,
                "X, Y, Z, I, J, K, R, F",
            )
        elif letter in values:
            raise machine.wrong(
                "a letter occurs twice in a line", letter + text, "once"
            )
        elif letter in "XYZIJKRFPLQ":
            values[letter] = float(text)
        elif letter != "N":
            machine.skipped.add(letter)
    return values, codes


def _set_mode(machine: _Machine, code: str) -> None:
    """Execute a preparatory function, such as G1, or a miscellaneous one, such as M30."""
    if code in _MODES:
        name, value = _MODES[code]
        setattr(machine, name, value)
    elif code in _UNITS:
        machine.unit = _UNITS[code]
        machine.unit_stated = True
    elif code in _REFUSED:
        raise machine.wrong(_REFUSED[code], code, "moves and arcs (G0 to G3)")
    elif code[0] == "M" or code in _IGNORED | _OFFSETS:
        if code in _OFFSETS:
            if machine.moves and machine.offset != code:
                raise machine.wrong(_OFFSET_CHANGES, code, "one work offset")
            machine.offset = code
        machine.ended |= code in {"M2", "M30"}
        machine.skipped.add(code)
    elif code != "G92":  # executed later, with the coordinates of its line
        raise machine.wrong(
            "this code cannot be read",
            code,
            "G0 to G3, G17 to G21, G40, G43, G49, G54 to G59, G61, G64, G80, G90 to G92, G94",
        )


def _move(
    machine: _Machine, motion: str | None, values: dict[str, float], absolute: bool
) -> None:
    """Move to the position that a line states.

    Raises
    ------
    TaskError
        There is no motion code, a letter might change the path in an unknown way, or the position is unknown.
    """
    if motion is None:
        raise machine.wrong(
            "coordinates before G0, G1, G2 or G3", "coordinates", "a motion code first"
        )
    understood = set("XYZ")
    if motion in {"G2", "G3"}:
        understood |= {"P", "R", *("IJK"[axis] for axis in machine.plane[:2])}
    for letter in sorted(set(values) - understood):
        raise machine.wrong(
            f"the letter {letter} of this {motion} cannot be read, but may change the path",
            f"{letter}{values[letter]:g}",
            ", ".join(sorted(understood)),
        )
    start = machine.at
    end = start.copy()
    for i, axis in enumerate("XYZ"):
        if axis in values:
            if not absolute and np.isnan(start[i]):
                raise machine.wrong(
                    f"{axis} is incremental (G91), but the position before this move is unknown",
                    f"{axis}{values[axis]:g}",
                    "an absolute position before G91",
                    "Begin with G90 G0 and the position of the tool; with relative: true any position is possible",
                )
            base = 0.0 if absolute else start[i]
            end[i] = base + values[axis] * machine.unit
    machine.at = end
    if np.isnan(end).any():
        return
    if np.isnan(start).any():
        places = end[None]
    elif motion in {"G0", "G1"}:
        length = float(np.linalg.norm(end - start))
        count = max(_PIECES, ceil(length / max(1e-3, length / 200.0))) if length else 0
        places = start + _shares(count) * (end - start)
    else:
        places = _arc(machine, start, end, values)
    speed = nan if motion == "G0" else machine.feed
    machine.moves.append((places, speed, machine.line))


def _shares(count: int) -> Array:
    """Return evenly spaced fractions of a move up to 1, (count, 1)."""
    return (np.arange(1, count + 1) / max(count, 1))[:, None]


def _arc(
    machine: _Machine, start: Array, end: Array, values: dict[str, float]
) -> Array:
    """Return points on an arc, (k, 3). Within the plane of the arc, points are computed as complex numbers."""
    *plane, normal = machine.plane
    begin = complex(*start[plane])
    finish = complex(*end[plane])
    if "R" in values:
        centre = _centre(machine, begin, finish, values["R"] * machine.unit)
    else:
        stated = complex(*(values.get("IJK"[axis], 0.0) for axis in plane))
        origin = 0.0 if machine.absolute_centres else begin
        centre = origin + stated * machine.unit
    radius = abs(begin - centre)
    at_end = abs(finish - centre)
    if not radius or abs(radius - at_end) > max(_ROUND * radius, 1e-5):
        raise machine.wrong(
            "invalid arc: its start and end are at different radii",
            f"radius {1e3 * radius:.6g} mm at its start and {1e3 * at_end:.6g} mm at its end",
            "one radius; I, J, K measured from the start",
        )
    turn = -2.0 * pi if machine.motion == "G2" else 2.0 * pi
    swept = (
        phase(finish - centre) - phase(begin - centre)
    ) % turn  # with the same sign as turn
    if min(abs(swept), abs(swept - turn)) < 1e-9:
        swept = turn
    turns = values.get("P", 1.0)
    if not 1.0 <= turns <= _MOST_TURNS or turns % 1.0:
        raise machine.wrong(
            "invalid number of turns of an arc",
            f"P{turns:g}",
            f"a whole number from 1 to {_MOST_TURNS}",
        )
    swept += (turns - 1.0) * turn
    count = max(_PIECES, ceil(abs(swept) / (2.0 * acos(max(1.0 - 1e-6 / radius, 0.5)))))
    shares = _shares(count)
    growth = 1.0 + (at_end / radius - 1.0) * shares
    points = centre + (begin - centre) * growth * np.exp(1j * swept * shares)
    places = np.empty((count, 3))
    places[:, plane] = np.hstack([points.real, points.imag])
    places[:, [normal]] = start[normal] + (end[normal] - start[normal]) * shares
    return places


def _centre(
    machine: _Machine, begin: complex, finish: complex, radius: float
) -> complex:
    """Return the centre of an arc of given radius; a negative radius means that the arc is longer than half a turn."""
    chord = finish - begin
    length = abs(chord)
    if not length or length > 2.0 * abs(radius) * (1.0 + _ROUND):
        raise machine.wrong(
            "invalid arc: no circle of this radius passes through both ends",
            f"R {1e3 * radius:.6g} mm for ends {1e3 * length:.6g} mm apart",
            "different ends, at most 2 R apart",
        )
    away = sqrt(max(radius**2 - length**2 / 4.0, 0.0))
    side = -1.0 if (machine.motion == "G2") != (radius < 0.0) else 1.0
    return (begin + finish) / 2.0 + side * away * 1j * chord / length
