"""The parts of the motion of a program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


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
    """

    name: str
    kind: str
    begin: float
    end: float

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
