"""The phases of a motion, their curves, and how the curves are joined into one spline.

A motion is a list of phases. A phase ends where the tool stops, where a wait is over, and where a given speed begins or
ends. In each phase, the curves are B-splines over the normalised time of this phase. The curves of all phases are
joined into one spline over the time of the whole motion, which has all their knots. Where phases meet, a knot occurs
degree + 1 times, so that the pieces on the two sides share no control point. At such a knot, the spline has the value
just after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brachis.common.arrays import bisect
from brachis.common.summary import Summary
from brachis.kernel import Spline


@dataclass(frozen=True, repr=False)
class PhaseSpline(Summary):
    """The curves of one phase.

    Attributes
    ----------
    t_end : float
        Duration of the phase, s.
    knots : (N + 2 d + 1,) ndarray
        Clamped knots in normalised time from 0 to 1.
    degree : int
        Degree d of the splines.
    control_points : (1 + r, N + d) ndarray
        Control points of s, then of each redundant joint in chain order or of the coordinates sigma of the chart.
    """

    t_end: float
    knots: np.ndarray
    degree: int
    control_points: np.ndarray

    def at(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the values of the curves and their first three time derivatives, (K, c) each, at times t, (K,), s.

        At a knot, the values just after it are returned.
        """
        t_norm = np.clip(t / self.t_end, 0.0, 1.0)
        return tuple(
            self._spline(t_norm, order) / self.t_end**order for order in range(4)
        )

    @cached_property
    def _spline(self) -> Spline:
        """The curves over normalised time."""
        return Spline(self.knots, self.control_points.T, self.degree)

    def times_of(self, s: np.ndarray) -> np.ndarray:
        """Return the times, (P,), s, at which path coordinates s, (P,), are reached; s(t) does not decrease."""
        end = np.full(len(s), self.t_end)
        return bisect(lambda t: self.at(t)[0][:, 0] < s, end)

    def wait(self, duration: float) -> PhaseSpline:
        """Return constant curves that stay at the end of this phase for a duration, s."""
        knots = np.repeat([0.0, 1.0], self.degree + 1)
        points = np.repeat(self.control_points[:, -1:], self.degree + 1, axis=1)
        return PhaseSpline(duration, knots, self.degree, points)


@dataclass(frozen=True)
class MotionPhase:
    """A phase of a motion: its times, its part of the path, and the given speed, if any.

    Attributes
    ----------
    begin, end : float
        Times at which the phase begins and ends, s.
    s_begin, s_end : float
        Path coordinates at these times.
    speed : float or None
        Given speed of the tool, m/s. None means as fast as the limits allow.
    is_dwell : bool
        Whether the arm waits at rest.
    leads : float
        Length of the leads, in which the tool reaches and leaves the given speed, m. The leads belong to the adjacent
        phases.
    """

    begin: float
    end: float
    s_begin: float
    s_end: float
    speed: float | None
    is_dwell: bool
    leads: float = 0.0

    @property
    def duration(self) -> float:
        """Duration of the phase, s."""
        return self.end - self.begin

    @property
    def kind(self) -> str:
        """Kind of the phase: ``dwell``, ``given speed`` or ``move``."""
        if self.is_dwell:
            return "dwell"
        return "move" if self.speed is None else "given speed"

    def to_dict(self) -> dict[str, object]:
        """Return the phase as plain data for JSON, with times in s and the speed in m/s."""
        return {
            "kind": self.kind,
            "begin": self.begin,
            "end": self.end,
            "s": [self.s_begin, self.s_end],
            "speed": self.speed,
        }


PHASE_COLUMNS = ("phase", "s", "time", "speed")
"""Headings of the columns of `phase_rows`."""


def phase_rows(phases: Sequence[MotionPhase]) -> list[tuple[str, ...]]:
    """Write phases as rows of a table, with units."""
    speeds = {"dwell": "at rest", "move": "as fast as the limits allow"}
    rows: list[tuple[str, ...]] = []
    for number, phase in enumerate(phases, start=1):
        s = _write_s(phase.s_begin)
        if not phase.is_dwell:
            s += f" to {_write_s(phase.s_end)}"
        time = f"{phase.duration:.4f} s ({phase.begin:.4f} to {phase.end:.4f} s)"
        speed = speeds.get(phase.kind, f"{phase.speed} m/s")
        if phase.leads:
            held = 1e3 * phase.duration * (phase.speed or 0.0)
            speed += f" on {held:.4g} of {held + 1e3 * phase.leads:.4g} mm (on all with run-in and run-out lines)"
        rows.append((f"{number} {phase.kind}", s, time, speed))
    return rows


def _write_s(s: float) -> str:
    """Write a path coordinate; a rounding error around zero is written as 0."""
    return f"{round(s, 12):.4g}"


def join_splines(splines: Sequence[PhaseSpline]) -> tuple[np.ndarray, np.ndarray]:
    """Join the curves of phases into one spline over the normalised time of the whole motion.

    Returns
    -------
    knots : ndarray
        Knots from 0 to 1. Where phases meet, the knot occurs degree + 1 times.
    control_points : (1 + r, ...) ndarray
    """
    ends = np.cumsum([spline.t_end for spline in splines])
    begins = np.append(0.0, ends[:-1])
    outer = splines[0].degree + 1
    knots = []
    for spline, begin, end in zip(splines, begins, ends, strict=True):
        phase_knots = (begin + spline.knots * spline.t_end) / ends[-1]
        phase_knots[-outer:] = end / ends[-1]
        knots.append(phase_knots if begin == 0.0 else phase_knots[outer:])
    points = np.hstack([spline.control_points for spline in splines])
    return np.concatenate(knots), points


def find_phase_knots(knots: np.ndarray, degree: int) -> np.ndarray:
    """Find the index, (P + 1,), of the first knot in each group of degree + 1 equal knots in a joined knot vector."""
    same = knots[degree:] == knots[: len(knots) - degree]
    return np.flatnonzero(same)
