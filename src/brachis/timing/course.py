"""The curves y(p) of a joint map along a path parameter, and the fastest timing of the joint path that they define."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.kernel import Spline
from brachis.kinematics import JointMap, JointState
from brachis.limits import Limit
from brachis.timing.joint_path import JointPath, Passage, Timing
from brachis.timing.phase_plane import AGREEMENT, PhasePlane


@dataclass(frozen=True)
class Course:
    """Curves of a joint map at stations, with their derivatives with respect to a path parameter p.

    Attributes
    ----------
    p : (P,) ndarray
        Path parameter; for example, the time of a known motion, s.
    y, y_dp, y_ddp : (P, c) ndarray
    """

    p: np.ndarray
    y: np.ndarray
    y_dp: np.ndarray
    y_ddp: np.ndarray

    @classmethod
    def through(cls, curves: np.ndarray, s: np.ndarray) -> Course:
        """Evaluate cubic splines through curves, (S, c), of which the first is the path coordinate, at s, (P,)."""
        spline = Spline.through(curves[:, 0], curves[:, 1:])
        return cls.over_path(s, [spline(s, nu) for nu in range(3)])

    @classmethod
    def over_path(cls, s: np.ndarray, other_curves: Iterable[np.ndarray]) -> Course:
        """Combine path coordinates, (P,), with the other curves and their two derivatives by s, (3, P, c - 1)."""
        s_orders = (s, np.ones_like(s), np.zeros_like(s))  # s, ds/ds, d2s/ds2
        return cls(s, *map(np.column_stack, zip(s_orders, other_curves, strict=True)))

    def state(self, joint_map: JointMap) -> JointState:
        """Return joint states at the stations, with p as the time. Raise UnreachableError if there is no posture."""
        still = np.zeros_like(self.y)
        t = self.p - self.p[0]
        return joint_map.state(self.y, self.y_dp, self.y_ddp, still, t=t)


class TimedCourse:
    """The fastest timing of a course.

    Parameters
    ----------
    course : Course
    joint_map : JointMap
        Joint map of the curves.
    limits : sequence of Limit
    rate : (P,) ndarray, optional
        Estimate of the rate dp/dt of the course's parameter at the stations, 1/s.

    Attributes
    ----------
    path : JointPath
        The joint path, with its length as the parameter, at the stations at which the joints move.
    places : (P',) ndarray
        Values of the course's parameter p at these stations.
    speeds : (P,) ndarray
        Derivative of the path's length with respect to the course's parameter, at all stations of the course.

    Raises
    ------
    UnreachableError
        The joint map has no posture at a station.
    """

    def __init__(
        self,
        course: Course,
        joint_map: JointMap,
        limits: Sequence[Limit],
        rate: np.ndarray | None = None,
    ) -> None:
        state = course.state(joint_map)
        path = JointPath(course.p, state.s, state.q, state.qdot, state.qddot)
        self.path, places = path.by_length()
        self.places = places
        self.speeds = np.linalg.norm(state.qdot, axis=1)
        speeds = np.interp(places, course.p, self.speeds)
        by_length = None
        if rate is not None:
            by_length = speeds * np.interp(places, course.p, rate)
        self._plane = PhasePlane(limits, self.path, by_length)
        y_dp = interpolate_columns(places, course.p, course.y_dp)
        # Where the joints stand still, use the slopes at the next station at which they move. After the last such
        # station, use its slopes.
        moving = np.flatnonzero(speeds > 0.0)
        behind = np.searchsorted(moving, np.arange(len(speeds)))
        beside = moving[behind.clip(max=len(moving) - 1)]
        self._y = interpolate_columns(places, course.p, course.y)
        self._slopes = y_dp[beside] / speeds[beside, None]

    def solve(
        self,
        rates: tuple[float, float],
        narrower: Mapping[Limit, np.ndarray] = MappingProxyType({}),
        agreement: float = AGREEMENT,
    ) -> Timing | None:
        """Find the fastest timing with given rates of the joint path's length at both ends, 1/s; see `PhasePlane`."""
        self._plane.narrow(narrower)
        return self._plane.solve(rates, agreement)

    def curves(self, timing: Timing, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return curves and their rates, (K, c), at times, (K,), s; cubic between stations, linear beyond the ends."""
        beyond = t - np.clip(t, 0.0, timing.t_end)
        t = t - beyond
        i = np.searchsorted(timing.times, t, side="right") - 1
        i = np.clip(i, 0, len(timing.acceleration) - 1)
        ahead = t - timing.times[i]
        acceleration = timing.acceleration[i]
        jerk = timing.jerk[i]
        remaining = np.diff(timing.times)[i] - ahead
        rate = timing.rate[i] + (acceleration - 0.5 * jerk * remaining) * ahead
        mean = 0.5 * acceleration - jerk * (remaining + ahead / 3.0) / 4.0
        distance = (timing.rate[i] + mean * ahead) * ahead
        step = np.diff(self.path.p)[i]
        u = np.clip(distance / step, 0.0, 1.0)[:, None]
        chord = self._y[i + 1] - self._y[i]
        first = self._slopes[i] * step[:, None] - chord
        last = self._slopes[i + 1] * step[:, None] - chord
        bump = (1.0 - u) * first - u * last
        y = self._y[i] + u * (chord + (1.0 - u) * bump)
        by_u = chord + (1.0 - 2.0 * u) * bump - u * (1.0 - u) * (first + last)
        ydot = by_u * (rate / step)[:, None]
        return y + ydot * beyond[:, None], ydot

    def accelerations(self, timing: Timing) -> np.ndarray:
        """Return joint accelerations midway between the stations, (P - 1, n), each as a fraction of a limit."""
        motion = Passage(self.path.middles(), timing.middle_rate, timing.acceleration)
        return motion.qddot * self._plane.weights
