"""Starts that are fast enough where a limit asks for a least speed, and splines that can follow them.

The first guess follows its joint path smoothly from rest to rest, and its time is scaled until nothing is too fast. No
such scaling meets a least speed over a part of the path. Where there is one, the joint path is therefore followed in
the times of the phase plane, and knots are ever closer towards the ends and the times at which its acceleration jumps:
a part of the path at a constant speed may be long, and the way to it short.

Between ends in motion the first guess lies half-way between a constant acceleration and the phase plane. The former
alone may need no force at all, where no limit's change with the end time tells a solver where to go.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.attempt import Start
from brachis.limits import Limit
from brachis.nlp import Program
from brachis.nlp.guess import starting_point
from brachis.transcription import breaks_of
from brachis.search.phase_plane import least_times

_STATIONS = 401
_TIMES = 64 * _STATIONS
"""Even times at which the motion is taken from the stations: a short way to a speed is passed in milliseconds."""
_HALVINGS = 12
"""How often the way to an abrupt change is halved by stations."""
_SWITCH = 0.1
"""A change of the acceleration between stations by this part of its range is a switch from one limit to another."""
_GRADING = 0.5
"""Length that knot intervals gain with their distance from a switch, as a part of it."""
_FIRST_INTERVALS = 60
"""Of a mesh that is refined."""
_STEADY = 1e-2
"""Changes of the acceleration below this, in paths per square of the duration, are rounding."""
_LEAST, _BISECTIONS = (1e-5, 1.0), 60
"""Between which lengths, in normalised time, that of intervals at a switch is sought, and how; with more intervals than
are needed for the least one all of them become shorter, as slopes over 1e-9 of the time would say nothing."""


def first_breaks(start: Start) -> np.ndarray:
    """Choose the ends of the knot intervals in normalised time, (N + 1,), for a plan from a start."""
    breaks, paced = breaks_of(start.problem.task), _paced(start)
    if paced is None:
        return breaks
    switches = _switches(*paced)
    if not len(switches):
        return breaks
    count = _FIRST_INTERVALS if start.problem.task.spline.intervals == "auto" else len(breaks) - 1
    return _graded(np.union1d([0.0, 1.0], switches), count)


def _switches(curves: np.ndarray, times: np.ndarray) -> np.ndarray:
    """List the normalised times at which the acceleration along the path jumps, but for the ends."""
    t_norm = times / times[-1]
    middle = 0.5 * (t_norm[1:] + t_norm[:-1])
    acceleration = np.diff(np.diff(curves[:, 0]) / np.diff(t_norm)) / np.diff(middle)
    jumps = np.abs(np.diff(acceleration)) > max(_SWITCH * np.ptp(acceleration), _STEADY)
    return np.asarray(middle[1:-1][jumps])


def _graded(switches: np.ndarray, count: int) -> np.ndarray:
    """Find the ends, (count + 1,), of so many intervals, m + g d long at distances d from the nearest switch."""
    halves = np.repeat(0.5 * np.diff(switches), 2)
    low, high = _LEAST
    for _ in range(_BISECTIONS):
        least = np.sqrt(low * high)
        numbers = np.log1p(_GRADING * halves / least) / _GRADING  # of the intervals in every half
        low, high = (least, high) if numbers.sum() > count else (low, least)
    behind = np.append(0.0, np.cumsum(numbers))
    wanted = np.linspace(0.0, behind[-1], count + 1)
    half = np.clip(np.searchsorted(behind, wanted, side="right") - 1, 0, len(halves) - 1)
    first = half % 2 == 0  # the switch is before it
    away = np.where(first, wanted - behind[half], behind[half + 1] - wanted)
    way = least / _GRADING * np.expm1(_GRADING * away)
    breaks = np.where(first, switches[half // 2] + way, switches[half // 2 + 1] - way)
    return np.concatenate([[0.0], breaks[1:-1], [1.0]])


def first_point(program: Program, start: Start) -> np.ndarray | None:
    """Fit splines to the joint path of a start; see `starting_point`.

    Parameters
    ----------
    program : Program
    start : Start

    Returns
    -------
    (v,) ndarray or None
    """
    for followed, keep in ((_paced(start), True), (_between_speeds(start), False)):
        if followed is None:
            continue
        curves, times = followed
        at = np.linspace(0.0, times[-1], _TIMES)
        motion = np.column_stack([np.interp(at, times, column) for column in curves.T])
        x = starting_point(program, [motion], times[-1], keep=keep)
        if x is not None:
            return x
    return starting_point(program, [start.joint_path], start.estimate if start.timed else None)


def _paced(start: Start) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves along the joint path, (S, c), and their times, (S,), s; None where no limit asks for a least speed."""
    return _timed(start) if any(limit.least_speed for limit in start.problem.limits) else None


def _between_speeds(start: Start) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves and times likewise where an end is in motion and the joint path is not a motion's yet; else None."""
    first, last = start.problem.end_rates
    fastest = None if start.timed or first == last == 0.0 else _timed(start)
    if fastest is None:
        return None
    curves, times = fastest
    s = curves[:, 0]
    with np.errstate(invalid="ignore"):  # 0 / 0 where the motion starts from rest
        even = np.nan_to_num(2.0 * s / (first + np.sqrt(first**2 + (last**2 - first**2) * s)))
    return curves, 0.5 * (times + even)


def _timed(start: Start) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves along the joint path, (S, c), and when the phase plane passes them, (S,), s."""
    problem, joint_path = start.problem, start.joint_path
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = start.joint_map.postures(along(joint_path, s))
    if not np.isfinite(q).all():
        return None
    stations = graded(problem.limits)
    times = least_times(problem.limits, s, q, problem.end_rates, stations)
    return None if times is None or not np.isfinite(times[-1]) else (along(joint_path, stations), times)


def along(joint_path: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Curves, (S, c), of a joint path at path coordinates, (S,)."""
    return np.column_stack([s, *(np.interp(s, joint_path[:, 0], column) for column in joint_path.T[1:])])


def graded(limits: Sequence[Limit]) -> np.ndarray:
    """Spread stations evenly, and ever closer towards where a least speed sets in or ends."""
    even = np.linspace(0.0, 1.0, _STATIONS)
    steps = even[1] * 0.5 ** np.arange(_HALVINGS)
    breaks = np.concatenate([np.empty(0), *(limit.breaks for limit in limits if limit.least_speed)])
    near = breaks[:, None] + np.r_[-steps, 0.0, steps]
    places = np.union1d(even, np.clip(near, 0.0, 1.0))
    return places[np.append(np.diff(places) > 0.5 * steps[-1], True)]
