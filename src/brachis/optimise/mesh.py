"""The knots of a solved program: more of them, better ones, or free ones.

- `solve_nested` reaches many given intervals from few. A cold solve with hundreds of
  variables takes seconds; from a coarse motion, inserted exactly, it takes a few
  iterations on every level.
- `refine_mesh` halves the intervals that lose most. A time-optimal motion has 1 + r
  limits active at almost every instant, and jumps from one set of them to another. A
  spline can only ramp, and loses about the ramp's length times its height.
- `optimise_knots` makes the interval lengths variables of the optimisation.
- `adapt_mesh` chooses among them as the task asks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.errors import UnreachableError
from brachis.optimise.backends import SolverReport, SolveStatus
from brachis.optimise.bspline import clamped_knots, spread
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.optimise.refine import Refined, RefinementOptions, Solve, merged, refine
from brachis.task import SplineSettings

SHORTEST = 5e-5
"""No interval gets shorter than this part of t_E: collocation points would fall together."""


class Answer(NamedTuple):
    """What came of the knots.

    Attributes
    ----------
    program : Program
    reports : tuple of SolverReport
        Of all solves; the last one belongs to `program`.
    not_completed : str
        What the time, or a solve that failed, left undone, in words; empty where nothing.
    """

    program: Program
    reports: tuple[SolverReport, ...]
    not_completed: str = ""


_EARLY = (
    SolveStatus.ITERATION_LIMIT,
    SolveStatus.TIME_LIMIT,
    SolveStatus.STALLED,
    SolveStatus.FAILED,
)
"""How a solve ends that is not done; a solver that breaks down at last may have come far."""


def accept_early_end(report: SolverReport, before: SolverReport) -> SolverReport:
    """Accept a solve that ended early with a feasible motion faster than the one that it began with."""
    better = report.feasible and report.objective < before.objective
    early = report.status in _EARLY
    return (
        replace(report, status=SolveStatus.ACCEPTABLE) if better and early else report
    )


def end_time(refined: Refined, refinement: RefinementOptions) -> float:
    """End time of a motion that holds the limits, infinite for others."""
    holds = refined.converged and (
        refined.violation <= refinement.tolerance or not refinement.max_rounds
    )
    return refined.t_end if holds else np.inf


def gain(before: Refined, after: Refined, refinement: RefinementOptions) -> float:
    """Part of the end time that is gained; NaN where neither motion holds the limits."""
    if not np.isfinite(end_time(before, refinement)):
        return 1.0 if np.isfinite(end_time(after, refinement)) else np.nan
    return 1.0 - end_time(after, refinement) / end_time(before, refinement)


def with_last(
    last: SolverReport, reports: list[SolverReport]
) -> tuple[SolverReport, ...]:
    """Move one of the reports to the end."""
    return (*(report for report in reports if report is not last), last)


_FEWEST, _WITH_LEAST_SPEED = 12, 36
"""Intervals of the coarsest level, at least; more where a limit asks for a least speed, for fewer may not keep it."""


def coarsest(program: Program) -> Program:
    """Return the program over every 2^k-th of its knots, k as large as leaves a dozen intervals."""
    return next(_levels(program))


def solve_nested(
    target: Program,
    coarse: Program,
    report: SolverReport,
    solve: Solve,
    deadline: Deadline = NEVER,
) -> Answer:
    """Solve a program from the answer of its coarsest one, level by level.

    Parameters
    ----------
    target : Program
    coarse : Program
        ``coarsest(target)``, perhaps with another branch margin, which is kept.
    report : SolverReport
        Of the coarse program's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.

    deadline : Deadline, optional
        No level is begun after it.

    Returns
    -------
    Answer
        Over the target's knots; over those of the last level that was solved, where one could not be.
    """
    reports = [report]
    solved = report
    for level in _levels(target):
        if level.intervals <= coarse.intervals:
            continue
        if deadline.passed:
            break
        pairs = list(zip(coarse.split(solved.x), level.phases, strict=True))
        finer = coarse.with_phases(
            own.with_knots(fine.knots, fine.t_norm) for (own, _), fine in pairs
        )
        start = finer.variables_from(
            [own.motion(part).over(fine.knots) for (own, part), fine in pairs]
        )
        report = accept_early_end(solve(finer, start), solved)
        reports.append(report)
        if not report.status.usable:
            break
        coarse = finer
        solved = report
    reached = coarse.intervals
    asked = target.intervals
    not_completed = (
        f"the motion has {reached} of {asked} intervals, of which more were not solved"
        if reached < asked
        else ""
    )
    return Answer(coarse, with_last(solved, reports), not_completed)


def _levels(program: Program) -> Iterator[Program]:
    """Programs over ever more of the knots, from the coarsest to the given one, with as many points an interval."""
    fewest = (
        _WITH_LEAST_SPEED
        if any(limit.longer_time == "violates" for limit in program.limits)
        else _FEWEST
    )
    steps = [
        int(np.log2(max(phase.intervals / fewest, 1.0))) for phase in program.phases
    ]
    for k in range(max(steps), 0, -1):
        pairs = zip(program.phases, steps, strict=True)
        yield program.with_phases(
            _thinned(phase, 2 ** min(k, own)) for phase, own in pairs
        )
    yield program


def _thinned(phase: Phase, every: int) -> Phase:
    """Keep every so many-th knot and collocation point, and the last ones."""
    breaks, t_norm = (
        values[_every(len(values), every)] for values in (phase.breaks, phase.t_norm)
    )
    return phase.with_knots(clamped_knots(phase.degree, breaks), t_norm)


def _every(count: int, step: int) -> np.ndarray:
    return np.unique(np.append(np.arange(0, count, step), count - 1))


COARSE_INTERVALS = 10
"""Intervals with which a mesh begins."""
_SHARE = 0.6
"""A round halves the intervals that lose most, and that lose this part of the time lost altogether."""
_ENOUGH = 0.5
"""Rounds end when the last two gained less than this part of the tolerance: further ones would gain as much."""
_FEW_VARIABLES = 150
"""Up to so many it is cheap to halve every interval, in case the wrong ones were thought to lose most."""
_SAMPLES = 8
_SHORTEST = 0.5
"""No interval gets shorter than this part of the tolerance, for it cannot lose more than its own length."""
_MOST_VARIABLES = 300
"""Solves with more take seconds each, and gain some 0.1 %."""
_MOST_ROUNDS = 20
_GROWTH = 3.0
"""So many times as long as a round the next one may take."""
_UNDONE = "the mesh is coarser than spline.tolerance asks for"


@dataclass(frozen=True)
class MeshOptions:
    """When a mesh is fine enough.

    Attributes
    ----------
    tolerance : float
        Of the end time, as a fraction of it: the refinement ends when two rounds together gain less than half of it.
    points_per_interval : int
        Collocation points of every interval.
    """

    tolerance: float = 1e-3
    points_per_interval: int = 3


def refine_mesh(
    program: Program,
    first: SolverReport,
    solve: Solve,
    options: MeshOptions,
    deadline: Deadline,
) -> Answer:
    """Insert knots into a solved program until that gains little.

    Every round halves the intervals that lose most, and solves again from the same motion. Rounds end when the last two
    of them together gained less than half the tolerance; small meshes are halved everywhere before.

    Parameters
    ----------
    program : Program
    first : SolverReport
        Of the program's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : MeshOptions
    deadline : Deadline
        After it no round is begun; nor is one that looks as if it would end later.

    Returns
    -------
    Answer
        Over all knots.
    """
    reports = [first]
    last = first
    gains = [1.0]
    is_settled = False
    for _ in range(_MOST_ROUNDS):
        if _GROWTH * last.wall_time > deadline.left:
            return Answer(program, with_last(last, reports), _UNDONE)
        intervals = (
            _every_h_refinement(program)
            if is_settled
            else _losers(program, last.x, options)
        )
        finer, x = _halved(program, last.x, intervals, options)
        if finer.variables > _MOST_VARIABLES:
            return Answer(program, with_last(last, reports), _UNDONE)
        if finer.variables == program.variables:
            break
        report = accept_early_end(solve(finer, x), last)
        reports.append(report)
        if not report.status.usable:
            break
        gains.append(1.0 - report.objective / last.objective)
        program = finer
        last = report
        is_settled = sum(gains[-2:]) < _ENOUGH * options.tolerance
        if is_settled and 2 * program.variables > _FEW_VARIABLES:
            break
    return Answer(program, with_last(last, reports))


def _losers(program: Program, x: np.ndarray, options: MeshOptions) -> list[np.ndarray]:
    """Intervals of every phase that lose most time and are long enough to be halved, ascending."""
    whole = program.end_time(x)
    try:
        lost = [
            _lost(phase, part) * (part[0] / whole) * _can_be_halved(phase, options)
            for phase, part in program.split(x)
        ]
    except UnreachableError:  # between the collocation points
        return _every_h_refinement(program)
    together = np.concatenate(lost)
    order = np.argsort(-together, kind="stable")
    most = np.searchsorted(np.cumsum(together[order]), _SHARE * together.sum()) + 1
    chosen = np.isin(np.arange(len(together)), order[:most])
    return [
        np.flatnonzero(own)
        for own in np.split(chosen, np.cumsum([len(own) for own in lost])[:-1])
    ]


def _lost(phase: Phase, x: np.ndarray) -> np.ndarray:
    """Part of the duration that each interval loses, (N,): how far as many limits as there are curves swing."""
    breaks = phase.breaks
    ratios = np.abs(phase.with_grid(spread(breaks, _SAMPLES)).time_scaling_ratios(x))
    slack = 1.0 - np.sort(ratios, axis=1)[:, -len(phase.splines) :].clip(max=1.0)
    within = np.lib.stride_tricks.sliding_window_view(slack, _SAMPLES + 1, axis=0)[
        ::_SAMPLES
    ]
    return np.asarray(np.ptp(within, axis=2).sum(axis=1) * np.diff(breaks))


def _every_h_refinement(program: Program) -> list[np.ndarray]:
    return [np.arange(phase.intervals) for phase in program.phases]


def _halved(
    program: Program, x: np.ndarray, intervals: list[np.ndarray], options: MeshOptions
) -> tuple[Program, np.ndarray]:
    """Halve intervals of every phase: the finer program, and the same motion as its point."""
    pairs = zip(program.phases, intervals, strict=True)
    finer = program.with_phases(
        _with_halves(phase, own, options) for phase, own in pairs
    )
    motions = zip(program.motions(x), finer.phases, strict=True)
    return finer, finer.variables_from(
        [motion.over(phase.knots) for motion, phase in motions]
    )


def _can_be_halved(phase: Phase, options: MeshOptions) -> np.ndarray:
    """Tell of every interval, (N,), whether its halves are long enough."""
    return np.diff(phase.breaks) >= 2.0 * max(_SHORTEST * options.tolerance, SHORTEST)


def _with_halves(phase: Phase, intervals: np.ndarray, options: MeshOptions) -> Phase:
    breaks = phase.breaks
    intervals = intervals[_can_be_halved(phase, options)[intervals]]
    finer = np.union1d(breaks, 0.5 * (breaks[intervals] + breaks[intervals + 1]))
    return phase.with_knots(
        clamped_knots(phase.degree, finer),
        merged(phase, spread(finer, options.points_per_interval)),
    )


_ROUNDS = 5
_WORTH_IT = 2e-4
"""Knots are moved again as long as that shortens the motion by this part of it."""


def optimise_knots(
    program: Program,
    first: SolverReport,
    solve: Solve,
    shortest: float,
    refinement: RefinementOptions,
) -> Answer:
    """Optimise the interval lengths of a solved program together with the motion.

    Collocation points keep their places within their intervals while the knots move. The knots are then fixed and the
    limits made to hold in between (`refine`); from there, with the points that this added, the knots are freed again,
    as long as that gains.

    Parameters
    ----------
    program : Program
        With fixed knots.
    first : SolverReport
        Of the program's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    shortest : float
        Least length of an interval, in mean intervals; 5e-5 t_E at least is taken.
    refinement : RefinementOptions
        After its deadline the knots are not freed again.

    Returns
    -------
    Answer
        With knots fixed where they are best; the given program if moving them led to no motion within the limits.
    """
    given = program
    reports = [first]
    best = None
    x = first.x
    shortest = max(
        shortest, SHORTEST * max(phase.intervals for phase in program.phases)
    )
    for _ in range(_ROUNDS):
        if refinement.deadline.passed:
            break
        free = program.with_free_knots(shortest)
        moved = solve(free, free.variables_from(program.motions(x)))
        fixed, start = free.frozen(moved.x)
        # A few iterations, where the solver stalled before the knots came to rest.
        report = accept_early_end(solve(fixed, start), reports[-1])
        reports += [moved, report]
        if not report.status.usable:
            break
        refined = refine(fixed, report, solve, refinement)
        reports += refined.reports[1:]
        gained = np.inf if best is None else gain(best, refined, refinement)
        if best is None or gained > 0.0:
            best = refined
        if not gained > _WORTH_IT:
            break
        program = refined.program
        x = refined.x
    not_completed = (
        "the knots were not moved as far as that pays"
        if refinement.deadline.passed
        else ""
    )
    if best is None or not np.isfinite(end_time(best, refinement)):
        return Answer(given, with_last(first, reports), not_completed)
    return Answer(best.program, with_last(best.reports[-1], reports), not_completed)


def adapt_mesh(
    program: Program,
    reports: tuple[SolverReport, ...],
    solve: Solve,
    spline: SplineSettings,
    refinement: RefinementOptions,
    *,
    target: Program | None = None,
) -> Answer:
    """Do with the knots of a solved program what a task's ``spline`` part asks for: nothing, free them, or refine.

    Parameters
    ----------
    program : Program
    reports : tuple of SolverReport
        The last one is of the problem's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    spline : SplineSettings
    refinement : RefinementOptions
        After its deadline no further round is begun.
    target : Program, optional
        The program over all its knots, where the solved one is its coarsest (see `solve_nested`).

    Returns
    -------
    Answer
        With fixed knots; the reports are those given, and those of further solves.
    """
    if not reports[-1].status.usable:
        return Answer(program, reports)
    nested = Answer(program, reports[-1:])
    if target is not None:
        nested = solve_nested(target, program, reports[-1], solve, refinement.deadline)
    last = nested.reports[-1]
    if spline.knots == "free":
        adapted = optimise_knots(
            nested.program, last, solve, spline.shortest_interval, refinement
        )
    elif spline.intervals == "auto":
        options = MeshOptions(spline.tolerance, spline.points_per_interval)
        adapted = refine_mesh(nested.program, last, solve, options, refinement.deadline)
    else:
        adapted = Answer(nested.program, (last,))
    not_completed = "; ".join(
        filter(None, (nested.not_completed, adapted.not_completed))
    )
    return Answer(
        adapted.program,
        (*reports[:-1], *nested.reports[:-1], *adapted.reports),
        not_completed,
    )
