"""The fastest timing of a motion's own joint path, and the splines that follow it.

The fastest timing of a joint path is known from the phase plane within milliseconds (`timing`). Splines follow it
(`timed_splines`). Where they exceed a limit, the limits are narrowed there, and the timing is computed anew.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.errors import UnreachableError
from brachis.limits import Limit
from brachis.optimise.backends import SolverReport, SolveStatus
from brachis.optimise.bspline import clamped_knots, spread
from brachis.optimise.grid import FixedGrid
from brachis.optimise.guess import shortest_time
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.phase import Phase, is_checked_at_points
from brachis.optimise.program import Program
from brachis.optimise.timed_splines import SHORTEST, breaks_for, even_out, fit
from brachis.timing import Course, TimedCourse, Timing, divide_turns, is_left_out

SOLVER = "phase plane"
"""Name of what solves a program by its timing alone."""
PLACES = 4000
"""Places at which a joint path is timed, no fewer: with half of them splines were up to 0.4 % slower."""
_PLACES_A_PIECE = 24
"""Places in every piece of a path, unless there are very many of these."""
_MOST_PLACES = 40_000
"""Places in all pieces together, about."""
_LEAST_PLACES = 12
"""Places in every knot interval, no fewer."""
_ROUNDS = 30
"""Timings with limits that are narrowed, no more."""
_MOVES = 1e-3
"""Part of the largest d2p/dt2 from which on a station counts: at others the motion cruises."""
_USUAL = 0.98
"""Part of these stations whose d2p/dt2 is usual."""
_SPIKE = 3.0
"""Times the usual d2p/dt2 that splines can follow."""
TOO_FAST = 0.01
"""Part of the least time by which a motion is faster that exceeds limits by much between its collocation points."""
_ROUGHLY = 0.05
"""Part of the time that first knots may lose."""
_FIRST_INTERVALS = 16
"""Intervals over which a search begins, about."""
_HALVINGS = 4
"""Times that intervals in which limits are far exceeded are halved, no more."""
_FAR = 0.02
"""Violation of a limit, as a part of it, by which it is far exceeded."""
_LOOKS = 12
"""Times in each interval at which limits are looked at."""
_MOST_INTERVALS = 20_000
"""Intervals of a phase: the verification looks at some 16 instants in each, and at no more than 400,000."""
_FINENESS = (0.001, 0.0001)
"""What intervals may lose together, in tolerances: less where splines had to be much slower than the timing."""
_MANY = 1000
"""Intervals with which another round takes seconds."""
_ENOUGH_IF_MANY = 2.5
_ENOUGH_IF_FEW = 0.5
"""Tolerances by which splines over many, and over few intervals may be slower than the timing."""
_COARSE = (0.01, 0.1, 1.0, 10.0)
"""As `_FINENESS`, along paths so long that there would be too many intervals."""
_BESIDE = 0.5
"""Part of what exceeds a limit by which limits are narrowed in the intervals beside it."""
_NEAR = 1.5e-4
"""Violation of a limit from which on rounds go on only while they gain."""
_ENOUGH = 5e-5
"""Violation of a limit, as a part of it, that is small enough."""


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
    """

    course: TimedCourse
    rates: tuple[float, float]
    timing: Timing | None

    @classmethod
    def of(cls, phase: Phase, x: np.ndarray) -> PhaseTiming | None:
        """Time the joint path of a phase; None where its speed is given, or where it cannot be evaluated."""
        if phase.time_law is not None:
            return None
        motion = phase.motion(x)
        count = max(_LEAST_PLACES, -(-PLACES // phase.intervals))
        t = spread(motion.breaks / motion.t_end, count) * motion.t_end
        try:
            before = phase.joint_map.state(*motion.at(t), t=t)
            t = divide_turns(t, before.qdot)
            y, ydot, yddot, _ = motion.at(t)
            course = TimedCourse(
                Course(t, y, ydot, yddot), phase.joint_map, phase.limits
            )
        except UnreachableError:
            return None
        speeds = course.speeds
        rates = float(speeds[0]), float(speeds[-1])
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
        cls, phase: Phase, curves: np.ndarray, rates: tuple[float, float]
    ) -> PhaseTiming:
        """Time a joint path between rates ds/dt at its ends, 1/s; raise UnreachableError if it leaves the map.

        Parameters
        ----------
        phase : Phase
        curves : (S, c) ndarray
            Values along it: s, not descending, and the redundant curves.
        rates : tuple of float
        """
        path = phase.joint_map.path
        assert path is not None
        curves = curves[np.append(True, np.diff(curves[:, 0]) > tolerances.PATH)]
        begin, end = curves[[0, -1], 0]
        knots = path.knots[(path.knots > begin) & (path.knots < end)]
        ends = np.concatenate([[begin], knots, [end]])
        ends = ends[np.append(np.diff(ends) > tolerances.PATH, True)]
        pieces = len(ends) - 1
        count = max(PLACES, min(_PLACES_A_PIECE * pieces, _MOST_PLACES))

        def lay(s: np.ndarray) -> tuple[TimedCourse, tuple[float, float]]:
            coarse = Course.through(curves, s)
            derivatives = (coarse.y, coarse.y_dp, coarse.y_ddp, np.zeros_like(coarse.y))
            state = phase.joint_map.state(*derivatives, t=s - begin)
            s = divide_turns(s, state.qdot)
            course = Course.through(curves, s)
            timed = TimedCourse(course, phase.joint_map, phase.limits)
            return timed, tuple(timed.speeds[[0, -1]] * rates)

        course, by_length = lay(
            spread(ends, np.full(pieces, -(-count // (3 * pieces))))
        )
        timing = course.solve(by_length)
        if timing is None:
            return cls(course, by_length, None)
        # Stations where the motion takes its time.
        t = np.linspace(0.0, timing.t_end, count)
        s = np.union1d(course.curves(timing, t)[0][:, 0].clip(begin, end), ends)
        s = s[np.append(np.diff(s) > tolerances.PATH, True)]
        s[0] = begin
        course, by_length = lay(s)
        return cls(course, by_length, course.solve(by_length))


def largest_acceleration(timing: Timing) -> float:
    """Largest d2p/dt2 that splines can follow, 1/s^2."""
    sizes = np.abs(timing.acceleration)
    return float(_SPIKE * np.quantile(sizes[sizes >= _MOVES * sizes.max()], _USUAL))


def time_phases(solved: SolvedProgram) -> list[PhaseTiming | None]:
    """Time the joint paths of all phases of a motion; see `PhaseTiming.of`."""
    return [PhaseTiming.of(*pair) for pair in solved.program.split(solved.x)]


def least_time_of(
    program: Program, x: np.ndarray, timings: Sequence[PhaseTiming | None]
) -> float:
    """Return the least time of a motion's own joint paths, s, with the durations that are given, and the pauses."""
    total = 0.0
    for (phase, part), own in zip(program.split(x), timings, strict=True):
        fastest = None if own is None else own.timing
        total += phase.pause + (part[0] if fastest is None else fastest.t_end)
    return float(total)


def _spread_excess(worst: np.ndarray, breaks: np.ndarray, timing: Timing) -> np.ndarray:
    """Spread what exceeds a limit in knot intervals, (N, c), over these and those beside them, (P - 1, c)."""
    padded = np.pad(np.maximum(worst - 0.5 * _ENOUGH, 0.0), ((1, 1), (0, 0)))
    beside = np.maximum(padded[:-2], padded[2:])
    around = np.maximum(padded[1:-1], _BESIDE * beside)
    t_norm = timing.times / timing.t_end
    first = np.searchsorted(breaks, t_norm[:-1], side="right") - 1
    last = np.searchsorted(breaks, t_norm[1:], side="left")
    first = np.clip(first, 0, len(around) - 1)
    pairs = np.column_stack([first, np.maximum(last, first + 1)]).ravel()
    ended = np.pad(around, ((0, 1), (0, 0)))
    return np.asarray(np.maximum.reduceat(ended, pairs)[::2])


def follow(
    phase: Phase, own: PhaseTiming, tolerance: float, points: int
) -> tuple[Phase, np.ndarray] | None:
    """Lay splines along the fastest timing of a phase's joint path, within the limits.

    Parameters
    ----------
    phase : Phase
        With another grid.
    own : PhaseTiming
    tolerance : float
        Part of the time by which they should not be slower.
    points : int
        Collocation points an interval.

    Returns
    -------
    phase : Phase
        Over the knots that the timing needs.
    x : (v,) ndarray
        Its motion, which may still exceed limits by a little; None where the limits allow no timing.
    """
    if own.timing is None:
        return None
    timing = own.without_spikes().timing
    if timing is None:
        return None
    own = replace(own, timing=timing)
    best: tuple[Phase, np.ndarray] | None = None
    least = np.inf
    for fineness in (*_FINENESS, *_COARSE):
        if best is not None and fineness in _COARSE:
            break
        finer = _over_knots(phase, own, fineness * tolerance, points)
        if finer.intervals > _MOST_INTERVALS:
            continue
        finer = _halve_where_exceeded(finer, own, points)
        followed = _follow_within_limits(finer, own)
        if followed is not None and followed[0] < least:
            least, x = followed
            best = finer, x
        enough = _ENOUGH_IF_MANY if finer.intervals > _MANY else _ENOUGH_IF_FEW
        if least < timing.t_end * (1.0 + enough * tolerance):
            break
    return best


def _over_knots(
    phase: Phase,
    own: PhaseTiming,
    tolerance: float,
    points: int,
    most: float = np.inf,
) -> Phase:
    """Return a phase over the knots that its timing needs; see `breaks_for`."""
    assert own.timing is not None
    ends = (phase.boundary.start, phase.boundary.end)
    from_rest = max(len(end[0].derivatives) for end in ends) > 1
    breaks = breaks_for(
        own.course, own.timing, tolerance, from_rest=from_rest, most=most
    )
    return _with_breaks(phase, breaks, points)


def _with_breaks(phase: Phase, breaks: np.ndarray, points: int) -> Phase:
    knots = clamped_knots(phase.degree, breaks)
    return phase.with_grid(FixedGrid(knots, phase.degree, spread(breaks, points)))


def _halve_where_exceeded(phase: Phase, own: PhaseTiming, points: int) -> Phase:
    """Halve the intervals in which splines along the timing exceed limits by much."""
    assert own.timing is not None
    for _ in range(_HALVINGS):
        try:
            dense = phase.with_points(spread(phase.breaks, _LOOKS))
            beyond = _violations(dense, fit(phase, own.course, own.timing))
        except UnreachableError:
            return phase
        worst = np.hstack([*beyond.values()]).max(axis=1)
        steps = np.diff(phase.breaks) * own.timing.t_end
        # Between two stations the timing itself may exceed limits, which no knots mend.
        stations = np.searchsorted(own.timing.times / own.timing.t_end, phase.breaks)
        is_halved = (worst > _FAR) & (steps > SHORTEST) & (np.diff(stations) > 1)
        if not is_halved.any():
            return phase
        middles = 0.5 * (phase.breaks[1:] + phase.breaks[:-1])
        breaks = np.sort(np.append(phase.breaks, middles[is_halved]))
        phase = _with_breaks(phase, even_out(breaks), points)
    return phase


def _violations(phase: Phase, x: np.ndarray) -> dict[Limit, np.ndarray]:
    """Largest violations of the limits that count at single points in each knot interval, (N, c) each."""
    found = {}
    evaluation = phase.evaluate(x)
    for limit, values in zip(phase.limits, evaluation.by_limit, strict=True):
        if is_checked_at_points(limit):
            beyond = limit.violation(values)
            each = beyond[:-1].reshape(phase.intervals, -1, beyond.shape[1])
            found[limit] = each.max(axis=1)
            found[limit][-1] = np.maximum(found[limit][-1], beyond[-1])
    return found


def _follow_within_limits(
    phase: Phase, own: PhaseTiming
) -> tuple[float, np.ndarray] | None:
    """Find the point x, (v,), that follows the timing, and its time, s, with what is needed to hold the limits."""
    course = own.course
    timing = own.timing
    assert timing is not None
    most_acceleration = largest_acceleration(timing)
    dense = phase.with_points(spread(phase.breaks, _LOOKS))
    narrower: dict[Limit, np.ndarray] = {}
    best: tuple[float, np.ndarray] | None = None
    for _ in range(_ROUNDS):
        try:
            x = fit(phase, course, timing)
            beyond = _violations(dense, x)
        except UnreachableError:
            break
        largest = float(max(each.max(initial=0.0) for each in beyond.values()))
        needed = timing.t_end * (1.0 + largest)
        gain = np.inf if best is None else 1.0 - needed / best[0]
        if best is None or gain > 0.0:
            best = needed, x
        if largest <= _ENOUGH or (largest <= _NEAR and gain < _ENOUGH):
            break
        for limit, worst in beyond.items():
            more = _spread_excess(worst, phase.breaks, timing)
            narrower[limit] = narrower.get(limit, 0.0) + more
        slower = course.solve(own.rates, narrower, most_acceleration)
        if slower is None or slower.t_end > best[0]:
            break
        timing = slower
    return best


def keep(program: Program, x: np.ndarray) -> SolverReport:
    """Solve nothing: a timing is not improved by more collocation points, but lengthened until limits hold."""
    return _report(program, x, SolveStatus.STALLED, 0.0)


def _report(
    program: Program, x: np.ndarray, status: SolveStatus, seconds: float
) -> SolverReport:
    """Report a motion that no solver changed."""
    return SolverReport(
        solver=SOLVER,
        status=status,
        x=x,
        objective=program.objective(x),
        violation=0.0 if status.usable else np.inf,
        multipliers=np.zeros(len(program.lower)),
        iterations=0,
        wall_time=seconds,
        message="the fastest timing of the joint path",
    )


def time_guess(
    program: Program,
    joint_paths: Sequence[np.ndarray],
    rates: Sequence[tuple[float, float]],
    tolerance: float,
    points: int,
) -> SolvedProgram | None:
    """Give joint paths without redundancy their fastest timing, which is all that is to be decided.

    Parameters
    ----------
    program : Program
        Over any knots.
    joint_paths : sequence of (S, c) ndarray
        Of every phase, s and other curves.
    rates : sequence of tuple of float
        ds/dt at both ends of each, 1/s.
    tolerance, points
        As of `retime`.

    Returns
    -------
    SolvedProgram or None
        As of `retime`; or where the phase plane finds no timing.
    """
    began = time.perf_counter()
    if not is_timing_all(program):
        return None
    phases = []
    parts = []
    for phase, curves, ends in zip(program.phases, joint_paths, rates, strict=True):
        try:
            own = PhaseTiming.along(phase, curves, ends)
        except UnreachableError:
            return None
        followed = follow(phase, own, tolerance, points)
        if followed is None:
            return None
        phases.append(followed[0])
        parts.append(followed[1])
    finer = program.with_phases(phases)
    x = np.concatenate(parts)
    seconds = time.perf_counter() - began
    return SolvedProgram(finer, (_report(finer, x, SolveStatus.ACCEPTABLE, seconds),))


def begin_with_timing(
    program: Program,
    joint_paths: Sequence[np.ndarray],
    rates: Sequence[tuple[float, float]],
    points: int,
) -> tuple[Program, np.ndarray] | None:
    """Lay splines along the fastest timing of joint paths, over few knots, close together where it needs them.

    Parameters
    ----------
    program : Program
        Over any knots.
    joint_paths, rates, points
        As of `time_guess`.

    Returns
    -------
    program : Program
    x : (v,) ndarray
        Slowed down until the limits hold at the collocation points; None where the limits allow no timing.
    """
    phases = []
    parts = []
    for phase, curves, ends in zip(program.phases, joint_paths, rates, strict=True):
        try:
            own = PhaseTiming.along(phase, curves, ends)
            if own.timing is None:
                return None
            few = _over_knots(phase, own, _ROUGHLY, points, _FIRST_INTERVALS)
            parts.append(fit(few, own.course, own.timing))
        except UnreachableError:
            return None
        phases.append(few)
    begun = program.with_phases(phases)
    try:
        return begun, shortest_time(begun, np.concatenate(parts))
    except UnreachableError:
        return None


def is_timing_all(program: Program) -> bool:
    """Tell whether the phase plane knows all limits, and phases meet at rest."""
    is_linked = any(max(link.orders) for link in program.links)
    is_periodic = any(phase.boundary.periodic for phase in program.phases)
    has_laws = any(phase.time_law is not None for phase in program.phases)
    left_out = any(map(is_left_out, program.limits))
    return not (is_linked or is_periodic or has_laws or left_out)


def retime(
    solved: SolvedProgram, tolerance: float, points: int, worth: float
) -> SolvedProgram | None:
    """Give a solved program the fastest timing of its own joint path, over the knots that this needs.

    Parameters
    ----------
    solved : SolvedProgram
        Without free knots.
    tolerance : float
        Part of the time by which splines should not be slower.
    points : int
        Collocation points an interval.
    worth : float
        Part of the time by which the timing has to be faster.

    Returns
    -------
    SolvedProgram or None
        None if that is about as fast. None where timing is not all: with limits on jerk, torque rate or means, in
        periodic motions, and where a phase goes on in motion from another one.
    """
    began = time.perf_counter()
    program = solved.program
    if not is_timing_all(program):
        return None
    timings = time_phases(solved)
    least = least_time_of(program, solved.x, timings)
    # A motion that is faster exceeds limits between its collocation points.
    if least * (1.0 - TOO_FAST) < solved.t_end < least * (1.0 + worth):
        return None
    phases = []
    parts = []
    for (phase, x), own in zip(program.split(solved.x), timings, strict=True):
        followed = None if own is None else follow(phase, own, tolerance, points)
        faster, part = followed or (phase, x)
        phases.append(faster)
        parts.append(part)
    finer = program.with_phases(phases)
    x = np.concatenate(parts)
    seconds = time.perf_counter() - began
    report = _report(finer, x, SolveStatus.ACCEPTABLE, seconds)
    return SolvedProgram(finer, (*solved.reports, report))
