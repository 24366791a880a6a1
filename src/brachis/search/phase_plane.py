"""Least time along a fixed joint path, and first guesses from it: the phase plane of s and ds/dt.

With u = d2s/dt2 and x = (ds/dt)^2, limits along a joint path q(s) are lines in (u, x) (`phase_plane_rows`):

    a(s) u + b(s) x + c(s)   in [-1, 1],

for torques a = M q_ds / tau_max, b = (M q_dds + C(q, q_ds) q_ds) / tau_max and c the torque at rest; those without u
are ceilings or floors for x. Backwards along the joint path, the largest x from which the next station's interval can
be reached is kept; forwards, the largest u that stays within is taken (Pham, Pham, IEEE Trans. Robotics 34(3), 2018).
Torque may jump here, and viscous and Coulomb friction are left out, so the time is an estimate by which joint paths are
ranked, not a bound.

A joint path has kinks where the tool stops, so every leg of the path is looked at by itself. A leg with a given speed
has no fastest motion, but one motion, which the limits allow or do not allow.

The usual first guess of a leg follows its joint path smoothly from rest to rest, and its time is scaled until nothing
is too fast. Between moving ends the first guess lies half-way between a constant acceleration and the phase plane. The
former alone may need no force at all, so that no limit's change with the end time tells a solver where to go.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.limits import HasPhasePlaneRows, Limit
from brachis.optimise.candidate import InitialGuess
from brachis.optimise.guess import starting_point
from brachis.optimise.program import Program
from brachis.optimise.transcription import breaks_of
from brachis.path.legs import Leg
from brachis.path.time_law import TimeLaw
from brachis.problem.problem import Problem

_LegGuess = tuple[np.ndarray, float | None]
"""Guess for a leg: curves, (S, c), and duration, s, if these are a motion's at even times."""
_TINY = 1e-9
"""Coefficients and slopes below this are taken for zero."""
_STATIONS = 401
"""Stations along a joint path of a guess."""
_LEAST_STATIONS = 41
"""Fewest stations along a leg."""
_NEAR = 1e-4
"""Stations that are nearer to an end of a leg, in s, are left out: differences would be rough."""
_ROUNDING = 1e-6
"""Part of (ds/dt)^2 at the ends by which rounding may exceed a limit."""
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
        plane = PhasePlane(problem.limits, stations, postures)
        times = plane.times(rates) if law is None else None
        if law is not None:
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


class PhasePlane:
    """Limits along a joint path: slope x + lower <= u <= slope x + upper, and floor <= x <= ceiling.

    Parameters
    ----------
    limits : sequence of Limit
    s : (P,) ndarray
        Path coordinates, ascending, at least three.
    q : (P, n) ndarray
        Postures there, rad or m, continuous with their derivatives.
    """

    def __init__(self, limits: Sequence[Limit], s: np.ndarray, q: np.ndarray) -> None:
        q_ds = np.gradient(q, s, axis=0, edge_order=2)
        q_dds = np.gradient(q_ds, s, axis=0, edge_order=2)
        self.s = s
        self._steps = np.diff(s)
        self._floor = np.zeros(len(s))
        sloped = []
        levels = [np.empty((len(s), 0))]
        names: list[str] = []
        level_names: list[str] = []
        for limit in limits:
            if not isinstance(limit, HasPhasePlaneRows):
                continue
            rows = limit.phase_plane_rows(s, q, q_ds, q_dds)
            labels = [str(label) for label in limit.labels]
            own = (
                labels
                if rows.x.shape[1] == len(labels)
                else labels[:1] * rows.x.shape[1]
            )
            if rows.u is not None:
                sloped.append((rows.u, rows.x, rows.constant))
                names += own
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                level = (1.0 - rows.constant) / rows.x
            lowest = np.where(rows.x < 0.0, level, 0.0).max(axis=1)
            self._floor = np.maximum(self._floor, lowest)
            levels.append(np.where(rows.x > 0.0, level, np.inf))
            level_names += own
        self._levels = np.concatenate(levels, axis=1)
        self._ceiling = self._levels.min(axis=1, initial=np.inf)
        self._labels = [*names, *level_names]
        a, b, c = (np.concatenate(parts, axis=1) for parts in zip(*sloped, strict=True))
        # A coefficient of zero would make a vertical line; a tiny one gives bounds far out that do no harm.
        a = np.where(np.abs(a) < _TINY, _TINY, a)
        ends = (1.0 - c) / a, (-1.0 - c) / a
        self._slope = -b / a
        self._lower = np.minimum(*ends)
        self._upper = np.maximum(*ends)

    def times(self, rates: tuple[float, float] = (0.0, 0.0)) -> np.ndarray | None:
        """Estimate when the stations are passed, (P,), s, with ds/dt at both ends, 1/s; None if they cannot be."""
        rate = self.fastest(rates)
        if rate is None:
            return None
        durations = 2.0 * self._steps / (rate[1:] + rate[:-1])
        return np.append(0.0, np.cumsum(durations))

    def speed_factor(
        self, rate: np.ndarray, acceleration: np.ndarray
    ) -> tuple[float, float, str]:
        """Find by how much a motion may be faster, or has to be slower.

        Parameters
        ----------
        rate, acceleration : (P,) ndarray
            ds/dt, 1/s, and d2s/dt2, 1/s^2, at the stations.

        Returns
        -------
        tuple of float, float and str
            The largest factor of its speed; the path coordinate and the label of the limit that allow no more.
        """
        factors = self._factors(rate, acceleration)
        least = factors.min(axis=1)
        # The first place of equal ones.
        station = int(np.argmax(least <= least.min() * (1.0 + _ROUNDING)))
        column = int(np.argmin(factors[station]))
        return float(least[station]), float(self.s[station]), self._labels[column]

    def _factors(self, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Largest factor, (P, c), of the speed of a motion for each limit alone."""
        x = rate[:, None] ** 2
        beside = acceleration[:, None] - self._slope * x
        bound = np.hstack(
            [np.where(beside > 0.0, self._upper, self._lower), self._levels]
        )
        used = np.hstack([beside, np.broadcast_to(x, self._levels.shape)])
        squares = np.divide(
            bound, used, out=np.full_like(bound, np.inf), where=used != 0.0
        )
        return np.sqrt(np.maximum(squares, 0.0))

    def active_limit(self, rate: np.ndarray) -> str:
        """Name the limit that a motion, ds/dt (P,), 1/s, as fast as possible, is at for most of its way."""
        acceleration = np.diff(rate**2) / (2.0 * self._steps)
        factors = self._factors(rate, np.append(acceleration, acceleration[-1]))
        columns = np.argmin(factors[:-1], axis=1)
        return self._labels[int(np.argmax(np.bincount(columns, self._steps)))]

    def largest_rate(self, station: int) -> tuple[float, str]:
        """Find the largest ds/dt, 1/s, that the limits allow at a station, and which one allows no more."""
        tilt = self._slope[station][:, None] - self._slope[station]
        clearance = self._upper[station][:, None] - self._lower[station]
        falls = tilt < -_TINY
        squares = np.divide(
            clearance, -tilt, out=np.full_like(tilt, np.inf), where=falls
        )
        highest = np.append(squares.min(axis=1), self._levels[station])
        column = int(np.argmin(highest))
        return math.sqrt(max(highest[column], 0.0)), self._labels[column]

    def fastest(self, rates: tuple[float, float]) -> np.ndarray | None:
        """Largest ds/dt at the stations, (P,), 1/s, each as large as any motion along the joint path has it there.

        Parameters
        ----------
        rates : tuple of float
            ds/dt at both ends, 1/s.

        Returns
        -------
        (P,) ndarray or None
            None for a joint path that cannot be followed.
        """
        first, last = (rate**2 for rate in rates)
        intervals = self._go_backwards(last)
        if intervals is None:
            return None
        low, high = intervals
        if not low[0] * (1.0 - _ROUNDING) <= first <= high[0] * (1.0 + _ROUNDING):
            return None
        x = np.full(len(low), first)
        for i, step in enumerate(self._steps):
            upper = self._slope[i] * x[i] + self._upper[i]
            largest = np.min(upper, initial=np.inf)
            x[i + 1] = np.clip(x[i] + 2.0 * step * largest, low[i + 1], high[i + 1])
        if not x.max() > 0.0:
            return None
        # Between stations nothing stops; a station where the grid says so is an artefact of its width.
        x[1:-1] = np.maximum(x[1:-1], 1e-3 * np.median(x))
        return np.sqrt(x)

    def _go_backwards(self, last: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Find the intervals of x, (P,), from which the end can be reached with x = `last`; None if one is empty."""
        lowest = self._floor[-1] * (1.0 - _ROUNDING)
        if not lowest <= last <= self._ceiling[-1] * (1.0 + _ROUNDING):
            return None
        low = np.full(len(self._floor), last)
        high = low.copy()
        for i in range(len(low) - 2, -1, -1):
            # u >= (low' - x) / 2 step and u <= (high' - x) / 2 step join the lines.
            half = 0.5 / self._steps[i]
            slope = np.append(self._slope[i], -half)
            upper = np.append(self._upper[i], half * high[i + 1])
            lower = np.append(self._lower[i], half * low[i + 1])
            tilt = (slope[:, None] - slope[None]).ravel()
            clearance = (upper[:, None] - lower[None]).ravel()
            if np.any((clearance < 0.0) & (np.abs(tilt) < _TINY)):
                return None
            falling = tilt < -_TINY
            rising = tilt > _TINY
            highest = np.min(clearance[falling] / -tilt[falling], initial=np.inf)
            lowest = np.max(-clearance[rising] / tilt[rising], initial=0.0)
            high[i] = min(self._ceiling[i], highest)
            low[i] = max(self._floor[i], lowest)
            if low[i] > high[i]:
                return None
        return low, high


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
    parts = start.legs
    legs = range(len(parts))
    guesses: list[list[_LegGuess]]
    if start.durations is not None:
        guesses = [list(zip(parts, start.durations, strict=True))]
    else:
        plain = [_given_guess(start, leg) or (parts[leg], None) for leg in legs]
        moving = [_moving_ends_guess(start, leg) or plain[leg] for leg in legs]
        guesses = [moving, plain]
    for guess in guesses:
        curves, durations = zip(*guess, strict=True)
        x = starting_point(program, curves, durations)
        if x is not None:
            return x
    return None


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


def _given_guess(start: InitialGuess, leg: int) -> _LegGuess | None:
    """Curves, (S, c), at even times, and the duration, s, on a leg whose speed is given; else None."""
    law = start.problem.time_laws[leg]
    if law is None:
        return None
    s = law.at(np.linspace(0.0, law.duration, _STATIONS))[0]
    return _curves_along(start, s), law.duration


def _moving_ends_guess(start: InitialGuess, leg: int) -> _LegGuess | None:
    """Curves, (S, c), at even times, and the duration, s, on a leg with a free speed between moving ends; else None."""
    problem = start.problem
    first, last = problem.leg_rates[leg]
    if problem.time_laws[leg] is not None or first == last == 0.0:
        return None
    begin = problem.legs[leg].begin
    end = problem.legs[leg].end
    s = np.linspace(begin, end, _STATIONS)
    q = postures_along(start, s)
    times = None if q is None else PhasePlane(problem.limits, s, q).times((first, last))
    if times is None or not np.isfinite(times[-1]):
        return None
    part = (s - begin) / (end - begin)
    rate = np.sqrt(first**2 * (1.0 - part) + last**2 * part)
    with np.errstate(invalid="ignore"):  # 0 / 0 for a motion that starts from rest
        even = np.nan_to_num(2.0 * (s - begin) / (first + rate))
    # To and from a slow speed a constant acceleration would take very long.
    times = 0.5 * (times + np.minimum(even, 2.0 * times))
    t = np.linspace(0.0, times[-1], 8 * _STATIONS)
    return _curves_along(start, np.interp(t, times, s)), float(times[-1])


def _curves_along(start: InitialGuess, s: np.ndarray) -> np.ndarray:
    """Curves, (S, c), of a guess at path coordinates, (S,)."""
    path = start.joint_path
    return np.column_stack([s, interpolate_columns(s, path[:, 0], path)[:, 1:]])


def postures_along(start: InitialGuess, s: np.ndarray) -> np.ndarray | None:
    """Postures of a guess, (S, n), at path coordinates, (S,); None if some do not exist."""
    q = start.joint_map.postures(_curves_along(start, s))
    return q if np.isfinite(q).all() else None
