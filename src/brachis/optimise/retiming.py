"""The search for joint paths with the program over the path, and programs that start from their fastest timing."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.errors import UnreachableError
from brachis.limits.safeguards import HELD_BACK, MARGIN
from brachis.optimise.backends import SolverOptions, SolverReport, SolveStatus
from brachis.optimise.follow import begin, follow
from brachis.optimise.guess import shortest_time
from brachis.optimise.improve import SolverSession
from brachis.optimise.links import CurveLink
from brachis.optimise.path_phase import PathPhase, violation_of_postures
from brachis.optimise.path_program import PathProgram
from brachis.optimise.phase_timing import PLACES, PhaseTiming
from brachis.optimise.program import Program
from brachis.timing import is_left_out

SOLVER = "phase plane"
"""Solver name in reports of programs that are solved by timing alone."""
_CREDIBLE = 0.01
"""Maximum difference between a solution over the path and its timing, as a fraction of the time."""
_MOST_INTERVALS = 256
"""Maximum number of intervals of all redundant curves together. With four curves of 128 intervals, a solve takes half a
minute and gains only 0.2 %."""
_LEAST_INTERVALS = 12
"""Minimum number of intervals in a phase, however short; in moves, before it is divided by `_FEWER_IN_MOVES`. With 4,
solutions of short moves were up to 7 % faster than their timings, and programs of three paths took 0.2 % longer."""
_FEWER_IN_MOVES = 3
"""Divisor of the number of intervals in a move, at as many places. No path bends the curves of a move: with 16
intervals, moves of an iiwa14 round obstacles were as fast as with 4, and took 2 to 4 times as long."""
_PLACES_AN_INTERVAL = 3.5
"""Number of places along the path, per interval, at which limits are imposed."""
_NARROWED = 4
"""Maximum number of times that limits on postures are narrowed."""
ROUGH_MARGIN = 0.02
"""Minimum branch margin in a rough search. Finer searches that start from the joint paths found may come closer to the
branch boundary."""
_FEWEST = 12
"""Minimum number of intervals of a phase at the beginning of a search over time, if its timing needs so many."""


@dataclass(frozen=True)
class PathEffort:
    """How thoroughly joint paths are searched for.

    Attributes
    ----------
    intervals : tuple of int
        Numbers of intervals of the redundant curves over the whole path, tried one after the other. Each number is
        divided among the phases in proportion to their times.
    places : int
        Number of places at which joint paths are timed.
    margin : float
        Minimum branch margin.
    options : SolverOptions
        Options of each solve. Limits may be exceeded slightly, because the timing is recomputed.
    known : int, optional
        Number of intervals with which the given joint paths were found; 0 if they are only guesses. A number is
        skipped if it gives every phase as many as this one.
    is_rough_before, is_rough_after : bool, optional
        Whether joint paths are timed only roughly before they are improved, and after. For a joint path that is not
        improved, `is_rough_after` applies. A rough timing does not show gains or losses below 1 %.
    posture_violation : float, optional
        Largest accepted violation of limits on postures.
    """

    intervals: tuple[int, ...]
    places: int
    margin: float
    options: SolverOptions
    known: int = 0
    is_rough_before: bool = False
    is_rough_after: bool = False
    posture_violation: float = 5e-5


COARSE = PathEffort(
    intervals=(12,),
    places=200,
    is_rough_before=True,
    is_rough_after=True,
    margin=ROUGH_MARGIN,
    options=SolverOptions(
        tolerance=1e-3,
        max_iterations=25,
        time_limit=np.inf,
        progress=3e-3,
        patience=3,
        anywhere=True,
        widening=5e-5,
    ),
    posture_violation=5e-3,
)
"""Effort for choosing the joint paths for which a rough search is made."""
ROUGH = PathEffort(
    intervals=(16,),
    places=800,
    is_rough_before=True,
    margin=ROUGH_MARGIN,
    options=SolverOptions(
        tolerance=3e-4,
        max_iterations=40,
        time_limit=np.inf,
        progress=1e-3,
        patience=3,
        anywhere=True,
        widening=1.5e-5,
    ),
)
"""Effort for ranking joint paths. The joint paths keep a margin from branch boundaries."""
FINE = PathEffort(
    intervals=(32, 64, 128, 256),
    places=PLACES,
    margin=MARGIN,
    known=16,
    options=SolverOptions(
        tolerance=1e-5,
        max_iterations=100,
        time_limit=np.inf,
        progress=2e-4,
        patience=4,
        widening=1e-6,
    ),
)
"""Effort for a plan that starts from the result of a rough search."""


def begin_with_timing(
    program: Program,
    timings: Sequence[PhaseTiming | None],
    lost: float,
    intervals: int,
    points: int,
    x: np.ndarray | None = None,
) -> tuple[Program, np.ndarray] | None:
    """Lay splines along the timings of all phases over few knots. Knots are dense only where the timings need them.

    Phases with a given time keep their knots.

    Parameters
    ----------
    program : Program
        Program over any knots.
    timings : sequence of PhaseTiming or None
    lost : float
        Fraction of the time that the intervals together may cost.
    intervals : int
        Approximate number of intervals of all phases together.
    points : int
        Number of collocation points per interval.
    x : (v,) ndarray, optional
        Point of the program from which phases with a given time start. Not needed if there are no such phases.

    Returns
    -------
    program : Program
    x : (v,) ndarray
        Motion, slowed down until the limits are met at the collocation points. None is returned in place of both if the
        limits allow no timing.
    """
    total = least_time(timings)
    phases = []
    x_by_phase = []
    parts_before = program.split(program.x_lower if x is None else x)
    for (phase, x_of_phase), phase_timing in zip(parts_before, timings, strict=True):
        if phase_timing is None or phase_timing.timing is None:
            return None
        begun = phase, x_of_phase
        if phase.time_law is None:
            share = max(_FEWEST, int(intervals * phase_timing.t_end / total))
            begun = begin(phase, phase_timing, lost, share, points)
        phases.append(begun[0])
        x_by_phase.append(begun[1])
    first = program.with_phases(phases)
    try:
        return first, shortest_time(first, np.concatenate(x_by_phase))
    except UnreachableError:
        return None


def is_timing_all(program: Program) -> bool:
    """Tell whether the phase plane covers all limits, and all phases meet at rest or fly."""
    curve_links = [link for link in program.links if isinstance(link, CurveLink)]
    is_linked = any(max(link.orders) for link in curve_links)
    is_periodic = any(phase.boundary.periodic for phase in program.phases)
    has_laws = program.has_time_laws
    left_out = any(map(is_left_out, program.limits))
    return not (is_linked or is_periodic or has_laws or left_out)


@dataclass(frozen=True)
class BetterPaths:
    """Result of the search for joint paths with the program over the path.

    Attributes
    ----------
    curves : tuple of (S, c) ndarray
        The best joint path of every phase, as curves: s and the redundant curves.
    timings : tuple of PhaseTiming
        Timings of these joint paths.
    reports : tuple of SolverReport
    violation : float
        Largest violation of a limit on postures.
    is_credible : bool
        Whether the solutions are about as fast as their timings. They are not if the tool stands still on its path
        while the joints move, because curves over the path cannot describe such a motion.
    is_held_back : bool
        Whether a branch margin holds the motion back because it is close to its bound.
    """

    curves: tuple[np.ndarray, ...]
    timings: tuple[PhaseTiming, ...]
    reports: tuple[SolverReport, ...] = ()
    violation: float = 0.0
    is_credible: bool = True
    is_held_back: bool = False

    @property
    def t_end(self) -> float:
        """Total time of all phases, s; infinite if a phase has no timing."""
        return least_time(self.timings)

    def rank(self, slack: float) -> tuple[float, float]:
        """Return a sort key, smaller for better paths. Violations of posture limits above `slack` precede the time."""
        return max(self.violation, slack), self.t_end


def improve_joint_paths(
    program: Program,
    curves: Sequence[np.ndarray],
    solve: SolverSession,
    tolerance: float,
    effort: PathEffort,
) -> BetterPaths:
    """Find better joint paths with the program over the path; see `PathProgram`.

    Parameters
    ----------
    program : Program
        Program over any knots, without free speeds; see `Program.at_rest`. Limits that the phase plane does not cover
        are left out.
    curves : sequence of (S, c) ndarray
        Curves of every phase: s, ascending, and the redundant curves.
    solve : SolverSession
    tolerance : float
        Minimum gain, as a fraction of the time, with which the number of spline intervals is increased further.
    effort : PathEffort

    Returns
    -------
    BetterPaths
        The improved joint paths, or the given ones if the limits allow no timing of them.

    Raises
    ------
    UnreachableError
        The curves leave the joint map.
    """
    solve = solve.over_path(effort.options)
    program = program.with_phases(
        phase.with_limits([limit for limit in phase.limits if not is_left_out(limit)])
        for phase in program.phases
    )

    def time_paths(*, is_rough: bool) -> tuple[PhaseTiming, ...]:
        """Time the given joint paths."""
        return tuple(
            PhaseTiming.through(*pair, effort.places, is_rough=is_rough)
            for pair in zip(program.phases, curves, strict=True)
        )

    beyond = max(map(violation_of_postures, program.phases, curves))
    r = max(phase.joint_map.r for phase in program.phases)
    is_first_rough = effort.is_rough_before if r else effort.is_rough_after
    timings = time_paths(is_rough=is_first_rough)
    best = BetterPaths(tuple(curves), timings, (), beyond)
    if not r:
        return best
    apart = program.with_margin(effort.margin)
    for count in effort.intervals:
        before = best.t_end
        is_too_large = count * r > _MOST_INTERVALS
        if is_too_large or not np.isfinite(before) or solve.deadline.passed:
            break
        if effort.known and all(
            _share_intervals(count, timing.t_end / before)
            == _share_intervals(effort.known, timing.t_end / before)
            for timing in best.timings
        ):
            continue
        best = _better(apart, solve, effort, count, best)
        if not best.is_credible or best.t_end > before * (1.0 - tolerance):
            break
    if best.timings is timings and is_first_rough and not effort.is_rough_after:
        best = replace(best, timings=time_paths(is_rough=False))
    return best


def _share_intervals(intervals: int, share: float) -> int:
    """Return the number of intervals of a phase, from that of all phases and the phase's share of their time."""
    return max(_LEAST_INTERVALS, int(np.ceil(intervals * share)))


def _better(
    program: Program,
    solve: SolverSession,
    effort: PathEffort,
    intervals: int,
    best: BetterPaths,
) -> BetterPaths:
    """Solve over the path from the best joint paths so far, and return the better joint paths."""
    phases = []
    for phase, phase_timing in zip(program.phases, best.timings, strict=True):
        count = _share_intervals(intervals, phase_timing.t_end / best.t_end)
        stations = int(_PLACES_AN_INTERVAL * count)
        if phase.joint_map.is_move:
            count //= _FEWER_IN_MOVES
        phases.append(PathPhase(phase, phase_timing, count, stations))
    over_path = PathProgram(phases, program.links)
    report = solve(over_path, over_path.start)
    reports = (*best.reports, report)
    try:
        violation = over_path.narrow(report.x)
        for _ in range(_NARROWED):
            if violation < effort.posture_violation or solve.deadline.passed:
                break
            narrowed = solve(over_path, report.x)
            reports = (*reports, narrowed)
            if not narrowed.status.usable:
                break
            report = narrowed
            violation = over_path.narrow(report.x)
        x = over_path.meet(report.x)
        timings = over_path.timings(x, effort.places, is_rough=effort.is_rough_after)
        is_held_back = over_path.safeguard_slack(x) <= HELD_BACK
    except UnreachableError:
        return replace(best, reports=reports, is_credible=False)
    paths = BetterPaths(over_path.curves(x), timings, reports, violation)
    missed = 1.0 - report.objective / paths.t_end
    # If the speed is given, the phase plane does not show whether the limits allow it.
    has_laws = any(timing.fixed_duration is not None for timing in timings)
    has_timed_laws = has_laws and np.isfinite(paths.t_end)
    is_beyond = has_timed_laws and report.violation > _CREDIBLE
    slack = effort.posture_violation
    is_better = paths.rank(slack) < best.rank(slack)
    if is_beyond or not (is_better or has_timed_laws):
        paths = replace(best, reports=reports)
    return replace(
        paths,
        is_credible=abs(missed) < _CREDIBLE,
        is_held_back=is_held_back,
    )


def least_time(timings: Iterable[PhaseTiming | None]) -> float:
    """Return the total time of all phases, s; infinite if a phase has no timing."""
    return sum(np.inf if timing is None else timing.t_end for timing in timings)


def lay_splines(
    program: Program,
    timings: Sequence[PhaseTiming | None],
    tolerance: float,
    points: int,
    deadline: Deadline = NEVER,
) -> tuple[Program, SolverReport] | None:
    """Lay splines along the fastest timing of joint paths, over as many knots as the timing needs.

    Parameters
    ----------
    program : Program
        Program over any knots for which `is_timing_all` is true.
    timings : sequence of PhaseTiming or None
        Timings of a joint path for each phase.
    tolerance : float
        Fraction of the time by which the splines may be slower.
    points : int
        Number of collocation points per interval.
    deadline : Deadline, optional
        After this deadline no further mesh is tried, and no limit is narrowed further.

    Returns
    -------
    (Program, SolverReport) or None
        None if a joint path has no timing.
    """
    began = time.perf_counter()
    followed_phases = []
    for phase, phase_timing in zip(program.phases, timings, strict=True):
        followed = phase_timing and follow(
            phase, phase_timing, tolerance, points, deadline
        )
        if followed is None:
            return None
        followed_phases.append(followed)
    phases, x_by_phase, violations = zip(*followed_phases, strict=True)
    finer = program.with_phases(phases)
    x = np.concatenate(x_by_phase)
    seconds = time.perf_counter() - began
    report = SolverReport(
        solver=SOLVER,
        status=SolveStatus.FOLLOWED,
        x=x,
        objective=finer.objective(x),
        violation=max(violations),
        multipliers=np.zeros(len(finer.lower)),
        iterations=0,
        wall_time=seconds,
        message="the fastest timing of the joint path",
    )
    return finer, report
