"""Least times along the joint paths of guesses, leg by leg, and first guesses from them.

A joint path has kinks where the tool stops, so every leg of the path is timed by itself (`timing`). A leg with a given
speed has no fastest motion, but one motion, which the limits allow or do not allow.

The first guess of a leg is the fastest timing of its joint path, smoothed by splines and slowed down until nothing is
too fast: the limits that hold the fastest motion are near then, and a solver sees where to go. Where a smooth motion
from rest to rest is faster, or splines cannot follow the timing within the limits, it is that one. So it is, if knots
are few, for a joint path that may be far from the best one: its timing leads to other optima.
"""

from __future__ import annotations

import math
from operator import itemgetter

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.errors import UnreachableError
from brachis.optimise.candidate import InitialGuess
from brachis.optimise.guess import starting_point, worst_time_scaling_ratio
from brachis.optimise.phase import Phase
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import Program
from brachis.optimise.transcription import breaks_of
from brachis.path.legs import Leg
from brachis.path.time_law import TimeLaw
from brachis.problem.problem import Problem
from brachis.timing import JointPath, PhasePlane

_LegGuess = tuple[np.ndarray, float | None]
"""Guess for a leg: curves, (S, c), and duration, s, if these are a motion's at even times."""
_STATIONS = 401
"""Stations along a joint path of a guess."""
FEW_VARIABLES = 60
"""Up to so many variables a solve over time begins over all knots that are given."""
_LEAST_STATIONS = 41
"""Fewest stations along a leg."""
_NEAR = 1e-4
"""Stations that are nearer to an end of a leg, in s, are left out: differences would be rough."""
_ROUGH = 0.99
"""Part of a given speed that the limits have to allow: derivatives of a joint path are differences."""


def least_time(problem: Problem, s: np.ndarray, q: np.ndarray) -> float:
    """Estimate the least time along a joint path, with its stops and given speeds.

    Parameters
    ----------
    problem, s, q
        As of `fastest_times`.

    Returns
    -------
    float
        s; infinite for a joint path that cannot be followed at any speed, or not at the given one.
    """
    total = sum(leg.dwell for leg in problem.legs)
    for part in fastest_times(problem, s, q):
        total += np.inf if part is None else float(part[1][-1])
    return total


def fastest_times(
    problem: Problem, s: np.ndarray, q: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray] | None]:
    """Estimate when a joint path is passed on each leg.

    Parameters
    ----------
    problem : Problem
    s : (S,) ndarray
        Path coordinates, ascending from 0 to 1.
    q : (S, n) ndarray
        Postures there, rad or m, continuous.

    Returns
    -------
    list of (stations, times) or None
        For each leg path coordinates (P,) from its beginning to its end, and times (P,) from 0 on, s. None for a leg
        that cannot be passed.
    """
    found: list[tuple[np.ndarray, np.ndarray] | None] = []
    parts = zip(problem.legs, problem.leg_rates, problem.time_laws, strict=True)
    for leg, rates, law in parts:
        stations, postures = stations_on(leg, s, q)
        plane = PhasePlane(problem.limits, JointPath.through(stations, postures))
        times: np.ndarray | None
        if law is None:
            timing = plane.solve(rates)
            times = None if timing is None else timing.times
        else:
            times, rate, acceleration = follow_law(law, stations)
            if plane.speed_factor(rate, acceleration)[0] < _ROUGH:
                times = None
        found.append(None if times is None else (stations, times))
    return found


def spread_stations(problem: Problem, count: int = _STATIONS) -> np.ndarray:
    """Spread about so many path coordinates, (S,), evenly over each leg, the ends of the legs among them."""
    parts = [np.zeros(1)]
    for leg in problem.legs:
        least = min(count, _LEAST_STATIONS)
        own = max(least, math.ceil((count - 1) * (leg.end - leg.begin)) + 1)
        parts.append(np.linspace(leg.begin, leg.end, own)[1:])
    return np.concatenate(parts)


def stations_on(
    leg: Leg, s: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Take the part of a joint path, (S,) and (S, n), on a leg: path coordinates (P,) and postures (P, n)."""
    inner = s[(s > leg.begin + _NEAR) & (s < leg.end - _NEAR)]
    if len(inner) < 3:
        inner = np.linspace(leg.begin, leg.end, 5)[1:-1]
    stations = np.concatenate([[leg.begin], inner, [leg.end]])
    return stations, interpolate_columns(stations, s, q)


def follow_law(
    law: TimeLaw, stations: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find when a time law passes stations, (P,), s, and ds/dt, 1/s, and d2s/dt2, 1/s^2, there."""
    t = np.linspace(0.0, law.duration, 8 * len(stations))
    times = np.interp(stations, law.at(t)[0], t)
    _, rate, acceleration, _ = law.at(times)
    return times, rate, acceleration


def initial_guess(program: Program, start: InitialGuess) -> np.ndarray | None:
    """Fit splines to the joint path of a guess, as `starting_point` does.

    Parameters
    ----------
    program : Program
        With a phase for each leg of the path.
    start : InitialGuess

    Returns
    -------
    (v,) ndarray or None
    """
    durations = start.durations or (None,) * len(start.legs)
    given: list[_LegGuess] = list(zip(start.legs, durations, strict=True))
    guesses = [given]
    if start.durations is None:
        timed = _time_guesses(program, start, given)
        if any(duration is not None for _, duration in timed):
            guesses.append(timed)
    found = []
    for guess in guesses:
        curves, durations = zip(*guess, strict=True)
        x = starting_point(program, curves, durations)
        if x is not None:
            beyond = max(worst_time_scaling_ratio(program, x), 1.0)
            found.append((beyond, program.end_time(x), x))
    # The fastest one within the limits.
    return min(found, key=itemgetter(0, 1))[-1] if found else None


def initial_breaks(start: InitialGuess) -> list[np.ndarray]:
    """Choose the ends of the knot intervals of every phase, (N + 1,), in normalised time.

    They are even. Only where the speed is given, and redundant joints go on from other phases in motion, intervals
    begin as short as those next to them, and grow towards the middle.
    """
    problem = start.problem
    even = breaks_of(problem)
    breaks = [even] * len(problem.legs)
    if not start.joint_map.r or not any(problem.time_laws):
        return breaks
    s = spread_stations(problem)
    q = postures_along(start, s)
    if q is None:
        return breaks
    found = fastest_times(problem, s, q)
    times = [np.inf if part is None else float(part[1][-1]) for part in found]
    times = [np.inf, *times, np.inf]
    for number, law in enumerate(problem.time_laws):
        if law is None:
            continue
        beside = (times[number], times[number + 2])
        first, last = (0.5 * even[1] * time / law.duration for time in beside)
        breaks[number] = grade_breaks(2 * (len(even) // 2), first, last)
    return breaks


def grade_breaks(count: int, first: float, last: float) -> np.ndarray:
    """Find ends, (count + 1,), of intervals over [0, 1] that grow by the same factor from either end to the middle.

    Parameters
    ----------
    count : int
        Even.
    first, last : float
        Lengths of the first and the last interval; if they are too long the intervals are even.
    """
    half = count // 2
    sides = []
    for length in (first, last):
        ratio = min(length * count, 1.0)
        # Intervals e^(g k) long: g such that the first one has its share of the half.
        growth = 0.0
        if ratio < 1.0:
            low = 0.0
            high = 20.0
            for _ in range(60):
                growth = 0.5 * (low + high)
                share = half * np.expm1(growth) / np.expm1(growth * half)
                low, high = (growth, high) if share > ratio else (low, growth)
        k = np.arange(half + 1.0)
        sides.append(
            np.expm1(growth * k) / np.expm1(growth * half) if growth else k / half
        )
    before, behind = sides
    return np.concatenate([0.5 * before, 1.0 - 0.5 * behind[-2::-1]])


def _is_moving(phase: Phase) -> bool:
    """Tell whether the tool moves at an end of a leg."""
    sides = phase.boundary.start[0], phase.boundary.end[0]
    return any(side.derivatives[:1].any() for side in sides)


def _time_guesses(
    program: Program, start: InitialGuess, plain: list[_LegGuess]
) -> list[_LegGuess]:
    """Time the joint paths of the legs that are near the best ones, have many knots, or moving ends."""
    is_near = start.is_improved or program.variables > FEW_VARIABLES
    return [
        _time_guess(phase, own) if is_near or _is_moving(phase) else own
        for phase, own in zip(program.phases, plain, strict=True)
    ]


def _time_guess(phase: Phase, plain: _LegGuess) -> _LegGuess:
    """Time the joint path of a leg; return the plain guess where the speed is given, and where no timing exists."""
    curves, _ = plain
    if phase.time_law is not None or phase.joint_map.path is None:
        return plain
    try:
        own = PhaseTiming.through(phase, curves, _STATIONS, is_rough=True)
    except UnreachableError:
        return plain
    if own.timing is None:
        return plain
    t = np.linspace(0.0, own.t_end, _STATIONS)
    return own.course.curves(own.timing, t)[0], own.t_end


def _curves_along(start: InitialGuess, s: np.ndarray) -> np.ndarray:
    """Curves, (S, c), of a guess at path coordinates, (S,)."""
    path = start.joint_path
    return np.column_stack([s, interpolate_columns(s, path[:, 0], path)[:, 1:]])


def postures_along(start: InitialGuess, s: np.ndarray) -> np.ndarray | None:
    """Postures of a guess, (S, n), at path coordinates, (S,); None if some do not exist."""
    q = start.joint_map.postures(_curves_along(start, s))
    return q if np.isfinite(q).all() else None
