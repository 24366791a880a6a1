"""Least time along a fixed joint path: the phase plane of s and ds/dt.

With u = d2s/dt2 and x = (ds/dt)^2, limits along a joint path q(s) are lines in (u, x) (`Limit.lines`):

    a(s) u + b(s) x + c(s)   in [-1, 1],

for torques a = M q_ds / tau_max, b = (M q_dds + C(q, q_ds) q_ds) / tau_max and c the torque at rest; those that do not
ask for u are ceilings or floors for x. Backwards along the joint path, the largest x from which the next station's
interval can be reached is kept; forwards, the largest u that stays within is taken (Pham, Pham, IEEE Trans. Robotics
34(3), 2018). Torque may jump here, and viscous and Coulomb friction are left out, so the time is an estimate by which
joint paths are ranked, no bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.limits import Limit

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
    return None if rate is None else np.append(0.0, np.cumsum(2.0 * np.diff(places) / (rate[1:] + rate[:-1])))


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


def _squares(lines: _Lines, steps: np.ndarray, rates: tuple[float, float]) -> np.ndarray | None:
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


def _lines(limits: Sequence[Limit], s: np.ndarray, q: np.ndarray, places: np.ndarray) -> _Lines:
    """Collect the lines of all limits at places of a joint path."""
    q_ds = np.gradient(q, s, axis=0, edge_order=2)
    orders = q, q_ds, np.gradient(q_ds, s, axis=0, edge_order=2)
    joints = [np.column_stack([np.interp(places, s, column) for column in order.T]) for order in orders]
    lines = [limit.lines(places, *joints) for limit in limits]
    floor, ceiling = np.zeros(len(places)), np.full(len(places), np.inf)
    sloped = []
    for line in lines:
        if line is None:
            continue
        if line.u is None:
            with np.errstate(divide="ignore", invalid="ignore"):
                level = (1.0 - line.constant) / line.x
            ceiling = np.minimum(ceiling, np.where(line.x > 0.0, level, np.inf).min(axis=1))
            floor = np.maximum(floor, np.where(line.x < 0.0, level, 0.0).max(axis=1))
        else:
            sloped.append((line.u, line.x, line.constant))
    a, b, c = (np.concatenate(parts, axis=1) for parts in zip(*sloped, strict=True))
    # A coefficient of zero would make a vertical line; a tiny one gives bounds far out that do no harm.
    a = np.where(np.abs(a) < _SLOWEST, _SLOWEST, a)
    first, second = (1.0 - c) / a, (-1.0 - c) / a
    return _Lines((-b / a, -b / a), (np.maximum(first, second), np.minimum(first, second)), floor, ceiling)


def _controllable(lines: _Lines, steps: np.ndarray, last: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Go backwards: the intervals of x, (S,), from which the end can be reached with x = `last`; None where empty."""
    slope, offset = lines.slope, lines.offset
    count = len(lines.ceiling)
    if not lines.floor[-1] * (1.0 - _ROUNDING) <= last <= lines.ceiling[-1] * (1.0 + _ROUNDING):
        return None
    low, high = np.full(count, last), np.full(count, last)
    for i in range(count - 2, -1, -1):
        step = steps[i]
        # u >= (low' - x) / 2 step and u <= (high' - x) / 2 step join the lines.
        up = np.append(slope[0][i], -0.5 / step), np.append(offset[0][i], 0.5 * high[i + 1] / step)
        down = np.append(slope[1][i], -0.5 / step), np.append(offset[1][i], 0.5 * low[i + 1] / step)
        tilt = (up[0][:, None] - down[0][None]).ravel()
        clearance = (up[1][:, None] - down[1][None]).ravel()
        if np.any((clearance < 0.0) & (np.abs(tilt) < _SLOWEST)):
            return None
        falling, rising = tilt < -_SLOWEST, tilt > _SLOWEST
        high[i] = min(lines.ceiling[i], np.min(clearance[falling] / -tilt[falling], initial=np.inf))
        low[i] = max(lines.floor[i], np.max(-clearance[rising] / tilt[rising], initial=0.0))
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
