"""The fastest timing of the joint path of a phase. The phase plane (`timing`) finds it within milliseconds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import cut, drop_near, spread
from brachis.errors import UnreachableError
from brachis.optimise.boundary import Boundary
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.timing import Course, TimedCourse, Timing, divide_turns

PLACES = 4000
"""Minimum number of places at which a joint path is timed. With half as many, splines are up to 0.4 % slower."""
_PLACES_A_PIECE = 24
"""Number of places in each piece of a path, unless there are very many pieces."""
_MOST_PLACES = 40_000
"""Approximate maximum number of places in all pieces together."""
_ROUGH_AGREEMENT = 1e-3
"""Relative change of the time at which a rough timing ends."""
_SLOWER = (1.0, 0.999, 0.995, 0.985, 0.97, 0.95, 0.92, 0.85)
"""Factors on the speeds in which phases meet, tried one after the other until the limits allow a timing. A solution
meets the limits only at its points; on programs of three seams, 0.92 was enough."""
_LEAST_PLACES = 12
"""Minimum number of places in each knot interval."""
_FEW_PLACES = 2
"""Minimum number of places in each knot interval for a rough timing."""
_LOSS_OF_SWITCHES = 0.1
"""Time that all switches within steps between stations together may cost, in mean steps. With 4000 places this is
0.0025 % of the time. Without this bound, motions in which drives bring a slide to its speed within microseconds were
0.01 % slower, and their ramps could not be told from rest."""
_SHARE_OF_STEP = 0.1
"""Time that a step may cost after it is divided, as a fraction of its share of this time."""
_MOST_PARTS = 64
"""Maximum number of parts into which a step is divided at once."""
_TIMINGS = 7
"""Maximum number of times that a joint path is timed. Six divisions resolve ramps as short as 1e-9 of the time."""


@dataclass(frozen=True)
class PhaseTiming:
    """The fastest timing of a phase's joint path.

    Attributes
    ----------
    course : TimedCourse
    rates : tuple of float
        Rates of the joint path's length at both ends, 1/s.
    boundary : Boundary
        Conditions at both ends, without free speeds.
    timing : Timing or None
        The timing; None if the limits allow none. Because of rounding, they may reject even that of the motion itself.
    fixed_duration : float or None
        Duration of the phase if it is given, s.
    """

    course: TimedCourse
    rates: tuple[float, float]
    boundary: Boundary
    timing: Timing | None
    fixed_duration: float | None = None

    @property
    def t_end(self) -> float:
        """Duration of the phase, s; infinite without a timing."""
        if self.timing is None:
            return np.inf
        return self.timing.t_end if self.fixed_duration is None else self.fixed_duration

    @classmethod
    def of(
        cls, phase: Phase, x: np.ndarray, *, is_rough: bool = False
    ) -> PhaseTiming | None:
        """Time the joint path of a phase. Return None if its speed is given or the path cannot be evaluated.

        If `is_rough`, the path is timed only once. Ramps are not resolved, and if there are many intervals, the path is
        timed at fewer places in each.
        """
        if phase.time_law is not None:
            return None
        motion = phase.motion(x)
        least = _FEW_PLACES if is_rough else _LEAST_PLACES
        count = max(least, -(-PLACES // phase.intervals))
        t = spread(motion.breaks / motion.t_end, count) * motion.t_end
        at_ends = np.array(motion.at(t[[0, -1]])).swapaxes(0, 1)
        boundary = phase.boundary.with_speeds(at_ends)

        def lay(t: np.ndarray) -> PhaseTiming:
            """Time the joint path at stations given by times, (P,)."""

            def course_at(t: np.ndarray) -> Course:
                """Return the curves at times, (P,)."""
                return Course(t, *motion.at(t)[:3])

            fine = _lay_finely(phase, course_at, t)
            course = TimedCourse(fine, phase.joint_map, phase.limits)
            rates = float(course.speeds[0]), float(course.speeds[-1])
            return cls(course, rates, boundary, course.solve(rates))

        try:
            return lay(t) if is_rough else _resolve_ramps(lay, t)
        except UnreachableError:
            return None

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
        """Time a joint path; raise UnreachableError if it leaves the joint map.

        Parameters
        ----------
        phase : Phase
        course_at : callable
            Function that returns the curves at ascending path coordinates, (P,).
        ends : tuple of float
            Path coordinates of both ends.
        places : int, optional
            Minimum number of places at which the path is timed; a third of this number if `is_rough`.
        is_rough : bool, optional
            Whether the path is timed only once, at evenly spread places. This gives the time to within 1 %.
        """
        path = phase.joint_map.path
        assert path is not None
        begin, end = ends
        boundary = phase.boundary.with_speeds()
        pieces = drop_near(cut(path.knots, begin, end), tolerances.PATH)
        number = len(pieces) - 1
        count = max(places, min(_PLACES_A_PIECE * number, _MOST_PLACES))

        def lay(
            s: np.ndarray, estimate: tuple[np.ndarray, np.ndarray] | None = None
        ) -> tuple[TimedCourse, tuple[float, float]]:
            """Build the course over path coordinates, (S,), and find its rates at both ends."""
            course = _lay_finely(phase, course_at, s)
            sdot = None if estimate is None else np.interp(course.p, *estimate)
            timed = TimedCourse(course, phase.joint_map, phase.limits, sdot)
            return timed, tuple(timed.speeds[[0, -1]] * boundary.rates)

        course, by_length = lay(spread(pieces, -(-count // (3 * number))))
        timing = course.solve(by_length, agreement=_ROUGH_AGREEMENT)
        law = phase.time_law
        duration = None if law is None else law.duration
        if timing is None or is_rough:
            return cls(course, by_length, boundary, timing, duration)
        # Place stations at equal time steps of this timing.
        t = np.linspace(0.0, timing.t_end, count)
        y, ydot = course.curves(timing, t)
        passed = np.maximum.accumulate(y[:, 0])
        s = drop_near(np.union1d(passed.clip(begin, end), pieces), tolerances.PATH)
        s[0] = begin
        del course, timing, y  # they need a lot of memory

        def time_at(s: np.ndarray) -> PhaseTiming:
            """Time the course at path coordinates, (S,)."""
            course, by_length = lay(s, (passed, ydot[:, 0]))
            solved = course.solve(by_length)
            return cls(course, by_length, boundary, solved, duration)

        return _resolve_ramps(time_at, s)

    @classmethod
    def through(
        cls,
        phase: Phase,
        curves: np.ndarray,
        places: int = PLACES,
        *,
        is_rough: bool = False,
    ) -> PhaseTiming:
        """Time a joint path through curves, (S, c), of which the first is s; see `along`."""
        curves = curves[np.append(True, np.diff(curves[:, 0]) > tolerances.PATH)]
        begin, end = curves[[0, -1], 0]
        course_at = partial(Course.through, curves)
        return cls.along(phase, course_at, (begin, end), places, is_rough=is_rough)


def _resolve_ramps(
    time_at: Callable[[np.ndarray], PhaseTiming], stations: np.ndarray
) -> PhaseTiming:
    """Time a joint path at stations, (P,), and at further stations where the timing switches within a step."""
    for _ in range(_TIMINGS - 1):
        phase_timing = time_at(stations)
        finer = _divide_switches(phase_timing)
        if finer is None:
            return phase_timing
        stations = finer
        del phase_timing  # two timings at a time need too much memory
    return time_at(stations)


def _divide_switches(phase_timing: PhaseTiming) -> np.ndarray | None:
    """Divide the steps in which switches of a timing cost too much time; return None if there are no such steps."""
    timing = phase_timing.timing
    if timing is None:
        return None
    jumps = np.pad(np.abs(np.diff(timing.acceleration)), 1)
    change = np.maximum(jumps[1:], jumps[:-1])
    fastest = np.maximum(timing.rate[1:], timing.rate[:-1])
    lost = change * np.diff(timing.times) ** 2 / (8.0 * fastest * timing.t_end)
    allowed = _LOSS_OF_SWITCHES / len(lost)
    counts = np.ceil(np.sqrt(lost / (_SHARE_OF_STEP * allowed))).clip(1, _MOST_PARTS)
    if lost.sum() <= allowed or counts.max() == 1:
        return None
    return spread(phase_timing.course.places, counts.astype(int))


def _lay_finely(
    phase: Phase, course_at: Callable[[np.ndarray], Course], p: np.ndarray
) -> Course:
    """Build a course over stations, (P,), and over further stations where the joint path turns."""
    state = course_at(p).state(phase.joint_map)
    return course_at(divide_turns(p, state.qdot))


def time_phases(program: Program, x: np.ndarray) -> list[PhaseTiming | None]:
    """Time the joint paths of all phases of a motion, (v,); see `PhaseTiming.of`.

    If phases meet in motion, they meet at lower speeds if the limits allow no timing with those of the motion.
    """
    for factor in _SLOWER if program.flies else _SLOWER[:1]:
        slower = program.scale_time(x, 1.0 / factor)
        timings = [PhaseTiming.of(*pair) for pair in program.split(slower)]
        if all(entry is None or entry.timing for entry in timings):
            break
    return timings
