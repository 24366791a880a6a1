"""The parts of the motion of a program, and the motions of which it consists."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.robot import Robot, dynamics
from brachis.robot.task_map.choice import FREE
from brachis.trajectory.phases import PHASE_COLUMNS, MotionPhase, phase_rows

if TYPE_CHECKING:
    from brachis.trajectory.trajectory import Trajectory


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

    def __str__(self) -> str:
        """Return the name and the time."""
        return f"{self.name} at {self.time:.4f} s"


PART_COLUMNS = ("part", "kind", "time", "share")
"""Headings of the columns of `part_rows`."""


def part_rows(parts: Sequence[MotionPart]) -> list[tuple[str, ...]]:
    """Write parts as rows of a table, with units and with their shares of the time of the motion."""
    rows: list[tuple[str, ...]] = []
    for part in parts:
        time = f"{part.duration:.4f} s ({part.begin:.4f} to {part.end:.4f} s)"
        share = f"{100.0 * part.duration / parts[-1].end:.1f} %"
        rows.append((part.name, part.kind, time, share))
    return rows


def phase_table(
    motion: Trajectory,
) -> tuple[str, tuple[str, ...], list[tuple[str, ...]]]:
    """Return the title, the columns and the rows of the table of a motion's phases, or of the parts of a program."""
    if motion.parts:
        return "parts", PART_COLUMNS, part_rows(motion.parts)
    return "phases", PHASE_COLUMNS, phase_rows(motion.phases)


def split_times(
    motion: Trajectory, t: np.ndarray
) -> Iterator[tuple[Trajectory, np.ndarray, np.ndarray]]:
    """Yield the motions of which a motion consists, each with the indices of its times, (k,), and these from its start.

    An ordinary motion consists of itself. A time at which two motions meet belongs to the later one. While the arm
    waits after a motion, the time is that of its end.

    Parameters
    ----------
    motion : Trajectory
    t : (K,) ndarray
        Times, s.
    """
    components = motion.components or ((0.0, motion),)
    begins = [begin for begin, _ in components]
    numbers = np.searchsorted(begins[1:], t, side="right")
    for number, (begin, component) in enumerate(components):
        (rows,) = np.nonzero(numbers == number)
        yield component, rows, np.clip(t[rows] - begin, 0.0, component.t_end)


def torques_at(
    motion: Trajectory,
    t: np.ndarray,
    q: np.ndarray,
    qdot: np.ndarray,
    qddot: np.ndarray,
) -> np.ndarray:
    """Return the torques of joint states, (K, n), with the payloads that the robot has at times `t`, (K,)."""
    tau = np.empty_like(q)
    for component, rows, _ in split_times(motion, t):
        states = (q[rows], qdot[rows], qddot[rows])
        tau[rows] = torques_of(component.robot, *states)
    return tau


def torques_of(robot: Robot, *states: np.ndarray) -> np.ndarray:
    """Return the torques of q, qdot and qddot, (K, n), of a robot's first n joints; the others are virtual."""
    count = states[0].shape[1]
    virtual = ((0, 0), (0, robot.n - count))
    wider = (np.pad(values, virtual) for values in states)
    return dynamics.torque(robot, *wider)[:, :count]


def with_given_speeds(
    motion: Trajectory, phases: Sequence[MotionPhase]
) -> tuple[MotionPhase, ...]:
    """Return the phases of a motion with the speeds that are given in its components."""
    if not motion.components:
        return tuple(phases)
    middles = np.array([0.5 * (phase.begin + phase.end) for phase in phases])
    changed = list(phases)
    for component, rows, times in split_times(motion, middles):
        for number, time in zip(rows.tolist(), times.tolist(), strict=True):
            inner = next(phase for phase in component.phases if phase.end >= time)
            if not changed[number].is_dwell:
                speed = {"speed": inner.speed, "leads": inner.leads}
                changed[number] = replace(changed[number], **speed)
    return tuple(changed)


def change_robots(motion: Trajectory, change: Callable[[Robot], Robot]) -> Trajectory:
    """Return a motion with a change of its robot, and of the robot of each motion of which it consists."""
    components = tuple(
        (begin, change_robots(component, change))
        for begin, component in motion.components
    )
    return replace(motion, robot=change(motion.robot), components=components)


def name_redundancy(motion: Trajectory) -> str:
    """Name the redundant joints of the paths of a program."""
    names = dict.fromkeys(
        component.redundancy
        for _, component in motion.components
        if component.task.task_space != FREE
    )
    return "; ".join(names) or "none"


def summarise_program(motion: Trajectory) -> dict[str, str]:
    """Return the names of the parts, and the events, for the summary of a motion."""
    shown = {
        "parts": ", ".join(part.name for part in motion.parts),
        "events": ", ".join(map(str, motion.events)),
    }
    return {name: text for name, text in shown.items() if text}
