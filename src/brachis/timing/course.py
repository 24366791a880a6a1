"""The curves y(p) of a joint map along a path parameter, and the fastest timing of the joint path that they make."""

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
    """Curves of a joint map at stations, with their derivatives by a path parameter p.

    Attributes
    ----------
    p : (P,) ndarray
        For example the time of a known motion, s.
    y, y_dp, y_ddp : (P, c) ndarray
    """

    p: np.ndarray
    y: np.ndarray
    y_dp: np.ndarray
    y_ddp: np.ndarray

    @classmethod
    def through(cls, curves: np.ndarray, s: np.ndarray) -> Course:
        """Lay cubic splines through curves, (S, c), the first of them the path coordinate, and take them at s, (P,)."""
        spline = Spline.through(curves[:, 0], curves[:, 1:])
        return cls.over_path(s, [spline(s, nu) for nu in range(3)])

    @classmethod
    def over_path(cls, s: np.ndarray, other_curves: Iterable[np.ndarray]) -> Course:
        """Join path coordinates, (P,), and other curves with two derivatives by these, (3, P, c - 1)."""
        s_orders = (s, np.ones_like(s), np.zeros_like(s))  # s and its derivatives by s
        return cls(s, *map(np.column_stack, zip(s_orders, other_curves, strict=True)))

    def state(self, joint_map: JointMap) -> JointState:
        """Joint motion at the stations if p is the time; raises UnreachableError where the joint map has no posture."""
        still = np.zeros_like(self.y)
        t = self.p - self.p[0]
        return joint_map.state(self.y, self.y_dp, self.y_ddp, still, t=t)


class TimedCourse:
    """The fastest timing of a course.

    Parameters
    ----------
    course : Course
    joint_map : JointMap
        Of its curves.
    limits : sequence of Limit
    rate : (P,) ndarray, optional
        About how fast the parameter of the course will grow at its stations, 1/s.

    Attributes
    ----------
    path : JointPath
        By its length, at the stations at which the joints move.
    places : (P',) ndarray
        Values of the parameter of the course at these.
    speeds : (P,) ndarray
        How fast its length grows with the parameter of the course, at all stations of this.

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
        # Where the joints stand still slopes are those of the station behind it, or before the end.
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
        """Find the fastest timing with the rates of the path's length at both ends, 1/s; see `PhasePlane`."""
        self._plane.narrow(narrower)
        return self._plane.solve(rates, agreement)

    def curves(self, timing: Timing, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Curves and their rates, (K, c), at times (K,), s: cubics between stations, lines beyond the ends."""
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
        """Joint accelerations half-way between the stations, (P - 1, n), each as what it takes of a limit."""
        motion = Passage(self.path.middles(), timing.middle_rate, timing.acceleration)
        return motion.qddot * self._plane.weights
