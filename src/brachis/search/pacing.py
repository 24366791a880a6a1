"""Starts that are fast enough where a limit asks for a least speed, and splines that can follow them.

The first guess follows its joint path smoothly from rest to rest, and its time is scaled until nothing is too fast. No
such scaling meets a least speed over a part of the path. Where there is one, the joint path is therefore followed in
the times of the phase plane, and knots are closer together where that motion changes its speed: a part of the path at
a constant speed may be long, and the way to it short.

Between ends in motion the first guess lies half-way between a constant acceleration and the phase plane. The former
alone may need no force at all, where no limit's change with the end time tells a solver where to go.
"""

from __future__ import annotations

import numpy as np

from brachis.attempt import Start
from brachis.nlp import Program
from brachis.nlp.guess import starting_point
from brachis.problem import breaks_of
from brachis.search.phase_plane import least_times

_STATIONS = 401
_STEADY = 1e-6
"""Changes of the speed below this part of it are rounding."""
_SPREAD = 0.2
"""Part of the knots that is spread evenly over the time; the others are over the change of speed."""


def first_breaks(start: Start) -> np.ndarray:
    """Choose the ends of the knot intervals in normalised time, (N + 1,), for a plan from a start."""
    breaks, paced = breaks_of(start.problem.task), _paced(start)
    if paced is None:
        return breaks
    _, times = paced
    t_norm = np.linspace(0.0, 1.0, _STATIONS)
    speed = np.gradient(np.interp(t_norm, times / times[-1], np.linspace(0.0, 1.0, len(times))), t_norm)
    change = np.append(0.0, np.cumsum(np.abs(np.diff(speed))))
    if change[-1] <= _STEADY * np.abs(speed).max():
        return breaks
    return np.asarray(np.interp(breaks, _SPREAD * t_norm + (1.0 - _SPREAD) * change / change[-1], t_norm))


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
    for followed in (_paced(start), _between_speeds(start)):
        if followed is None:
            continue
        curves, times = followed
        at = np.linspace(0.0, times[-1], 4 * _STATIONS)
        motion = np.column_stack([np.interp(at, times, column) for column in curves.T])
        x = starting_point(program, [motion], times[-1])
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
    s = np.linspace(0.0, 1.0, _STATIONS)
    with np.errstate(invalid="ignore"):  # 0 / 0 where the motion starts from rest
        even = np.nan_to_num(2.0 * s / (first + np.sqrt(first**2 + (last**2 - first**2) * s)))
    return curves, 0.5 * (times + even)


def _timed(start: Start) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves along the joint path at even stations, (S, c), and when the phase plane passes them, (S,), s."""
    s = np.linspace(0.0, 1.0, _STATIONS)
    joint_path = start.joint_path
    curves = np.column_stack([s, *(np.interp(s, joint_path[:, 0], column) for column in joint_path.T[1:])])
    q = start.joint_map.postures(curves)
    if not np.isfinite(q).all():
        return None
    times = least_times(start.problem.limits, s, q, start.problem.end_rates)
    return None if times is None or not np.isfinite(times[-1]) else (curves, times)
