"""Knots where they pay: a mesh refined from coarse to fine, or interval lengths as variables of the optimisation.

A time-optimal motion has 1 + r limits active at almost every instant, and jumps from one set of them to another. A
spline can only ramp: where it does, time is lost, about the ramp's length times its height. `refine_mesh` halves the
intervals that lose most, by exact knot insertion, so that the next solve starts from the same motion and needs a few
iterations. `free_knots` leaves the number of intervals as it is and moves the knots to the jumps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brachis.bspline import clamped_knots, spread
from brachis.errors import UnreachableError
from brachis.nlp import Transcription
from brachis.refine import Refined, RefinementOptions, Solve, merged, refine
from brachis.solvers import SolverReport, SolveStatus
from brachis.task.models import SplineSettings

COARSE_INTERVALS = 10
"""Intervals with which a mesh begins."""
_SHARE = 0.6
"""A round halves the intervals that lose most, and that lose this part of the time lost altogether."""
_SAMPLES = 8
_SHORTEST = 0.5, 5e-5
"""No interval gets shorter than this part of the tolerance, for it cannot lose more than its own length; nor, as a
part of t_E, than this: collocation points would fall together."""
_MOST_INTERVALS = 300
_MESH_ROUNDS = 20
_FREE_ROUNDS = 5
_FEASIBLE = 1e-5
_WORTH_IT = 2e-4
"""Knots are moved again as long as that shortens the motion by this part of it."""

Answer = tuple[Transcription, tuple[SolverReport, ...]]
"""A problem and the reports of all solves, of which the last one belongs to it."""


@dataclass(frozen=True)
class MeshOptions:
    """When a mesh is fine enough.

    Attributes
    ----------
    tolerance : float
        Gain of halving every interval, as a fraction of t_E, that ends the refinement.
    points_per_interval : int
        Collocation points of every interval.
    """

    tolerance: float = 1e-3
    points_per_interval: int = 3


def settle_knots(
    problem: Transcription,
    reports: tuple[SolverReport, ...],
    solve: Solve,
    spline: SplineSettings,
    refinement: RefinementOptions,
) -> Answer:
    """Do with the knots of a solved problem what a task's ``spline`` part asks for: nothing, free them, or refine.

    Parameters
    ----------
    problem : Transcription
    reports : tuple of SolverReport
        The last one is of the problem's solve.
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    spline : SplineSettings
    refinement : RefinementOptions

    Returns
    -------
    problem : Transcription
        With fixed knots.
    reports : tuple of SolverReport
        Those given, and those of further solves.
    """
    if not reports[-1].status.usable:
        return problem, reports
    if spline.knots == "free":
        problem, further = free_knots(problem, reports[-1], solve, spline.shortest_interval, refinement)
    elif spline.intervals == "auto":
        options = MeshOptions(spline.tolerance, spline.points_per_interval)
        problem, further = refine_mesh(problem, reports[-1], solve, options, refinement)
    else:
        return problem, reports
    return problem, (*reports[:-1], *further)


def refine_mesh(
    problem: Transcription, first: SolverReport, solve: Solve, options: MeshOptions, refinement: RefinementOptions
) -> Answer:
    """Insert knots into a solved problem until halving every interval gains less than the tolerance.

    Rounds that halve the intervals that lose most go on until one of them gains little. Then the limits are made to
    hold in between (`refine`), every interval is halved, and the limits are made to hold again: the gain of that is
    what is compared with the tolerance. If it is less, the mesh is done, and the faster of the two motions is kept.

    Parameters
    ----------
    problem : Transcription
    first : SolverReport
        Of the problem's solve.
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    options : MeshOptions
    refinement : RefinementOptions

    Returns
    -------
    problem : Transcription
        With all knots and collocation points.
    reports : tuple of SolverReport
        Of all solves, `first` included; the last one belongs to `problem`.
    """
    reports, last = [first], first
    held: list[Refined] = []
    for _ in range(_MESH_ROUNDS):
        finer, x = _halved(problem, last.x, _losers(problem, last.x), options)
        if finer.variables == problem.variables or len(finer.breaks) > _MOST_INTERVALS:
            break
        report = _accepted(solve(finer, x), last)
        reports.append(report)
        if not report.status.usable:
            break
        gain = 1.0 - report.objective / last.objective
        problem, last = finer, report
        if gain > options.tolerance:
            continue
        settled = refine(problem, last, solve, refinement)
        doubled = _doubled(settled, solve, options, refinement)
        reports += [*settled.reports[1:], *doubled.reports]
        held += [settled, doubled]
        if not _gain(settled, doubled, refinement) >= options.tolerance:
            break
    best = min(held, key=lambda refined: _time(refined, refinement), default=None)
    if best is None or last.objective < _time(best, refinement):
        return problem, _ending_with(last, reports)
    return best.problem, _ending_with(best.reports[-1], reports)


def _losers(problem: Transcription, x: np.ndarray) -> np.ndarray:
    """Intervals that lose most time, ascending: how far the 1 + r limits that press most swing, times the length."""
    lengths = np.diff(problem.breaks)
    try:
        state = problem.resampled(spread(problem.breaks, _SAMPLES)).state(x)
    except UnreachableError:  # between the collocation points
        return np.arange(len(lengths))
    ratios = np.concatenate([np.abs(c.values(state)) for c in problem.constraints if c.timed], axis=1)
    slack = 1.0 - np.sort(ratios, axis=1)[:, -(1 + problem.decomposition.r) :].clip(max=1.0)
    within = np.lib.stride_tricks.sliding_window_view(slack, _SAMPLES + 1, axis=0)[::_SAMPLES]
    lost = np.ptp(within, axis=2).sum(axis=1) * lengths
    order = np.argsort(-lost, kind="stable")
    most = np.searchsorted(np.cumsum(lost[order]), _SHARE * lost.sum()) + 1
    return np.sort(order[:most])


def _halved(
    problem: Transcription, x: np.ndarray, intervals: np.ndarray, options: MeshOptions
) -> tuple[Transcription, np.ndarray]:
    """Halve intervals of a problem: the finer problem, and the same motion as its point."""
    breaks = problem.breaks
    shortest = max(_SHORTEST[0] * options.tolerance, _SHORTEST[1])
    intervals = intervals[np.diff(breaks)[intervals] >= 2.0 * shortest]
    finer = np.union1d(breaks, 0.5 * (breaks[intervals] + breaks[intervals + 1]))
    knots = clamped_knots(problem.degree, finer)
    other = problem.with_knots(knots, merged(problem.tau, spread(finer, options.points_per_interval)))
    return other, other.variables_from(problem.motion(x).over(knots))


def _accepted(report: SolverReport, before: SolverReport) -> SolverReport:
    """Accept a solve that ended early with a feasible motion faster than the one that it began with."""
    better = report.violation <= _FEASIBLE and report.objective < before.objective
    early = report.status in (SolveStatus.ITERATION_LIMIT, SolveStatus.TIME_LIMIT, SolveStatus.STALLED)
    return replace(report, status=SolveStatus.ACCEPTABLE) if better and early else report


def _doubled(settled: Refined, solve: Solve, options: MeshOptions, refinement: RefinementOptions) -> Refined:
    """Halve every interval of a refined problem, solve and refine again."""
    every = np.arange(len(settled.problem.breaks) - 1)
    finer, x = _halved(settled.problem, settled.x, every, options)
    return refine(finer, _accepted(solve(finer, x), settled.reports[-1]), solve, refinement)


def _time(refined: Refined, refinement: RefinementOptions) -> float:
    """End time of a motion that holds the limits, infinite for others."""
    holds = refined.converged and (refined.excess <= refinement.tolerance or not refinement.max_rounds)
    return float(refined.x[0]) if holds else np.inf


def _gain(before: Refined, after: Refined, refinement: RefinementOptions) -> float:
    """Part of the end time that is gained; NaN where neither motion holds the limits."""
    if not np.isfinite(_time(before, refinement)):
        return 1.0 if np.isfinite(_time(after, refinement)) else np.nan
    return 1.0 - _time(after, refinement) / _time(before, refinement)


def free_knots(
    problem: Transcription, first: SolverReport, solve: Solve, shortest: float, refinement: RefinementOptions
) -> Answer:
    """Optimise the interval lengths of a solved problem together with the motion.

    Collocation points keep their places within their intervals while the knots move. The knots are then fixed and the
    limits made to hold in between (`refine`); from there, with the points that this added, the knots are freed again,
    as long as that gains.

    Parameters
    ----------
    problem : Transcription
        With fixed knots.
    first : SolverReport
        Of the problem's solve.
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    shortest : float
        Least length of an interval, in mean intervals.
    refinement : RefinementOptions

    Returns
    -------
    problem : Transcription
        With its knots fixed where they are best; the given one if freeing them led nowhere.
    reports : tuple of SolverReport
        Of all solves, `first` included; the last one belongs to `problem`.
    """
    reports, best, x = [first], None, first.x
    for _ in range(_FREE_ROUNDS):
        free = problem.with_free_knots(shortest)
        moved = solve(free, free.variables_from(problem.motion(x)))
        fixed, start = free.frozen(moved.x)
        # A few iterations, where the solver stalled before the knots came to rest.
        report = _accepted(solve(fixed, start), reports[-1])
        reports += [moved, report]
        if not report.status.usable:
            break
        refined = refine(fixed, report, solve, refinement)
        reports += refined.reports[1:]
        gain = np.inf if best is None else _gain(best, refined, refinement)
        if best is None or gain > 0.0:
            best = refined
        if not gain > _WORTH_IT:
            break
        problem, x = refined.problem, refined.x
    if best is None:
        return problem, _ending_with(first, reports)
    return best.problem, _ending_with(best.reports[-1], reports)


def _ending_with(last: SolverReport, reports: list[SolverReport]) -> tuple[SolverReport, ...]:
    """Move one of the reports to the end."""
    return (*(report for report in reports if report is not last), last)
