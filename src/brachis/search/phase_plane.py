"""Least times along the joint paths of guesses, leg by leg, and the first splines that follow from them.

A joint path has kinks where the tool stops, so every leg of the path is timed by itself (`timing`). A leg with a given
speed has only one motion, which the limits either allow or do not allow.

The first guess of a leg is the fastest timing of its joint path, smoothed by splines and slowed down until no limit is
exceeded. It is then close to the limits that hold the fastest motion back, which helps a solver to converge. If a
smooth motion from rest to rest is faster, or if splines cannot follow the timing within the limits, this motion is the
first guess. If splines over few knots leave the branch, the first guess goes straight from end to end.
"""

from __future__ import annotations

from operator import itemgetter

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.errors import UnreachableError
from brachis.optimise.guess import starting_point, worst_time_scaling_ratio
from brachis.optimise.motion import follow_law
from brachis.optimise.phase import Phase
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import Program
from brachis.path.legs import Leg
from brachis.problem.problem import Problem
from brachis.search.stages import InitialGuess
from brachis.timing import JointPath, PhasePlane

_STATIONS = 401
"""Number of stations along the joint path of a guess."""
_NEAR = 1e-4
"""Stations closer than this to an end of a leg, in s, are left out, because differences would be inaccurate."""
_ROUGH = 0.99
"""Fraction of a given speed that the limits must allow; derivatives of a joint path are only inaccurate differences."""


def least_time(problem: Problem, s: np.ndarray, q: np.ndarray) -> float:
    """Estimate the least time along a joint path, including its stops and given speeds.

    Parameters
    ----------
    problem, s, q
        See `fastest_times`.

    Returns
    -------
    float
        Time, s; infinite if the joint path cannot be followed at any speed, or not at the given speed.
    """
    total = problem.dwell_time
    for timed_leg in fastest_times(problem, s, q):
        total += np.inf if timed_leg is None else float(timed_leg[1][-1])
    return total


def fastest_times(
    problem: Problem, s: np.ndarray, q: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray] | None]:
    """Estimate the fastest timing of a joint path, leg by leg.

    Parameters
    ----------
    problem : Problem
    s : (S,) ndarray
        Path coordinates, ascending from 0 to 1.
    q : (S, n) ndarray
        Postures at these coordinates, rad or m; the joint path is continuous.

    Returns
    -------
    list of (stations, times) or None
        For each leg, path coordinates (P,) from its beginning to its end, and the times (P,), s, which begin at 0. None
        for a leg that cannot be travelled.
    """
    timed_legs = []
    legs = zip(problem.legs, problem.leg_rates, problem.time_laws, strict=True)
    for leg, rates, law in legs:
        plane = phase_plane_on(problem, leg, s, q)
        times: np.ndarray | None
        if law is None:
            timing = plane.solve(rates)
            times = None if timing is None else timing.times
        else:
            times, rate, acceleration = follow_law(law, plane.path.s)
            if plane.speed_factor(rate, acceleration)[0] < _ROUGH:
                times = None
        timed_legs.append(None if times is None else (plane.path.s, times))
    return timed_legs


def phase_plane_on(
    problem: Problem, leg: Leg, s: np.ndarray, q: np.ndarray
) -> PhasePlane:
    """Return the phase plane for the part of a joint path, (S,) and (S, n), that is on a leg."""
    inner = s[(s > leg.begin + _NEAR) & (s < leg.end - _NEAR)]
    if len(inner) < 3:
        inner = np.linspace(leg.begin, leg.end, 5)[1:-1]
    stations = np.concatenate([[leg.begin], inner, [leg.end]])
    postures = interpolate_columns(stations, s, q)
    return PhasePlane(problem.limits, JointPath.through(stations, postures))


def initial_guess(program: Program, guess: InitialGuess) -> np.ndarray | None:
    """Fit splines to the joint path of a guess, as `starting_point` does.

    Parameters
    ----------
    program : Program
        Program with one phase for each leg of the path.
    guess : InitialGuess

    Returns
    -------
    (v,) ndarray or None
    """
    durations = guess.durations or (None,) * len(guess.legs)
    curves_and_durations = [(guess.legs, durations)]
    if guess.durations is None:
        # The timing of a joint path that was not improved would lead to different optima.
        timed = [
            _time_guess(phase, curves)
            if guess.is_improved or any(phase.boundary.rates)
            else (curves, None)
            for phase, curves in zip(program.phases, guess.legs, strict=True)
        ]
        curves, durations = zip(*timed, strict=True)
        if any(durations):
            curves_and_durations.append((curves, durations))
    points = []
    for curves, durations in curves_and_durations:
        x = starting_point(program, curves, durations)
        if x is not None:
            beyond = max(worst_time_scaling_ratio(program, x), 1.0)
            points.append((beyond, program.end_time(x), x))
    if points:
        # The fastest splines within the limits.
        return min(points, key=itemgetter(0, 1))[-1]
    # Splines over few knots may leave the branch where the joint path bends.
    straight = [np.linspace(curves[0], curves[-1], _STATIONS) for curves in guess.legs]
    return starting_point(program, straight, (None,) * len(straight))


def _time_guess(phase: Phase, curves: np.ndarray) -> tuple[np.ndarray, float | None]:
    """Time the joint path of a leg; return its curves at even times, and its duration, s.

    If the speed is given, or if no timing exists, the joint path is returned unchanged and without a duration.
    """
    if phase.time_law is not None or phase.joint_map.path is None:
        return curves, None
    try:
        phase_timing = PhaseTiming.through(phase, curves, _STATIONS, is_rough=True)
    except UnreachableError:
        return curves, None
    if phase_timing.timing is None:
        return curves, None
    t = np.linspace(0.0, phase_timing.t_end, _STATIONS)
    return phase_timing.course.curves(phase_timing.timing, t)[0], phase_timing.t_end


def postures_along(guess: InitialGuess, s: np.ndarray) -> np.ndarray | None:
    """Return the postures of a guess, (S, n), at path coordinates, (S,); None if some do not exist."""
    q = guess.postures_at(s)
    return q if np.isfinite(q).all() else None
