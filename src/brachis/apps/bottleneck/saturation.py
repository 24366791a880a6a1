"""Ratios of a motion to its limits over time, and when each limit is active."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import freeze, spread
from brachis.common.summary import Summary
from brachis.explain.sensitivities import label_of_speed
from brachis.explain.task_figures import PROCESS_SPEED_KEY
from brachis.limits import Label, Limit, Moments, limits_of
from brachis.limits.tool import PROCESS_SPEED
from brachis.optimise.program import Program, is_safeguard
from brachis.robot.custom_limits import LimitModel
from brachis.trajectory import MotionPart, MotionPhase, Samples, Trajectory

if TYPE_CHECKING:
    from brachis.search.planned import PlannedMotion


@dataclass(frozen=True, eq=False, repr=False)
class LimitRatios(Summary):
    """Ratios of a motion to all limits of its task and to its process speeds. The arrays are read-only.

    Attributes
    ----------
    t : (K,) ndarray
        Times, ascending, s. Where a derivative that a limit needs jumps, the time occurs twice, for just before and
        just after the jump.
    labels : tuple of Label
        Labels of the columns of `values`.
    values : (K, c) ndarray
        Ratios: 1 at the upper limit and -1 at the lower limit. For a position, the ratio is 0 in the middle of the
        range. For a range with only one end, the ratio is 1 minus the distance from this end, rad or m, but at least 0.
        For a process speed, the ratio is 1 while the tool has this speed, and 0 otherwise. NaN in parts of a program
        that do not have the limit.
    """

    t: np.ndarray
    labels: tuple[Label, ...]
    values: np.ndarray

    def __post_init__(self) -> None:
        """Make the arrays read-only copies."""
        freeze(self, "t", "values")


def knot_times(trajectory: Trajectory) -> np.ndarray:
    """Return the times of the splines' knots from 0 to t_end, (N + 1,), s."""
    return np.unique(trajectory.knots) * trajectory.t_end


_MOST_TIMES = 6000
"""Approximate number of times at which a motion is evaluated. A scene of 120 pairs takes 0.05 s per 1000 times."""
_FEWEST_TIMES = 4
"""Minimum number of times in each knot interval."""


def dense_samples(trajectory: Trajectory) -> Samples:
    """Evaluate the trajectory at its knots, at its nodes and at some times in every knot interval."""
    return trajectory.at(_dense_times(trajectory, 16))


def _dense_times(trajectory: Trajectory, per_interval: int) -> np.ndarray:
    """Return the times of knots and nodes, and up to `per_interval` times in every knot interval, s."""
    knots = knot_times(trajectory)
    per_interval = min(per_interval, max(_FEWEST_TIMES, _MOST_TIMES // len(knots)))
    grid = spread(knots, per_interval)
    return np.union1d(grid, trajectory.times)


def limits_in(program: Program) -> list[Limit]:
    """List the limits of a program without its safeguards."""
    return [limit for limit in program.limits if not is_safeguard(limit)]


def limits_by_component(
    motion: Trajectory | PlannedMotion, own_limits: Sequence[LimitModel] = ()
) -> list[Sequence[Limit]]:
    """List the limits of each motion of which the motion of a program consists."""
    if not isinstance(motion, Trajectory):
        return [part.limits for part in motion.candidate.problem.parts]
    return [
        limits_of(component.robot, component.task, own_limits)
        for _, component in motion.components
    ]


def limit_ratios(
    trajectory: Trajectory,
    limits: Sequence[Limit] | None = None,
    *,
    by_component: Sequence[Sequence[Limit]] | None = None,
) -> LimitRatios:
    """Compute the ratios of a trajectory to every limit at its nodes, at its knots and densely between them.

    Parameters
    ----------
    trajectory : Trajectory
    limits : sequence of Limit, optional
        Limits to compare with. Default: the limits of the trajectory's task.
    by_component : sequence of sequence of Limit, optional
        For a program, the limits to compare with in each of its motions (`limits_by_component`).

    Returns
    -------
    LimitRatios
    """
    if trajectory.components:
        by_component = by_component or limits_by_component(trajectory)
        limits = [limit for same in by_component for limit in same]
    elif limits is None:
        limits = limits_of(trajectory.robot, trajectory.task)
    by_component = by_component or [limits]
    nodes = trajectory.times[1:]
    jumps = np.any(trajectory.qddot_before != trajectory.qddot, axis=1)[1:]
    if trajectory.degree <= max((limit.order for limit in limits), default=0):
        gaps = np.abs(nodes[:-1, None] - knot_times(trajectory)).min(axis=1)
        jumps[:-1] |= gaps <= tolerances.TIME * trajectory.t_end
    t = np.concatenate([nodes[jumps], _dense_times(trajectory, 40)])
    order = np.argsort(t, kind="stable")
    is_before_jump = order < np.count_nonzero(jumps)
    t = t[order]
    qddot = trajectory.acceleration(t)
    qddot[is_before_jump] = trajectory.qddot_before[1:][jumps]
    jerk = trajectory.jerk(t)
    jerk[is_before_jump] = trajectory.jerk_pieces.c[-1][jumps]
    states = (trajectory.position(t), trajectory.velocity(t), qddot, jerk)
    # A time just before a jump belongs to the motion before it.
    just_before = np.nextafter(t, np.where(is_before_jump, -np.inf, t))
    pieces = trajectory.split_times(just_before)
    columns: dict[Label, np.ndarray] = {}
    for same, (component, rows, times) in zip(by_component, pieces, strict=True):
        moments = _moments_of(component, times, [state[rows] for state in states])
        for limit in same:
            ratios = limit.ratios(moments, t[rows])
            for label, column in zip(limit.labels, ratios.T, strict=True):
                columns.setdefault(label, np.full(len(t), np.nan))[rows] = column
    for speed in sorted({phase.speed or 0.0 for phase in trajectory.phases} - {0.0}):
        label = label_of_speed(PROCESS_SPEED, speed, PROCESS_SPEED_KEY)
        text = f"the tool is held at its {label.kind}"
        held = replace(label, active_text=text, share="tool speed / limit")
        columns[held] = _has_speed(trajectory, speed, t)
    together = np.array(list(columns.values())).reshape(len(columns), len(t)).T
    return LimitRatios(t, tuple(columns), together)


def _moments_of(
    component: Trajectory, t: np.ndarray, states: Sequence[np.ndarray]
) -> Moments:
    """Return states of the joints, (K, n) each, at times t of a component, with those of its virtual joints."""
    orders = (
        component.position,
        component.velocity,
        component.acceleration,
        component.jerk,
    )
    count = states[0].shape[1]
    q, qdot, qddot, qdddot = (
        np.hstack([state, evaluate(t)[:, count:]])
        for state, evaluate in zip(states, orders, strict=True)
    )
    return Moments(q, qdot, qddot, qdddot, component.path_coordinate(t))


def _has_speed(trajectory: Trajectory, speed: float, t: np.ndarray) -> np.ndarray:
    """Return 1 for each of the times, (K,), at which the tool has a given speed, m/s, and 0 for all other times."""
    slack = tolerances.TIME * trajectory.t_end
    is_held = np.zeros(len(t))
    for phase in trajectory.phases:
        if phase.speed == speed:
            is_held[(t >= phase.begin - slack) & (t <= phase.end + slack)] = 1.0
    return is_held


THRESHOLD = 0.99
"""Fraction of a limit; the limit becomes active when the motion uses this fraction."""
SHORTEST_SHARE = 5e-4
"""Fraction of the motion time; limits that are active for a smaller fraction are not named."""
RIPPLE = 0.95
"""Fraction of a limit; an active limit stays active until the motion uses less, because splines ripple between knots.
"""


@dataclass(frozen=True)
class ActiveInterval:
    """A time interval during which a limit is active, including ripple.

    Attributes
    ----------
    begin, end : float
        Times at which the interval begins and ends, s.
    side : {"lower", "upper"}
        Which of the two bounds is active. For a torque, velocity or acceleration, ``lower`` is the negative bound.
    """

    begin: float
    end: float
    side: str


@dataclass(frozen=True, repr=False)
class Saturation(Summary):
    """How long one limited value is at its limit.

    Attributes
    ----------
    label : Label
        Label of the limited value.
    share : float
        Fraction of the motion time, 0 to 1, during which the limit is active.
    peak : float
        Largest ratio of the value to the limit.
    is_drawn : bool
        Whether timelines show this value, which is so if it uses more than half of its limit and also changes or is
        active.
    active : tuple of ActiveInterval
        Intervals in which the limit is active, in the order of time.
    """

    label: Label
    share: float
    peak: float
    is_drawn: bool
    active: tuple[ActiveInterval, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "subject": self.label.subject,
            "kind": self.label.kind,
            "share": self.share,
            "peak_ratio": self.peak,
            "active_s": [
                [interval.begin, interval.end, interval.side]
                for interval in self.active
            ],
        }


def saturations(motion: Trajectory | LimitRatios) -> tuple[Saturation, ...]:
    """Find when every limit is active.

    Parameters
    ----------
    motion : Trajectory or LimitRatios
        Any trajectory, for example a saved one, or its ratios.

    Returns
    -------
    tuple of Saturation
        One entry for each limited value. Limits that are active longest come first.
    """
    ratios = limit_ratios(motion) if isinstance(motion, Trajectory) else motion
    entries = []
    columns = np.nan_to_num(ratios.values).T
    for label, column in zip(ratios.labels, columns, strict=True):
        active = [
            ActiveInterval(begin, end, side)
            for side, sign in (("lower", -1.0), ("upper", 1.0))
            for begin, end in _find_active(ratios.t, sign * column)
        ]
        active.sort(key=lambda interval: interval.begin)
        duration = sum(interval.end - interval.begin for interval in active)
        share = float(duration / ratios.t[-1])
        peak = float(np.abs(column).max())
        is_drawn = peak > 0.5 and bool(active or np.ptp(column) > 0.05)
        entries.append(Saturation(label, share, peak, is_drawn, tuple(active)))
    return tuple(sorted(entries, key=lambda entry: (-entry.share, -entry.peak)))


def write_share(share: float) -> str:
    """Write a share of the time as a percentage."""
    return f"{100.0 * share:.0f} %" if share >= 0.01 else "less than 1 %"


@dataclass(frozen=True)
class PhaseLimits:
    """The limits that slow one phase, or one part of a program, down.

    Attributes
    ----------
    phase : MotionPhase or MotionPart
    shares : tuple of (Label, float)
        Limits that are active in the phase, each with the fraction of the phase's time. Limits that are active longest
        come first.
    """

    phase: MotionPhase | MotionPart
    shares: tuple[tuple[Label, float], ...]

    def __str__(self) -> str:
        """Name the three limits that are active longest."""
        shares = self.shares[:3]
        texts = [
            f"{label} ({write_share(share)} of the time)" for label, share in shares
        ]
        return ", ".join(texts) or "none"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        limits = [
            {"subject": label.subject, "kind": label.kind, "share": share}
            for label, share in self.shares
        ]
        return {**self.phase.to_dict(), "limits": limits}


def limits_by_phase(
    trajectory: Trajectory, saturated: Sequence[Saturation]
) -> tuple[PhaseLimits, ...]:
    """Find the limits that are active in each phase of a motion, or in each part of a program."""
    phases = []
    for phase in trajectory.parts or trajectory.phases:
        shares = []
        for entry in saturated:
            overlaps = [
                min(interval.end, phase.end) - max(interval.begin, phase.begin)
                for interval in entry.active
            ]
            share = sum(max(0.0, overlap) for overlap in overlaps) / phase.duration
            if share >= SHORTEST_SHARE:
                shares.append((entry.label, share))
        shares.sort(key=lambda pair: -pair[1])
        phases.append(PhaseLimits(phase, tuple(shares)))
    return tuple(phases)


def _find_active(t: np.ndarray, values: np.ndarray) -> list[tuple[float, float]]:
    """Find the intervals in which values, (K,), linear between the times, stay at the threshold except for ripple."""
    samples = np.flatnonzero((values >= THRESHOLD) | (values < RIPPLE))
    is_active = np.pad(values[samples] >= THRESHOLD, 1)
    firsts = samples[is_active[1:-1] & ~is_active[:-2]]
    lasts = samples[is_active[1:-1] & ~is_active[2:]]

    def crossing(before: int) -> float:
        """Return the time between two samples at which the line between them crosses the threshold, s."""
        if not 0 <= before < len(t) - 1:
            return float(t[max(before, 0)])
        low, high = values[before : before + 2]
        step = t[before + 1] - t[before]
        return float(t[before] + step * (THRESHOLD - low) / (high - low))

    pairs = zip(firsts.tolist(), lasts.tolist(), strict=True)
    return [(crossing(first - 1), crossing(last)) for first, last in pairs]
