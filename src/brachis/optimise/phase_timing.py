"""The fastest timing of the joint path of a phase, known from the phase plane within milliseconds (`timing`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import cut, drop_near, spread
from brachis.errors import UnreachableError
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.timing import Course, TimedCourse, Timing, divide_turns

PLACES = 4000
"""Places at which a joint path is timed, no fewer: with half of them splines were up to 0.4 % slower."""
_PLACES_A_PIECE = 24
"""Places in every piece of a path, unless there are very many of these."""
_MOST_PLACES = 40_000
"""Places in all pieces together, about."""
_ROUGHLY = 1e-3
"""Change of the time, as a part of it, with which a rough timing ends."""
_LEAST_PLACES = 12
"""Places in every knot interval, no fewer."""
_MOVES = 1e-3
"""Part of the largest d2p/dt2 from which on a station counts: at others the motion cruises."""
_USUAL = 0.98
"""Part of these stations whose d2p/dt2 is usual."""
_SPIKE = 3.0
"""Times the usual d2p/dt2 that splines can follow."""


@dataclass(frozen=True)
class PhaseTiming:
    """A phase's motion beside the fastest timing of its joint path.

    Attributes
    ----------
    course : TimedCourse
    rates : tuple of float
        Of the path's length at both ends, 1/s.
    timing : Timing or None
        None where the limits allow none, not even the motion's own, within rounding.
    given : float or None
        Duration where it is given, s.
    """

    course: TimedCourse
    rates: tuple[float, float]
    timing: Timing | None
    given: float | None = None

    @property
    def t_end(self) -> float:
        """Duration, s; infinite without a timing."""
        if self.timing is None:
            return np.inf
        return self.timing.t_end if self.given is None else self.given

    @classmethod
    def of(cls, phase: Phase, x: np.ndarray) -> PhaseTiming | None:
        """Time the joint path of a phase; None where its speed is given, or where it cannot be evaluated."""
        if phase.time_law is not None:
            return None
        motion = phase.motion(x)
        count = max(_LEAST_PLACES, -(-PLACES // phase.intervals))
        t = spread(motion.breaks / motion.t_end, count) * motion.t_end

        def course_at(t: np.ndarray) -> Course:
            """Take the curves at times, (P,)."""
            return Course(t, *motion.at(t)[:3])

        try:
            fine = _lay_finely(phase, course_at, t)
            course = TimedCourse(fine, phase.joint_map, phase.limits)
        except UnreachableError:
            return None
        rates = float(course.speeds[0]), float(course.speeds[-1])
        return cls(course, rates, course.solve(rates))

    def without_spikes(self) -> PhaseTiming:
        """Time again where the timing all but stops for an instant, as no spline does: only as fast as they can."""
        if self.timing is None:
            return self
        most = largest_acceleration(self.timing)
        if np.abs(self.timing.acceleration).max() <= most:
            return self
        return replace(self, timing=self.course.solve(self.rates, {}, most))

    @classmethod
    def along(
        cls,
        phase: Phase,
        course_at: Callable[[np.ndarray], Course],
        ends: tuple[float, float],
        places: int = PLACES,
        *,
        is_rough: bool = False,
    ) -> PhaseTiming:
        """Time a joint path; raise UnreachableError if it leaves the map.

        Parameters
        ----------
        phase : Phase
            With its rates at the ends.
        course_at : callable
            Curves at ascending path coordinates, (P,).
        ends : tuple of float
            Path coordinates.
        places : int, optional
            Where it is timed, no fewer; a third of them if `is_rough`.
        is_rough : bool, optional
            Whether it is timed once, at places spread evenly along the path. That is right within 1 %.
        """
        path = phase.joint_map.path
        assert path is not None
        begin, end = ends
        pieces = drop_near(cut(path.knots, begin, end), tolerances.PATH)
        number = len(pieces) - 1
        count = max(places, min(_PLACES_A_PIECE * number, _MOST_PLACES))

        def lay(
            s: np.ndarray, estimate: tuple[np.ndarray, np.ndarray] | None = None
        ) -> tuple[TimedCourse, tuple[float, float]]:
            """Lay the course over path coordinates, (S,), and find its rates at both ends."""
            course = _lay_finely(phase, course_at, s)
            sdot = None if estimate is None else np.interp(course.p, *estimate)
            timed = TimedCourse(course, phase.joint_map, phase.limits, sdot)
            return timed, tuple(timed.speeds[[0, -1]] * phase.boundary.rates)

        course, by_length = lay(spread(pieces, -(-count // (3 * number))))
        timing = course.solve(by_length, agreement=_ROUGHLY)
        law = phase.time_law
        given = None if law is None else law.duration
        if timing is None or is_rough:
            return cls(course, by_length, timing, given)
        # Stations where the motion takes its time.
        t = np.linspace(0.0, timing.t_end, count)
        y, ydot = course.curves(timing, t)
        passed = np.maximum.accumulate(y[:, 0])
        s = drop_near(np.union1d(passed.clip(begin, end), pieces), tolerances.PATH)
        s[0] = begin
        course, by_length = lay(s, (passed, ydot[:, 0]))
        return cls(course, by_length, course.solve(by_length), given)

    @classmethod
    def through(
        cls,
        phase: Phase,
        curves: np.ndarray,
        places: int = PLACES,
        *,
        is_rough: bool = False,
    ) -> PhaseTiming:
        """Time a joint path through curves, (S, c), the first of them s; see `along`."""
        curves = curves[np.append(True, np.diff(curves[:, 0]) > tolerances.PATH)]
        begin, end = curves[[0, -1], 0]
        course_at = partial(Course.through, curves)
        return cls.along(phase, course_at, (begin, end), places, is_rough=is_rough)


def _lay_finely(
    phase: Phase, course_at: Callable[[np.ndarray], Course], p: np.ndarray
) -> Course:
    """Lay a course over stations, (P,), and others between them where the joint path turns."""
    state = course_at(p).state(phase.joint_map)
    return course_at(divide_turns(p, state.qdot))


def largest_acceleration(timing: Timing) -> float:
    """Largest d2p/dt2 that splines can follow, 1/s^2."""
    sizes = np.abs(timing.acceleration)
    return float(_SPIKE * np.quantile(sizes[sizes >= _MOVES * sizes.max()], _USUAL))


def time_phases(program: Program, x: np.ndarray) -> list[PhaseTiming | None]:
    """Time the joint paths of all phases of a motion, (v,); see `PhaseTiming.of`."""
    return [PhaseTiming.of(*pair) for pair in program.split(x)]
