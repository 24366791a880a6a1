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

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.errors import UnreachableError
from brachis.optimise.bspline import clamped_knots, spread
from brachis.optimise.improve import (
    Change,
    Solve,
    SolvedProgram,
    attempt_once,
    improve,
    with_early_end_accepted,
    with_last,
)
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, merged, refine
from brachis.task import SplineSettings

SHORTEST = 5e-5
"""No interval gets shorter than this part of t_E: collocation points would fall together."""


_FEWEST, _WITH_LEAST_SPEED = 12, 36
"""Intervals of the coarsest level, at least; more where a limit asks for a least speed, for fewer may not keep it."""


def coarsest(program: Program) -> Program:
    """Return the program over every 2^k-th of its knots, k as large as leaves a dozen intervals."""
    return next(_levels(program))


def solve_nested(
    target: Program,
    coarse: SolvedProgram,
    solve: Solve,
    deadline: Deadline = NEVER,
) -> SolvedProgram:
    """Solve a program from the answer of its coarsest one, level by level.

    Parameters
    ----------
    target : Program
    coarse : SolvedProgram
        ``coarsest(target)`` solved, perhaps with another branch margin, which is kept.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    deadline : Deadline, optional
        No level is begun after it.

    Returns
    -------
    SolvedProgram
        Over the target's knots; over those of the last level that was solved, where one could not be.
    """

    def change_to(level: Program) -> Change:
        return lambda solved: _over_level(solved, level)

    finer = (
        change_to(level)
        for level in _levels(target)
        if level.intervals > coarse.program.intervals
    )
    attempt = attempt_once(solve, accept_early_end=True)
    reached = improve(coarse, finer, attempt, deadline=deadline)
    intervals = reached.program.intervals
    if intervals == target.intervals:
        return reached
    not_completed = f"the motion has {intervals} of {target.intervals} intervals, of which more were not solved"
    return replace(reached, not_completed=not_completed)


def _over_level(solved: SolvedProgram, level: Program) -> tuple[Program, np.ndarray]:
    """Write a solved program, and its answer, over the knots and points of a finer one."""
    pairs = list(zip(solved.program.split(solved.x), level.phases, strict=True))
    finer = solved.program.with_phases(
        own.with_knots(fine.knots, fine.t_norm) for (own, _), fine in pairs
    )
    motions = [own.motion(part).over(fine.knots) for (own, part), fine in pairs]
    return finer, finer.variables_from(motions)


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
    solved: SolvedProgram, solve: Solve, options: MeshOptions, deadline: Deadline
) -> SolvedProgram:
    """Insert knots into a solved program until that gains little.

    Every round halves the intervals that lose most, and solves again from the same motion. Rounds end when the last two
    of them together gained less than half the tolerance; small meshes are halved everywhere before.

    Parameters
    ----------
    solved : SolvedProgram
        Of one report.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : MeshOptions
    deadline : Deadline
        After it no round is begun; nor is one that looks as if it would end later.

    Returns
    -------
    SolvedProgram
        Over all knots.
    """

    def halve(solved: SolvedProgram) -> tuple[Program, np.ndarray] | str | None:
        program = solved.program
        times = np.array([report.objective for report in solved.reports])
        gains = 1.0 - times[1:] / times[:-1]
        is_settled = len(gains) > 1 and gains[-2:].sum() < _ENOUGH * options.tolerance
        if is_settled and 2 * program.variables > _FEW_VARIABLES:
            return None
        if _GROWTH * solved.report.wall_time > deadline.left:
            return _UNDONE
        intervals = (
            _every_interval(program)
            if is_settled
            else _losers(program, solved.x, options)
        )
        finer, x = _halved(program, solved.x, intervals, options)
        if finer.variables > _MOST_VARIABLES:
            return _UNDONE
        return None if finer.variables == program.variables else (finer, x)

    attempt = attempt_once(solve, accept_early_end=True)
    return improve(solved, [halve] * _MOST_ROUNDS, attempt)


def _losers(program: Program, x: np.ndarray, options: MeshOptions) -> list[np.ndarray]:
    """Intervals of every phase that lose most time and are long enough to be halved, ascending."""
    whole = program.end_time(x)
    try:
        lost = [
            _lost(phase, part) * (part[0] / whole) * _can_be_halved(phase, options)
            for phase, part in program.split(x)
        ]
    except UnreachableError:  # between the collocation points
        return _every_interval(program)
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


def _every_interval(program: Program) -> list[np.ndarray]:
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
_BEYOND_LIMITS = 1e9
"""Stands for the end time of motions beyond the limits, s: any motion within them is better."""
_WORTH_IT = 2e-4
"""Knots are moved again as long as that shortens the motion by this part of it."""


def optimise_knots(
    solved: SolvedProgram,
    solve: Solve,
    shortest: float,
    refinement: RefinementOptions,
) -> SolvedProgram:
    """Optimise the interval lengths of a solved program together with the motion.

    Collocation points keep their places within their intervals while the knots move. The knots are then fixed and the
    limits made to hold in between (`refine`); from there, with the points that this added, the knots are freed again,
    as long as that gains.

    Parameters
    ----------
    solved : SolvedProgram
        With fixed knots.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    shortest : float
        Least length of an interval, in mean intervals; 5e-5 t_E at least is taken.
    refinement : RefinementOptions
        After its deadline the knots are not freed again.

    Returns
    -------
    SolvedProgram
        With knots fixed where they are best; the given program if moving them led to no motion within the limits.
    """
    most = max(phase.intervals for phase in solved.program.phases)
    shortest = max(shortest, SHORTEST * most)

    def free_knots(solved: SolvedProgram) -> tuple[Program, np.ndarray]:
        free = solved.program.with_free_knots(shortest)
        return free, free.variables_from(solved.program.motions(solved.x))

    def move_fix_and_refine(free: Program, x: np.ndarray) -> SolvedProgram:
        moved = solve(free, x)
        fixed, start = free.frozen(moved.x)
        # A few iterations, where the solver stalled before the knots came to rest.
        report = with_early_end_accepted(solve(fixed, start), free.end_time(x))
        refined = refine(fixed, report, solve, refinement)
        return replace(refined, reports=(moved, *refined.reports))

    def judge(candidate: SolvedProgram) -> float:
        if not np.isfinite(candidate.violation):
            return np.inf
        if refinement.max_rounds and candidate.violation > refinement.tolerance:
            return _BEYOND_LIMITS
        return candidate.t_end

    best = improve(
        solved,
        [free_knots] * _ROUNDS,
        move_fix_and_refine,
        least_gain=0.0,
        go_on_above=_WORTH_IT,
        judge=judge,
        deadline=refinement.deadline,
    )
    not_completed = (
        "the knots were not moved as far as that pays"
        if refinement.deadline.passed
        else ""
    )
    if judge(best) < _BEYOND_LIMITS:
        return SolvedProgram(best.program, best.reports, not_completed)
    reports = with_last(solved.report, best.reports)
    return SolvedProgram(solved.program, reports, not_completed)


def adapt_mesh(
    solved: SolvedProgram,
    solve: Solve,
    spline: SplineSettings,
    refinement: RefinementOptions,
    *,
    target: Program | None = None,
) -> SolvedProgram:
    """Do with the knots of a solved program what a task's ``spline`` part asks for: nothing, free them, or refine.

    Parameters
    ----------
    solved : SolvedProgram
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    spline : SplineSettings
    refinement : RefinementOptions
        After its deadline no further round is begun.
    target : Program, optional
        The program over all its knots, where the solved one is its coarsest (see `solve_nested`).

    Returns
    -------
    SolvedProgram
        With fixed knots; the reports are those given, and those of further solves.
    """
    if not solved.usable:
        return solved
    nested = SolvedProgram(solved.program, (solved.report,))
    if target is not None:
        nested = solve_nested(target, nested, solve, refinement.deadline)
    last = SolvedProgram(nested.program, (nested.report,))
    if spline.knots == "free":
        adapted = optimise_knots(last, solve, spline.shortest_interval, refinement)
    elif spline.intervals == "auto":
        options = MeshOptions(spline.tolerance, spline.points_per_interval)
        adapted = refine_mesh(last, solve, options, refinement.deadline)
    else:
        adapted = last
    messages = filter(None, (nested.not_completed, adapted.not_completed))
    return SolvedProgram(
        adapted.program,
        (*solved.reports[:-1], *nested.reports[:-1], *adapted.reports),
        "; ".join(messages),
    )
