"""The parts and events of the motion of a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.robot import Robot, dynamics
from brachis.robot.plausibility import Issue


@dataclass(frozen=True)
class MotionPart:
    """A part of a program, as it is executed.

    Attributes
    ----------
    name : str
    kind : str
        ``path``, ``move``, ``approach``, ``retract`` or ``dwell``.
    begin, end : float
        Times, s.
    travel : str
        How the planner chose to travel a path, if not as it is written: where it begins, and whether it is reversed.
    """

    name: str
    kind: str
    begin: float
    end: float
    travel: str = ""

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.end - self.begin

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**vars(self), "duration": self.duration}


@dataclass(frozen=True)
class Event:
    """An event of a program, such as the start of an arc.

    Attributes
    ----------
    name : str
    time : float
        Time from the beginning of the motion, s.
    """

    name: str
    time: float

    def __str__(self) -> str:
        """Return the name and the time."""
        return f"{self.name} at {self.time:.4f} s"


def check_times(events: Sequence[Event], t_end: float) -> tuple[Issue, ...]:
    """Find events before or after a motion that takes `t_end`, s: their leads are longer than what is around them."""
    message = "the event is not during the motion"
    usual = (
        f"0 to {t_end:.4f} s; change its lead, or add a move before or a dwell after it"
    )
    return tuple(
        Issue(f"events.{event.name}", message, f"{event.time:.4f} s", usual)
        for event in events
        if not 0.0 <= round(event.time, 9) <= round(t_end, 9)
    )


PART_COLUMNS = ("part", "kind", "time", "share")
"""Headings of the columns of `part_rows`."""


def part_rows(parts: Sequence[MotionPart]) -> list[tuple[str, ...]]:
    """Write parts as rows of a table, with units and with their shares of the time of the motion."""
    rows: list[tuple[str, ...]] = []
    for part in parts:
        time = f"{part.duration:.4f} s ({part.begin:.4f} to {part.end:.4f} s)"
        share = f"{100.0 * part.duration / parts[-1].end:.1f} %"
        kind = ", ".join(filter(None, (part.kind, part.travel)))
        rows.append((part.name, kind, time, share))
    return rows


def torques_of(robot: Robot, *states: np.ndarray) -> np.ndarray:
    """Return the torques of q, qdot and qddot, (K, n), of a robot's first n joints; the others are virtual."""
    count = states[0].shape[1]
    virtual = ((0, 0), (0, robot.n - count))
    wider = (np.pad(values, virtual) for values in states)
    return dynamics.torque(robot, *wider)[:, :count]


def summarise_program(
    parts: Sequence[MotionPart], events: Sequence[Event]
) -> dict[str, str]:
    """Return the names of the parts, and the events, for the summary of a motion."""
    shown = {
        "parts": ", ".join(
            f"{part.name} ({part.travel})" if part.travel else part.name
            for part in parts
        ),
        "events": ", ".join(map(str, events)),
    }
    return {name: text for name, text in shown.items() if text}
