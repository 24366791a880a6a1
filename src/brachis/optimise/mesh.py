"""Changes to the knots of a solved program: more knots, better ones, or free ones.

- `solve_by_levels` reaches a given large number of intervals from a few. A cold solve with hundreds of variables takes
  seconds. Started from an exact copy of a coarser motion, each level takes a few iterations.
- `refine_mesh` halves the intervals that cost the most time. In a time-optimal motion 1 + r limits are active at almost
  every instant, and the motion jumps from one set of active limits to another. A spline can only ramp from set to set.
  This costs about the ramp's length times its height.
- `optimise_knots` makes the interval lengths variables of the optimisation.
- `adapt_mesh` makes the change that the task asks for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from brachis.common import tolerances
from brachis.common.arrays import spread
from brachis.common.deadline import NEVER, Deadline
from brachis.errors import UnreachableError
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.improve import (
    Solve,
    SolvedProgram,
    attempt_in_turn,
    attempt_once,
    improve,
    judge_early_end,
    solves_in_turn,
    with_last,
)
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, merge_points, refine
from brachis.task import SplineSettings

_FEW_INTERVALS = 12
"""Minimum number of intervals of a phase in the coarsest level."""
_SHORTEST = 5e-5
"""Minimum length of an interval, as a fraction of t_E. In a shorter interval, collocation points would coincide."""


def coarsest(program: Program) -> Program:
    """Return the program over every 2^k-th of its knots, with the largest k that leaves at least 12 intervals."""
    return next(_levels(program))


def solve_by_levels(
    target: Program, coarse: SolvedProgram, solve: Solve, deadline: Deadline = NEVER
) -> SolvedProgram:
    """Solve a program level by level, from the solution of its coarsest level.

    Parameters
    ----------
    target : Program
    coarse : SolvedProgram
        The solved ``coarsest(target)``. If its branch margin is different, that margin is kept.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    deadline : Deadline, optional
        Deadline after which no level is started.

    Returns
    -------
    SolvedProgram
        The program over the knots of the target, or over those of the finest level that could be solved.
    """

    def change_to(level: Program, solved: SolvedProgram) -> tuple[Program, np.ndarray]:
        """Express a motion over the knots of a level."""
        pairs = zip(solved.program.phases, level.phases, strict=True)
        # The solved program may have a different branch margin.
        phases = [phase.with_knots(fine.knots, fine.t_norm) for phase, fine in pairs]
        return _transfer(solved, phases)

    finer = (
        partial(change_to, level)
        for level in _levels(target)
        if level.intervals > coarse.program.intervals
    )
    attempt = partial(attempt_once, solve, accept_early_end=True)
    reached = improve(coarse, finer, attempt, deadline=deadline)
    intervals = reached.program.intervals
    if intervals == target.intervals:
        return reached
    not_completed = f"the motion has {intervals} intervals, and was not solved with all {target.intervals}"
    return replace(reached, not_completed=not_completed)


def _transfer(
    solved: SolvedProgram, phases: Sequence[Phase]
) -> tuple[Program, np.ndarray]:
    """Express a solved program and its solution over the knots of `phases`, which contain all of its own knots."""
    finer = solved.program.with_phases(phases)
    pairs = zip(solved.program.motions(solved.x), phases, strict=True)
    motions = [motion.with_knots(phase.knots) for motion, phase in pairs]
    return finer, finer.variables_from(motions)


def _levels(program: Program) -> Iterator[Program]:
    """Yield the program over more and more of its knots, with the same number of points per interval."""
    counts = [phase.intervals / _FEW_INTERVALS for phase in program.phases]
    halvings = [int(np.log2(max(count, 1.0))) for count in counts]
    for k in range(max(halvings), 0, -1):
        pairs = zip(program.phases, halvings, strict=True)
        yield program.with_phases(
            _thin_out(phase, 2 ** min(k, max_halvings)) for phase, max_halvings in pairs
        )
    yield program


def _thin_out(phase: Phase, step: int) -> Phase:
    """Return a phase with every `step`-th knot and collocation point, and with the last ones."""

    def thin_out(values: np.ndarray) -> np.ndarray:
        return np.union1d(values[::step], values[-1:])

    knots = clamped_knots(phase.degree, thin_out(phase.breaks))
    return phase.with_knots(knots, thin_out(phase.t_norm))


COARSE_INTERVALS = 10
"""Number of intervals of the first mesh."""
_FEW_VARIABLES = 150
"""Number of variables up to which every interval is halved, in case the wrong intervals were chosen."""
_MOST_VARIABLES = 300
"""Maximum number of variables. A solve with more variables takes seconds and gains about 0.1 %."""
_COARSER = "the mesh is coarser than spline.tolerance requires"


def refine_mesh(
    solved: SolvedProgram, solve: Solve, spline: SplineSettings, deadline: Deadline
) -> SolvedProgram:
    """Insert knots into a solved program until further knots gain little.

    Every round halves the intervals that cost the most time, and solves again from the same motion. The rounds end when
    the last two together have gained less than half the tolerance. Before they end, a small mesh is halved everywhere.
    They also end, without the last mesh, if its motion is slower by more than the tolerance.

    Parameters
    ----------
    solved : SolvedProgram
        The solved program. It must have one report.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    spline : SplineSettings
        Spline settings. The tolerance is a fraction of the end time.
    deadline : Deadline
        Deadline after which no round is started.

    Returns
    -------
    SolvedProgram
        The program over all knots, old and new.
    """
    # An interval cannot cost more time than its own length.
    shortest = max(0.5 * spline.tolerance, _SHORTEST)

    def halve(solved: SolvedProgram) -> tuple[Program, np.ndarray] | str | None:
        """Halve the intervals that cost the most time, unless this is no longer worthwhile."""
        program = solved.program
        times = np.array([report.objective for report in solved.reports])
        gains = 1.0 - times[1:] / times[:-1]
        is_settled = (
            len(gains) > 1 and np.abs(gains[-2:]).sum() < 0.5 * spline.tolerance
        )
        if is_settled and 2 * program.variables > _FEW_VARIABLES:
            return None
        if deadline.passed:
            return _COARSER
        allowed = [np.diff(phase.breaks) >= 2.0 * shortest for phase in program.phases]
        chosen = allowed if is_settled else _choose_intervals(solved, allowed)
        pairs = zip(program.phases, chosen, strict=True)
        points = spline.points_per_interval
        finer, x = _transfer(solved, [_halve(*pair, points) for pair in pairs])
        if finer.variables > _MOST_VARIABLES:
            return _COARSER
        return None if finer.variables == program.variables else (finer, x)

    def attempt(program: Program, x: np.ndarray) -> SolvedProgram:
        """Solve with one method; if it gives no motion, with the other one."""
        return attempt_in_turn(solves_in_turn(solve, program), program, x)

    # More collocation points make a motion slightly slower. An interior-point method may end at a much slower one; the
    # other method then took 14 s to gain 0.07 %.
    return improve(
        solved,
        [halve] * 20,
        attempt,
        least_gain=-spline.tolerance,
        go_on_above=-spline.tolerance,
        if_lost=_COARSER,
    )


def _choose_intervals(
    solved: SolvedProgram, allowed: Sequence[np.ndarray]
) -> Sequence[np.ndarray]:
    """Choose the intervals that cost the most time, which together cause 60 % of the loss in all phases."""
    x = solved.x
    program = solved.program
    try:
        losses = [
            _loss(*pair, has_time_laws=program.has_time_laws)
            for pair in program.split(x)
        ]
    except UnreachableError:  # between the collocation points
        return allowed
    mask = np.concatenate(allowed)
    lost = np.concatenate(losses) * mask
    order = np.argsort(-lost, kind="stable")
    count = np.searchsorted(np.cumsum(lost[order]), 0.6 * lost.sum()) + 1
    chosen = np.zeros(len(lost), dtype=bool)
    chosen[order[:count]] = lost[order[:count]] > 0.0
    ends = np.cumsum([len(is_allowed) for is_allowed in allowed])
    return np.split(chosen & mask, ends[:-1])


def _loss(phase: Phase, x: np.ndarray, *, has_time_laws: bool) -> np.ndarray:
    """Estimate the time that each interval costs, (N,), s, from the swing of the most active limits.

    As many limits are considered as there are curves. If the duration is given, no time can be lost. If the program has
    another phase of given duration, the loss is no more than what the tool would save at its maximum speed.
    """
    if phase.time_law is not None:
        return np.zeros(phase.intervals)
    breaks = phase.breaks
    samples = 24
    dense = phase.with_points(spread(breaks, samples))
    ratios = np.abs(dense.time_scaling_ratios(x))
    slack = 1.0 - np.sort(ratios, axis=1)[:, -len(phase.splines) :]
    windows = sliding_window_view(slack, samples + 1, axis=0)
    share = np.ptp(windows[::samples], axis=2).sum(axis=1)
    pairs = zip(dense.limits, dense.evaluate(x).by_limit, strict=True)
    for limit, values in pairs:
        if has_time_laws and limit.is_of_tool_speed:
            slack = np.maximum(1.0 - limit.ratio(values).max(axis=1), 0.0)
            windows = sliding_window_view(slack, samples + 1)[::samples]
            share = np.minimum(share, windows.mean(axis=1))
    return share * np.diff(breaks) * x[0]


def _halve(phase: Phase, chosen: np.ndarray, points: int) -> Phase:
    """Halve the chosen intervals, (N,), and add collocation points, `points` per interval."""
    breaks = phase.breaks
    middles = 0.5 * (breaks[:-1] + breaks[1:])
    finer = np.union1d(breaks, middles[chosen])
    t_norm = merge_points(phase, spread(finer, points))
    return phase.with_knots(clamped_knots(phase.degree, finer), t_norm)


_BEYOND_LIMITS = 1e9
"""End time assigned to a motion that violates the limits, s. Any motion within the limits is better."""


def optimise_knots(
    solved: SolvedProgram, solve: Solve, shortest: float, refinement: RefinementOptions
) -> SolvedProgram:
    """Optimise the interval lengths of a solved program together with the motion.

    Collocation points keep their places within their intervals while the knots move. Then the knots are fixed, and
    `refine` adds points until the limits are also met between collocation points. As long as this gains time, the knots
    are freed again, with the added points.

    Parameters
    ----------
    solved : SolvedProgram
        The solved program, with fixed knots.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    shortest : float
        Minimum length of an interval, in mean intervals. Whatever this value, it is at least 5e-5 t_E.
    refinement : RefinementOptions
        Options of `refine`. The knots are not freed again after the deadline of these options.

    Returns
    -------
    SolvedProgram
        The program with its knots fixed at the best places found. If moving the knots led to no motion within the
        limits, the given program is returned.
    """
    intervals = max(phase.intervals for phase in solved.program.phases)
    shortest = max(shortest, _SHORTEST * intervals)

    def free_knots(solved: SolvedProgram) -> tuple[Program, np.ndarray]:
        """Make the interval lengths variables."""
        free = solved.program.with_free_knots(shortest)
        return free, free.variables_from(solved.program.motions(solved.x))

    def move_fix_and_refine(free: Program, x: np.ndarray) -> SolvedProgram:
        """Move the knots, fix them at their final places, and refine."""
        moved = solve(free, x)
        fixed, start = free.fix_knots(moved.x)
        # If the solver stalled before the knots had settled, this takes a few iterations.
        report = judge_early_end(solve(fixed, start), free.end_time(x))
        refined = refine(fixed, report, solve, refinement)
        return replace(refined, reports=(moved, *refined.reports))

    def judge(candidate: SolvedProgram) -> float:
        """Return the time of a motion within the limits, s, and a very large number for any other motion."""
        if not np.isfinite(candidate.violation):
            return np.inf
        if refinement.max_rounds and candidate.violation > refinement.tolerance:
            return _BEYOND_LIMITS
        return candidate.t_end

    best = improve(
        solved,
        [free_knots] * 5,
        move_fix_and_refine,
        least_gain=0.0,
        go_on_above=tolerances.GAIN,
        judge=judge,
        deadline=refinement.deadline,
    )
    not_completed = ""
    if refinement.deadline.passed:
        not_completed = "the optimisation of the knots was not completed"
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
    """Free the knots of a solved program, add knots, or change nothing, as the task's ``spline`` part asks.

    Parameters
    ----------
    solved : SolvedProgram
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    spline : SplineSettings
    refinement : RefinementOptions
        Options of `refine`. No further round is started after the deadline of these options.
    target : Program, optional
        The program over all its knots, if `solved` is only its coarsest level (see `solve_by_levels`).

    Returns
    -------
    SolvedProgram
        The program with fixed knots. Its reports are those of the given program and of further solves.
    """
    if not solved.usable:
        return solved
    nested = SolvedProgram(solved.program, (solved.report,))
    if target is not None:
        nested = solve_by_levels(target, nested, solve, refinement.deadline)
    adapted = SolvedProgram(nested.program, (nested.report,))
    if spline.knots == "free":
        adapted = optimise_knots(adapted, solve, spline.shortest_interval, refinement)
    elif spline.intervals == "auto":
        adapted = refine_mesh(adapted, solve, spline, refinement.deadline)
    messages = filter(None, (nested.not_completed, adapted.not_completed))
    return SolvedProgram(
        adapted.program,
        (*solved.reports[:-1], *nested.reports[:-1], *adapted.reports),
        "; ".join(messages),
    )
