"""Least time along a fixed joint path, and first guesses from it: the phase plane of s and ds/dt.

With u = d2s/dt2 and x = (ds/dt)^2, limits along a joint path q(s) are lines in (u, x) (`phase_plane_rows`):

    a(s) u + b(s) x + c(s)   in [-1, 1],

for torques a = M q_ds / tau_max, b = (M q_dds + C(q, q_ds) q_ds) / tau_max and c the torque at rest; those without u
are ceilings or floors for x. Backwards along the joint path, the largest x from which the next station's interval can
be reached is kept; forwards, the largest u that stays within is taken (Pham, Pham, IEEE Trans. Robotics 34(3), 2018).
Torque may jump here, and viscous and Coulomb friction are left out, so the time is an estimate by which joint paths are
ranked, not a bound.

The usual first guess follows its joint path smoothly from rest to rest, and its time is scaled until nothing is too
fast. No such scaling meets a least speed over a part of the path. With a least speed the guess therefore keeps the
times of the phase plane, and knots are ever closer towards the ends and the times at which its acceleration jumps: a
part of the path at a constant speed may be long, and the run-up to it short.

Between moving ends the first guess lies half-way between a constant acceleration and the phase plane. The former alone
may need no force at all, so that no limit's change with the end time tells a solver where to go.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits import HasPhasePlaneRows, Limit
from brachis.optimise.candidate import InitialGuess
from brachis.optimise.guess import starting_point
from brachis.optimise.program import Program
from brachis.optimise.transcription import breaks_of

_TINY = 1e-9
"""Coefficients and slopes below this are taken for zero."""
_STATIONS = 401
"""Stations along a joint path of a guess."""
_GRADING = 0.5
"""Length that knot intervals gain with their distance from a switch, as a part of it."""


def least_time(limits: Sequence[Limit], s: np.ndarray, q: np.ndarray) -> float:
    """Estimate the least time along a joint path from rest to rest.

    Parameters
    ----------
    limits, s, q
        As of `PhasePlane`.

    Returns
    -------
    float
        s; infinite for a joint path that cannot be followed at any speed.
    """
    times = PhasePlane(limits, s, q).times()
    return np.inf if times is None else float(times[-1])


class PhasePlane:
    """Limits along a joint path: slope x + lower <= u <= slope x + upper, and floor <= x <= ceiling.

    Parameters
    ----------
    limits : sequence of Limit
    s : (S,) ndarray
        Path coordinates, ascending.
    q : (S, n) ndarray
        Postures there, rad or m, continuous.
    stations : (P,) ndarray, optional
        Path coordinates, ascending from s[0] to s[-1]; s by default. Derivatives of the joint path are interpolated.
    """

    def __init__(
        self,
        limits: Sequence[Limit],
        s: np.ndarray,
        q: np.ndarray,
        stations: np.ndarray | None = None,
    ) -> None:
        stations = s if stations is None else stations
        q_ds = np.gradient(q, s, axis=0, edge_order=2)
        q_dds = np.gradient(q_ds, s, axis=0, edge_order=2)
        joints = [interpolate(stations, s, part) for part in (q, q_ds, q_dds)]
        self._steps = np.diff(stations)
        self._floor = np.zeros(len(stations))
        self._ceiling = np.full(len(stations), np.inf)
        sloped = []
        for limit in limits:
            if not isinstance(limit, HasPhasePlaneRows):
                continue
            line = limit.phase_plane_rows(stations, *joints)
            if line.u is not None:
                sloped.append((line.u, line.x, line.constant))
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                level = (1.0 - line.constant) / line.x
            highest = np.where(line.x > 0.0, level, np.inf).min(axis=1)
            lowest = np.where(line.x < 0.0, level, 0.0).max(axis=1)
            self._ceiling = np.minimum(self._ceiling, highest)
            self._floor = np.maximum(self._floor, lowest)
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
        if not low[0] <= first <= high[0]:
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
        lowest = self._floor[-1] * (1.0 - 1e-6)  # of the rounding
        if not lowest <= last <= self._ceiling[-1] * (1.0 + 1e-6):
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


def interpolate(places: np.ndarray, s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate values (S, c) at s, (S,), linearly at places, (P,)."""
    return np.column_stack([np.interp(places, s, column) for column in values.T])


def least_speeds(limits: Sequence[Limit]) -> list[Limit]:
    """Limits that ask for a least speed."""
    return [limit for limit in limits if limit.longer_time == "violates"]


def initial_knots(start: InitialGuess) -> np.ndarray:
    """Choose the ends of the knot intervals in normalised time, (N + 1,), for a plan from a guess."""
    breaks = breaks_of(start.problem.task)
    guess = _least_speed_guess(start)
    if guess is None:
        return breaks
    curves, times = guess
    # Switches: times at which the acceleration along the path jumps by a tenth of its range.
    t_norm = times / times[-1]
    middle = 0.5 * (t_norm[1:] + t_norm[:-1])
    acceleration = np.diff(np.diff(curves[:, 0]) / np.diff(t_norm)) / np.diff(middle)
    # Changes by less than 0.01 paths per square of the duration are rounding.
    jumps = np.abs(np.diff(acceleration)) > max(0.1 * np.ptp(acceleration), 1e-2)
    switches = middle[1:-1][jumps]
    if not len(switches):
        return breaks
    is_refined = start.problem.task.spline.intervals == "auto"
    return grade_knots(
        np.union1d([0.0, 1.0], switches), 60 if is_refined else len(breaks) - 1
    )


def grade_knots(switches: np.ndarray, count: int) -> np.ndarray:
    """Find the ends, (count + 1,), of so many intervals, m + g d long at distances d from the nearest switch."""
    halves = np.repeat(0.5 * np.diff(switches), 2)
    # With more intervals than the least length needs all of them become shorter: slopes over 1e-9 of the time would
    # say nothing.
    low = 1e-5
    high = 1.0
    for _ in range(60):
        least = np.sqrt(low * high)
        numbers = np.log1p(_GRADING * halves / least) / _GRADING  # in every half
        low, high = (least, high) if numbers.sum() > count else (low, least)
    behind = np.append(0.0, np.cumsum(numbers))
    wanted = np.linspace(0.0, behind[-1], count + 1)
    half = np.searchsorted(behind, wanted, side="right") - 1
    half = np.clip(half, 0, len(halves) - 1)
    is_after = half % 2 == 0  # the nearest switch
    away = np.where(is_after, wanted - behind[half], behind[half + 1] - wanted)
    distance = least / _GRADING * np.expm1(_GRADING * away)
    after = switches[half // 2] + distance
    before = switches[half // 2 + 1] - distance
    breaks = np.where(is_after, after, before)
    return np.concatenate([[0.0], breaks[1:-1], [1.0]])


def initial_guess(program: Program, start: InitialGuess) -> np.ndarray | None:
    """Fit splines to the joint path of a guess, as `starting_point` does.

    Parameters
    ----------
    program : Program
    start : InitialGuess

    Returns
    -------
    (v,) ndarray or None
    """
    guesses = ((_least_speed_guess(start), True), (_moving_ends_guess(start), False))
    for guess, keep in guesses:
        if guess is None:
            continue
        curves, times = guess
        # Even times: the run-up to a speed is passed in milliseconds.
        even = np.linspace(0.0, times[-1], 64 * _STATIONS)
        motion = interpolate(even, times, curves)
        x = starting_point(program, [motion], times[-1], keep=keep)
        if x is not None:
            return x
    return starting_point(
        program, [start.joint_path], start.estimate if start.timed else None
    )


def _least_speed_guess(start: InitialGuess) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves along the joint path, (S, c), and their times, (S,), s; None if no limit asks for a least speed."""
    return _phase_plane_guess(start) if least_speeds(start.problem.limits) else None


def _moving_ends_guess(start: InitialGuess) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves and times likewise for a joint path between moving ends that is not a motion's yet; else None."""
    first, last = start.problem.end_rates
    if start.timed or first == last == 0.0:
        return None
    guess = _phase_plane_guess(start)
    if guess is None:
        return None
    curves, times = guess
    s = curves[:, 0]
    with np.errstate(invalid="ignore"):  # 0 / 0 for a motion that starts from rest
        even = 2.0 * s / (first + np.sqrt(first**2 + (last**2 - first**2) * s))
    return curves, 0.5 * (times + np.nan_to_num(even))


def _phase_plane_guess(start: InitialGuess) -> tuple[np.ndarray, np.ndarray] | None:
    """Curves along the joint path, (S, c), and when the phase plane passes them, (S,), s; None if it cannot."""
    problem = start.problem
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = postures_along(start, s)
    if q is None:
        return None
    stations = spread_stations(problem.limits)
    times = PhasePlane(problem.limits, s, q, stations).times(problem.end_rates)
    if times is None or not np.isfinite(times[-1]):
        return None
    return _curves_along(start, stations), times


def _curves_along(start: InitialGuess, s: np.ndarray) -> np.ndarray:
    """Curves, (S, c), of a guess at path coordinates, (S,)."""
    path = start.joint_path
    return np.column_stack([s, interpolate(s, path[:, 0], path)[:, 1:]])


def postures_along(start: InitialGuess, s: np.ndarray) -> np.ndarray | None:
    """Postures of a guess, (S, n), at path coordinates, (S,); None if some do not exist."""
    q = start.joint_map.postures(_curves_along(start, s))
    return q if np.isfinite(q).all() else None


def spread_stations(limits: Sequence[Limit]) -> np.ndarray:
    """Spread stations evenly, and ever closer towards places at which a least speed sets in or ends."""
    even = np.linspace(0.0, 1.0, _STATIONS)
    steps = even[1] * 0.5 ** np.arange(12)
    breaks = [limit.breaks for limit in least_speeds(limits)]
    near = np.concatenate([np.empty(0), *breaks])[:, None] + np.r_[-steps, 0.0, steps]
    places = np.union1d(even, np.clip(near, 0.0, 1.0))
    return places[np.append(np.diff(places) > 0.5 * steps[-1], True)]
