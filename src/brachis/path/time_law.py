"""The time law of a leg with a given speed v of the tool: s(t) with ds/dt = v / g(s).

g(s) is the distance that the tool moves per unit s. t(s) is the integral of g / v, and s(t) its inverse function:

    sdot = v / g,    sddot = -v^2 g' / g^3,    sdddot = v^3 (3 g'^2 - g g'') / g^5

If g is constant, as on lines and circles, s(t) is linear. Otherwise s(t) is a spline through points (t(s), s) that is
refined until the speed is correct between these points as well. The knots of the spline are double where the path is
not analytic, so that the spline is C3 there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import greville, spread
from brachis.errors import PathError
from brachis.path.legs import Leg
from brachis.path.protocol import Array
from brachis.path.sequence import Path, integrate, tool_derivatives
from brachis.robot import TaskMap
from brachis.task.points.points import sum_up

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
"""Degree of the spline, if the time law is not linear."""
_ACCURACY = 2e-10
"""Maximum relative deviation from the given speed, without the rounding of times."""
_LEAST_ACCURACY = 1e-7
"""Maximum relative deviation including the rounding of times, which matters if the path turns within micrometres."""
_MOST_INTERVALS = 20_000


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """The path coordinate as a function of time on a leg with a given speed.

    Attributes
    ----------
    duration : float
        Duration of the leg, s.
    spline : BSpline
        The path coordinate s over the time t in [0, duration], s.
    ends : (2, 4) ndarray
        s and its first three time derivatives, per second, at the beginning and at the end, without the error of the
        spline.
    """

    duration: float
    spline: BSpline
    ends: Array

    def at(self, t: Array) -> Array:
        """Return s and its first three time derivatives, (4, K), per second, at times t, (K,), s."""
        return np.stack([self.spline(t, nu=order) for order in range(4)])


def time_law_of(leg: Leg, task_map: TaskMap, path: Path) -> TimeLaw | None:
    """Return the time law of a leg; None if its speed is free.

    Parameters
    ----------
    leg : Leg
    task_map : TaskMap
    path : Path
        The whole path.

    Raises
    ------
    PathError
        The path bends too abruptly for a spline.
    """
    if leg.speed is None:
        return None
    from scipy.interpolate import BSpline

    tool = _ToolAlongPath(task_map, path.between(leg.begin, leg.end), leg.speed)
    knots = tool.path.knots
    distances = tool.slopes(spread(knots, 32))[0]
    if np.ptp(distances) <= tolerances.ROUNDING * distances.max():
        rate = leg.speed / float(distances.mean())
        duration = (leg.end - leg.begin) / rate
        ends = np.array([[leg.begin, rate, 0.0, 0.0], [leg.end, rate, 0.0, 0.0]])
        times = np.array([0.0, 0.0, duration, duration])
        line = BSpline(times, ends[:, 0], 1)
        return TimeLaw(duration, line, ends)
    ends = tool.rates(np.array([leg.begin, leg.end])).T
    breaks = knots
    while True:
        spline = _interpolate(tool, breaks, np.isin(breaks, knots), ends)
        duration = float(spline.t[-1])
        deviation = _deviations(tool, spline)
        rounding = 16.0 * np.finfo(float).eps * duration / np.diff(np.unique(spline.t))
        is_off = deviation > np.minimum(_ACCURACY + rounding, _LEAST_ACCURACY)
        if not is_off.any():
            return TimeLaw(duration, spline, ends)
        middles = 0.5 * (breaks[:-1] + breaks[1:])
        if len(breaks) > _MOST_INTERVALS:
            break
        breaks = np.union1d(breaks, middles[is_off])
    worst = float(middles[np.argmax(deviation)])
    raise PathError(
        "the path bends too abruptly for a constant speed of the tool",
        s_interval=(worst, worst),
        where="tool_limits.process_speed",
        found=f"a speed that is {deviation.max():.2g} off with {len(breaks) - 1} intervals, at s = {worst:.4g}",
        allowed=f"{_LEAST_ACCURACY:g} (relative)",
        hint="Make the path smoother there",
    )


@dataclass(frozen=True, eq=False)
class _ToolAlongPath:
    """The distance that the tool moves along a part of a path that it travels at a given speed, m/s."""

    task_map: TaskMap
    path: Path
    speed: float

    def slopes(self, s: Array) -> Array:
        """Return the distances per unit s and their first two derivatives with respect to s, (3, K), m."""
        v, v_ds, v_dds = tool_derivatives(self.task_map, self.path, s)
        g = np.linalg.norm(v, axis=1)
        g_ds = (v * v_ds).sum(axis=1) / g
        g_dds = ((v_ds * v_ds + v * v_dds).sum(axis=1) - g_ds**2) / g
        return np.stack([g, g_ds, g_dds])

    def rates(self, s: Array) -> Array:
        """Return path coordinates s, (K,), and their first three time derivatives, (4, K)."""
        g, g_ds, g_dds = self.slopes(s)
        v = self.speed
        return np.stack(
            [s, v / g, -(v**2) * g_ds / g**3, v**3 * (3.0 * g_ds**2 - g * g_dds) / g**5]
        )

    def times(self, s: Array) -> Array:
        """Return the times, (K,), s, at ascending path coordinates, counted from the first one."""
        distances = integrate(lambda nodes: self.slopes(nodes)[0], s)
        return sum_up(distances / self.speed)


def _interpolate(
    tool: _ToolAlongPath, breaks: Array, is_double: np.ndarray, ends: Array
) -> BSpline:
    """Return the spline that interpolates s at its Greville abscissae (times), with given rates at the ends.

    Parameters
    ----------
    tool : _ToolAlongPath
    breaks : (N + 1,) ndarray
        Path coordinates of the knots.
    is_double : (N + 1,) ndarray
        Whether each knot occurs twice.
    ends : (2, 4) ndarray
        Values and rates of s at both ends, as in `TimeLaw`.
    """
    from scipy.interpolate import make_interp_spline

    often = np.where(is_double, 2, 1)
    often[[0, -1]] = DEGREE + 1
    knots = np.repeat(breaks, often)
    # Two rates at each end replace the two abscissae closest to it.
    inner = greville(knots, DEGREE)[3:-3]
    sites = np.concatenate([breaks[:1], inner, breaks[-1:]])
    every = np.union1d(breaks, sites)
    times = tool.times(every)
    at_knots = times[np.searchsorted(every, knots)]
    at_sites = times[np.searchsorted(every, sites)]
    first, last = ([(1, rates[1]), (2, rates[2])] for rates in ends)
    # SciPy documents conditions on chosen derivatives, but its type stubs lack them.
    return make_interp_spline(
        at_sites,
        sites,
        k=DEGREE,
        t=at_knots,
        bc_type=(first, last),  # type: ignore[arg-type]
    )


def _deviations(tool: _ToolAlongPath, spline: BSpline) -> Array:
    """Return the largest relative deviation from the given speed in each knot interval, (N,)."""
    times = np.unique(spline.t)
    t = times[:-1, None] + np.diff(times)[:, None] * (np.arange(8) + 0.5) / 8
    s = spline(t.ravel())
    distances = tool.slopes(s)[0]
    speeds = spline(t.ravel(), nu=1) * distances
    return np.abs(speeds / tool.speed - 1.0).reshape(t.shape).max(axis=1)
