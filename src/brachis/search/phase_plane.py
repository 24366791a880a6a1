"""Least time along a fixed joint path: the phase plane of s and ds/dt.

With u = d2s/dt2 and x = (ds/dt)^2, limits along a joint path q(s) are lines in (u, x) (`Limit.lines`):

    a(s) u + b(s) x + c(s)   in [-1, 1],

for torques a = M q_ds / tau_max, b = (M q_dds + C(q, q_ds) q_ds) / tau_max and c the torque at rest; those that do not
ask for u are ceilings or floors for x. Backwards along the joint path, the largest x from which the next station's
interval can be reached is kept; forwards, the largest u that stays within is taken (Pham, Pham, IEEE Trans. Robotics
34(3), 2018). Torque may jump here, and viscous and Coulomb friction are left out, so the time is an estimate by which
joint paths are ranked, no bound.

Starts that are fast enough where a limit asks for a least speed, and splines that can follow them.

The first guess follows its joint path smoothly from rest to rest, and its time is scaled until nothing is too fast. No
such scaling meets a least speed over a part of the path. Where there is one, the joint path is therefore followed in
the times of the phase plane, and knots are ever closer towards the ends and the times at which its acceleration jumps:
a part of the path at a constant speed may be long, and the way to it short.

Between ends in motion the first guess lies half-way between a constant acceleration and the phase plane. The former
alone may need no force at all, where no limit's change with the end time tells a solver where to go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.limits import HasPhasePlaneRows, Limit
from brachis.optimise.candidate import InitialGuess
from brachis.optimise.guess import starting_point
from brachis.optimise.program import Program
from brachis.optimise.transcription import breaks_of

_SLOWEST = 1e-9
_STANDING = 1e-3
_AT_REST = (0.0, 0.0)
_ROUNDING = 1e-6
"""Part of a bound by which a speed at the end may be beyond it."""


def least_time(limits: Sequence[Limit], s: np.ndarray, q: np.ndarray) -> float:
    """Estimate the least time along a joint path from rest to rest.

    Parameters
    ----------
    limits : sequence of Limit
    s : (S,) ndarray
        Path coordinates, ascending.
    q : (S, n) ndarray
        Postures there, rad or m, continuous.

    Returns
    -------
    float
        s; infinite where the joint path cannot be followed at any speed.
    """
    times = least_times(limits, s, q)
    return np.inf if times is None else float(times[-1])


def least_times(
    limits: Sequence[Limit],
    s: np.ndarray,
    q: np.ndarray,
    rates: tuple[float, float] = _AT_REST,
    stations: np.ndarray | None = None,
) -> np.ndarray | None:
    """Estimate when stations are passed, s; None where they cannot be.

    Parameters
    ----------
    limits, s, q
        See `least_time`.
    rates : tuple of float, optional
        ds/dt at both ends, 1/s.
    stations : (P,) ndarray, optional
        Path coordinates, ascending from s[0] to s[-1]; s where left out. Between places of the joint path its
        derivatives are interpolated.
    """
    places = s if stations is None else stations
    rate = fastest(limits, s, q, rates, places)
    return (
        None
        if rate is None
        else np.append(0.0, np.cumsum(2.0 * np.diff(places) / (rate[1:] + rate[:-1])))
    )


def fastest(
    limits: Sequence[Limit],
    s: np.ndarray,
    q: np.ndarray,
    rates: tuple[float, float],
    stations: np.ndarray,
) -> np.ndarray | None:
    """Largest ds/dt at the stations, (P,), 1/s, each as large as any motion along the joint path has it there.

    Parameters
    ----------
    limits, s, q, rates, stations
        See `least_times`.

    Returns
    -------
    (P,) ndarray or None
        None where the joint path cannot be followed.
    """
    x = _squares(_lines(limits, s, q, stations), np.diff(stations), rates)
    return None if x is None else np.sqrt(x)


@dataclass(frozen=True)
class _Lines:
    """Limits along a joint path: bounds on u as lines in x, and bounds on x itself.

    Attributes
    ----------
    slope, offset : tuple of (S, c) ndarray
        Of the upper bounds on u, then of the lower ones.
    floor, ceiling : (S,) ndarray
        Of x.
    """

    slope: tuple[np.ndarray, np.ndarray]
    offset: tuple[np.ndarray, np.ndarray]
    floor: np.ndarray
    ceiling: np.ndarray


def _squares(
    lines: _Lines, steps: np.ndarray, rates: tuple[float, float]
) -> np.ndarray | None:
    """Find x at the stations, (S,), under the largest u; None where the joint path cannot be followed."""
    first, last = (rate**2 for rate in rates)
    intervals = _controllable(lines, steps, last)
    if intervals is None or not intervals[0][0] <= first <= intervals[1][0]:
        return None
    x = _forwards(lines.slope, lines.offset, *intervals, steps, first)
    if not x.max() > 0.0:
        return None
    # Between stations nothing stops; a station where the grid says so is an artefact of its width.
    x[1:-1] = np.maximum(x[1:-1], _STANDING * np.median(x))
    return x


def _lines(
    limits: Sequence[Limit], s: np.ndarray, q: np.ndarray, places: np.ndarray
) -> _Lines:
    """Collect the lines of all limits at places of a joint path."""
    q_ds = np.gradient(q, s, axis=0, edge_order=2)
    orders = q, q_ds, np.gradient(q_ds, s, axis=0, edge_order=2)
    joints = [
        np.column_stack([np.interp(places, s, column) for column in order.T])
        for order in orders
    ]
    floor = np.zeros(len(places))
    ceiling = np.full(len(places), np.inf)
    sloped = []
    for limit in limits:
        if not isinstance(limit, HasPhasePlaneRows):
            continue
        rows = limit.phase_plane_rows(places, *joints)
        if rows.u is None:
            with np.errstate(divide="ignore", invalid="ignore"):
                level = (1.0 - rows.constant) / rows.x
            ceiling = np.minimum(
                ceiling, np.where(rows.x > 0.0, level, np.inf).min(axis=1)
            )
            floor = np.maximum(floor, np.where(rows.x < 0.0, level, 0.0).max(axis=1))
        else:
            sloped.append((rows.u, rows.x, rows.constant))
    a, b, c = (np.concatenate(parts, axis=1) for parts in zip(*sloped, strict=True))
    # A coefficient of zero would make a vertical line; a tiny one gives bounds far out that do no harm.
    a = np.where(np.abs(a) < _SLOWEST, _SLOWEST, a)
    first = (1.0 - c) / a
    second = (-1.0 - c) / a
    return _Lines(
        (-b / a, -b / a),
        (np.maximum(first, second), np.minimum(first, second)),
        floor,
        ceiling,
    )


def _controllable(
    lines: _Lines, steps: np.ndarray, last: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Go backwards: the intervals of x, (S,), from which the end can be reached with x = `last`; None where empty."""
    slope = lines.slope
    offset = lines.offset
    count = len(lines.ceiling)
    if (
        not lines.floor[-1] * (1.0 - _ROUNDING)
        <= last
        <= lines.ceiling[-1] * (1.0 + _ROUNDING)
    ):
        return None
    low = np.full(count, last)
    high = np.full(count, last)
    for i in range(count - 2, -1, -1):
        step = steps[i]
        # u >= (low' - x) / 2 step and u <= (high' - x) / 2 step join the lines.
        up = (
            np.append(slope[0][i], -0.5 / step),
            np.append(offset[0][i], 0.5 * high[i + 1] / step),
        )
        down = (
            np.append(slope[1][i], -0.5 / step),
            np.append(offset[1][i], 0.5 * low[i + 1] / step),
        )
        tilt = (up[0][:, None] - down[0][None]).ravel()
        clearance = (up[1][:, None] - down[1][None]).ravel()
        if np.any((clearance < 0.0) & (np.abs(tilt) < _SLOWEST)):
            return None
        falling = tilt < -_SLOWEST
        rising = tilt > _SLOWEST
        high[i] = min(
            lines.ceiling[i],
            np.min(clearance[falling] / -tilt[falling], initial=np.inf),
        )
        low[i] = max(
            lines.floor[i], np.max(-clearance[rising] / tilt[rising], initial=0.0)
        )
        if low[i] > high[i]:
            return None
    return low, high


def _forwards(
    slope: tuple[np.ndarray, np.ndarray],
    offset: tuple[np.ndarray, np.ndarray],
    low: np.ndarray,
    high: np.ndarray,
    steps: np.ndarray,
    first: float,
) -> np.ndarray:
    """Go forwards from x = `first`: x, (S,), under the largest u."""
    x = np.full(len(low), first)
    for i in range(len(low) - 1):
        largest = np.min(slope[0][i] * x[i] + offset[0][i], initial=np.inf)
        x[i + 1] = np.clip(x[i] + 2.0 * steps[i] * largest, low[i + 1], high[i + 1])
    return x


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
_LEAST = (1e-5, 1.0)
_BISECTIONS = 60
"""Between which lengths, in normalised time, that of intervals at a switch is sought, and how; with more intervals than
are needed for the least one all of them become shorter, as slopes over 1e-9 of the time would say nothing."""


def initial_knots(start: InitialGuess) -> np.ndarray:
    """Choose the ends of the knot intervals in normalised time, (N + 1,), for a plan from a start."""
    breaks = breaks_of(start.problem.task)
    paced = _paced(start)
    if paced is None:
        return breaks
    switches = _switches(*paced)
    if not len(switches):
        return breaks
    count = (
        _FIRST_INTERVALS
        if start.problem.task.spline.intervals == "auto"
        else len(breaks) - 1
    )
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
        numbers = (
            np.log1p(_GRADING * halves / least) / _GRADING
        )  # of the intervals in every half
        low, high = (least, high) if numbers.sum() > count else (low, least)
    behind = np.append(0.0, np.cumsum(numbers))
    wanted = np.linspace(0.0, behind[-1], count + 1)
    half = np.clip(
        np.searchsorted(behind, wanted, side="right") - 1, 0, len(halves) - 1
    )
    first = half % 2 == 0  # the switch is before it
    away = np.where(first, wanted - behind[half], behind[half + 1] - wanted)
    way = least / _GRADING * np.expm1(_GRADING * away)
    breaks = np.where(first, switches[half // 2] + way, switches[half // 2 + 1] - way)
    return np.concatenate([[0.0], breaks[1:-1], [1.0]])


def initial_guess(program: Program, start: InitialGuess) -> np.ndarray | None:
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
    return starting_point(
        program, [start.joint_path], start.estimate if start.timed else None
    )


def _paced(start: InitialGuess) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves along the joint path, (S, c), and their times, (S,), s; None where no limit asks for a least speed."""
    return (
        _timed(start)
        if any(limit.longer_time == "violates" for limit in start.problem.limits)
        else None
    )


def _between_speeds(start: InitialGuess) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves and times likewise where an end is in motion and the joint path is not a motion's yet; else None."""
    first, last = start.problem.end_rates
    fastest = None if start.timed or first == last == 0.0 else _timed(start)
    if fastest is None:
        return None
    curves, times = fastest
    s = curves[:, 0]
    with np.errstate(invalid="ignore"):  # 0 / 0 where the motion starts from rest
        even = np.nan_to_num(
            2.0 * s / (first + np.sqrt(first**2 + (last**2 - first**2) * s))
        )
    return curves, 0.5 * (times + even)


def _timed(start: InitialGuess) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves along the joint path, (S, c), and when the phase plane passes them, (S,), s."""
    problem = start.problem
    joint_path = start.joint_path
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = start.joint_map.postures(along(joint_path, s))
    if not np.isfinite(q).all():
        return None
    stations = graded(problem.limits)
    times = least_times(problem.limits, s, q, problem.end_rates, stations)
    return (
        None
        if times is None or not np.isfinite(times[-1])
        else (along(joint_path, stations), times)
    )


def along(joint_path: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Curves, (S, c), of a joint path at path coordinates, (S,)."""
    return np.column_stack(
        [s, *(np.interp(s, joint_path[:, 0], column) for column in joint_path.T[1:])]
    )


def graded(limits: Sequence[Limit]) -> np.ndarray:
    """Spread stations evenly, and ever closer towards where a least speed sets in or ends."""
    even = np.linspace(0.0, 1.0, _STATIONS)
    steps = even[1] * 0.5 ** np.arange(_HALVINGS)
    breaks = np.concatenate(
        [
            np.empty(0),
            *(limit.breaks for limit in limits if limit.longer_time == "violates"),
        ]
    )
    near = breaks[:, None] + np.r_[-steps, 0.0, steps]
    places = np.union1d(even, np.clip(near, 0.0, 1.0))
    return places[np.append(np.diff(places) > 0.5 * steps[-1], True)]
