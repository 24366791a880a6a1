"""G-code: rapid and straight moves, arcs, feed rates (G0, G1, G2, G3, F), in any plane, absolute or incremental.

Moves become points on them: lines are straight between their ends, arcs are met within a micrometre. What does not say
where the tool goes (spindle, coolant, one work offset) is skipped and told; what would (cycles, cutter compensation,
rotary axes, subprograms, a change of the work offset) is refused. M2 and M30 end the program.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from math import acos, atan2, ceil, cos, hypot, pi, sin, sqrt
from typing import Final

import numpy as np

from brachis.errors import TaskError, write_count
from brachis.task.points.points import Points
from brachis.task.points.tables import POSITION

SUFFIXES: Final = (".nc", ".ngc", ".gcode", ".tap")
_WORD = re.compile(r"([A-Z])\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))")
_COMMENT = re.compile(r"\([^)]*\)|;.*$|%")
_MOTIONS: Final = {"0", "1", "2", "3"}
_PLANES: Final = {"17": (0, 1, 2), "18": (2, 0, 1), "19": (1, 2, 0)}
"""Of an arc, the axes of its plane, then the one along its normal."""
_UNITS: Final = {"20": 0.0254, "21": 1e-3}
_IGNORED: Final = {"40", "49", "61", "64", "80", "91.1", "94"}
_OFFSETS: Final = {"54", "55", "56", "57", "58", "59"}
_ENDS: Final = {"2", "30"}
_CALLS: Final = {"97", "98", "99"}
_PIECES = 4
_ROUND = 2e-3
"""How much the radii of an arc at its start and end may differ, as a fraction of it."""


@dataclass
class _Machine:
    """What the words so far have set."""

    motion: str | None = None
    plane: tuple[int, int, int] = _PLANES["17"]
    unit: float = 1e-3
    unit_stated: bool = False
    offset: str = "54"
    ended: bool = False
    absolute: bool = True
    feed: float = float("nan")
    at: list[float | None] = field(default_factory=lambda: [None, None, None])
    skipped: set[str] = field(default_factory=set)
    points: list[tuple[float, float, float]] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def read_gcode(
    text: str, rows: tuple[str, ...] | str, source: str
) -> tuple[Points, tuple[str, ...]]:
    """Return the points of a program, and what was skipped.

    Parameters
    ----------
    text : str
        The program.
    rows : tuple of str or str
        Rows of the task space, or the word for one of poses, whose position the program gives.
    source : str
        The file, for messages.

    Raises
    ------
    TaskError
        The program has words that are not understood, or an invalid arc; the message names the line.
    """
    names = POSITION if isinstance(rows, str) else rows
    if not set(names) <= set(POSITION):
        raise TaskError(
            "G-code gives positions alone",
            found=", ".join(names),
            allowed="x, y, z",
            where=source,
        )
    machine = _Machine(at=[None if name in names else 0.0 for name in POSITION])
    for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        code = _COMMENT.sub("", line.upper()).strip()
        if code:
            _block(machine, code, f"{source}: line {number}", number)
        if machine.ended:
            break
    if len(machine.points) < 2:
        never = [
            name.upper()
            for name, place in zip(POSITION, machine.at, strict=True)
            if place is None
        ]
        raise TaskError(
            "no motion",
            found=write_count(len(machine.points), "place"),
            allowed="2 or more",
            where=source,
            hint=f"{', '.join(never)} is never stated" if never else None,
        )
    chosen = [POSITION.index(name) for name in names]
    speed = np.array(machine.speeds)
    points = Points(
        np.array(machine.points)[:, chosen],
        np.empty((len(speed), 0)),
        speed if np.any(np.isfinite(speed)) else None,
        np.array(machine.lines),
        source,
    )
    told = (f"skipped {', '.join(sorted(machine.skipped))}",) if machine.skipped else ()
    unit = (
        ()
        if machine.unit_stated
        else ("millimetres, as neither G20 nor G21 says otherwise",)
    )
    return points, ("G-code", *unit, *told)


def _block(machine: _Machine, code: str, where: str, number: int) -> None:
    """Obey one line."""
    words = _WORD.findall(code)
    rest = _WORD.sub("", code).strip()
    if rest:
        raise TaskError(
            "not understood",
            found=repr(rest[:40]),
            allowed="G-code words, such as G1 X10 F600",
            where=where,
        )
    values: dict[str, float] = {}
    for letter, text in words:
        if letter == "G":
            _mode(machine, _plain(text), where)
        elif letter in "XYZIJKRF":
            values[letter] = float(text)
        elif letter in "ABCUVW":
            raise TaskError(
                "axes other than X, Y, Z are not read",
                found=letter + text,
                allowed="X, Y, Z, I, J, K, R, F",
                where=where,
            )
        elif letter == "M":
            _miscellaneous(machine, _plain(text), where)
        elif letter != "N":
            machine.skipped.add(letter)
    if "F" in values:
        _feed(machine, values["F"], where)
    if any(axis in values for axis in "XYZIJKR"):
        _move(machine, values, where, number)


def _plain(text: str) -> str:
    """Write a code without needless zeros."""
    return f"{float(text):g}"


def _feed(machine: _Machine, value: float, where: str) -> None:
    machine.feed = value * machine.unit / 60.0
    if not machine.feed > 0.0:
        raise TaskError(
            "a feed rate must be positive",
            found=f"F{value:g}",
            allowed="more than 0",
            where=where,
        )


def _miscellaneous(machine: _Machine, code: str, where: str) -> None:
    if code in _CALLS:
        raise TaskError(
            "subprograms are not read",
            found=f"M{code}",
            allowed="a program without calls",
            where=where,
        )
    machine.ended = code in _ENDS
    machine.skipped.add(f"M{code}")


def _mode(machine: _Machine, code: str, where: str) -> None:
    if code in _MOTIONS:
        machine.motion = code
    elif code in _PLANES:
        machine.plane = _PLANES[code]
    elif code in _UNITS:
        machine.unit = _UNITS[code]
        machine.unit_stated = True
    elif code in {"90", "91"}:
        machine.absolute = code == "90"
    elif code in _OFFSETS:
        if machine.points and machine.offset != code:
            raise TaskError(
                "the work offset changes within the program: where the tool goes is not known",
                found=f"G{code}",
                allowed="one work offset",
                where=where,
            )
        machine.offset = code
        machine.skipped.add(f"G{code}")
    elif code in _IGNORED:
        machine.skipped.add(f"G{code}")
    else:
        raise TaskError(
            "this code is not read",
            found=f"G{code}",
            allowed="G0 to G3, G17 to G21, G40, G49, G54 to G59, G61, G64, G80, G90, G91, G94",
            where=where,
        )


def _move(machine: _Machine, values: dict[str, float], where: str, number: int) -> None:
    """Go on to the place that a line names."""
    start = machine.at
    end = list(machine.at)
    for i, axis in enumerate("XYZ"):
        if axis in values:
            base = 0.0 if machine.absolute else start[i] or 0.0
            end[i] = base + values[axis] * machine.unit
    if machine.motion is None:
        raise TaskError(
            "a move before G0, G1, G2 or G3",
            found="coordinates",
            allowed="a motion first",
            where=where,
        )
    machine.at = end
    if None in end:
        return
    speed = float("nan") if machine.motion == "0" else machine.feed
    if None in start:
        places = [end]
    elif machine.motion in {"0", "1"}:
        places = _line(start, end)
    else:
        places = _arc(machine, start, end, values, where)
    for x, y, z in places:
        machine.points.append((x, y, z))  # type: ignore[arg-type]
        machine.speeds.append(speed)
        machine.lines.append(number)


def _line(
    start: list[float | None], end: list[float | None]
) -> list[list[float | None]]:
    one = np.array(start, dtype=float)
    other = np.array(end, dtype=float)
    length = float(np.linalg.norm(other - one))
    count = max(_PIECES, ceil(length / max(1e-3, length / 200.0))) if length else 0
    return [list(one + (other - one) * (k / count)) for k in range(1, count + 1)]


def _arc(
    machine: _Machine,
    start: list[float | None],
    end: list[float | None],
    values: dict[str, float],
    where: str,
) -> list[list[float | None]]:
    one = np.array(start, dtype=float)
    other = np.array(end, dtype=float)
    a, b, c = machine.plane
    clockwise = machine.motion == "2"
    if "R" in values:
        centre = _centre(
            one[[a, b]],
            other[[a, b]],
            values["R"] * machine.unit,
            clockwise=clockwise,
            where=where,
        )
    else:
        offsets = [values.get("IJK"[axis], 0.0) * machine.unit for axis in (a, b)]
        centre = one[[a, b]] + offsets
    radius = hypot(*(one[[a, b]] - centre))
    at_end = hypot(*(other[[a, b]] - centre))
    if not radius or abs(radius - at_end) > max(_ROUND * radius, 1e-5):
        raise TaskError(
            "invalid arc: its start and end are at different radii",
            found=f"radius {1e3 * radius:.6g} mm at its start and {1e3 * at_end:.6g} mm at its end",
            allowed="one radius; I, J, K from the start",
            where=where,
        )
    first = atan2(one[b] - centre[1], one[a] - centre[0])
    swept = (atan2(other[b] - centre[1], other[a] - centre[0]) - first) % (2.0 * pi)
    if clockwise:
        swept -= 2.0 * pi
    if abs(abs(swept) - 2.0 * pi) < 1e-9 or abs(swept) < 1e-9:
        swept = -2.0 * pi if clockwise else 2.0 * pi
    count = max(_PIECES, ceil(abs(swept) / (2.0 * acos(max(1.0 - 1e-6 / radius, 0.5)))))
    places = []
    for k in range(1, count + 1):
        share = k / count
        place = other.copy()
        place[a] = centre[0] + (radius + (at_end - radius) * share) * cos(
            first + swept * share
        )
        place[b] = centre[1] + (radius + (at_end - radius) * share) * sin(
            first + swept * share
        )
        place[c] = one[c] + (other[c] - one[c]) * share
        places.append(list(place))
    return places


def _centre(
    one: np.ndarray, other: np.ndarray, radius: float, *, clockwise: bool, where: str
) -> np.ndarray:
    """Return the centre, (2,), of an arc of given radius; a negative one is that of more than half a turn."""
    chord = other - one
    length = hypot(*chord)
    if not length or length > 2.0 * abs(radius) * (1.0 + _ROUND):
        raise TaskError(
            "invalid arc: no circle of this radius passes both ends",
            found=f"R {1e3 * radius:.6g} mm for ends {1e3 * length:.6g} mm apart",
            allowed="ends at most 2 R apart, and not the same",
            where=where,
        )
    away = sqrt(max(radius**2 - length**2 / 4.0, 0.0))
    left = np.array([-chord[1], chord[0]]) / length
    side = -1.0 if clockwise != (radius < 0.0) else 1.0
    return np.asarray((one + other) / 2.0 + side * away * left)
