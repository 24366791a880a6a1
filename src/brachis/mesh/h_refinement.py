"""A mesh refined from coarse to fine by exact knot insertion, so that every solve starts from the motion before it.

A time-optimal motion has 1 + r limits active at almost every instant, and jumps from one set of them to another. A
spline can only ramp: where it does, time is lost, about the ramp's length times its height. The intervals that lose
most are halved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.bspline import clamped_knots, spread
from brachis.errors import UnreachableError
from brachis.mesh.judgement import SHORTEST, Answer, accepted, end_time, ending_with, gain
from brachis.nlp import Phase, Program
from brachis.refine import Refined, RefinementOptions, Solve, merged, refine
from brachis.solvers import SolverReport

COARSE_INTERVALS = 10
"""Intervals with which a mesh begins."""
_SHARE = 0.6
"""A round halves the intervals that lose most, and that lose this part of the time lost altogether."""
_SAMPLES = 8
_SHORTEST = 0.5
"""No interval gets shorter than this part of the tolerance, for it cannot lose more than its own length."""
_MOST_INTERVALS = 300
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
        Gain of halving every interval, as a fraction of t_E, that ends the refinement.
    points_per_interval : int
        Collocation points of every interval.
    """

    tolerance: float = 1e-3
    points_per_interval: int = 3


def refine_mesh(
    program: Program, first: SolverReport, solve: Solve, options: MeshOptions, refinement: RefinementOptions
) -> Answer:
    """Insert knots into a solved program until halving every interval gains less than the tolerance.

    Rounds that halve the intervals that lose most go on until one of them gains little. Then the limits are made to
    hold in between (`refine`), every interval is halved, and the limits are made to hold again: the gain of that is
    what is compared with the tolerance. If it is less, the mesh is done, and the faster of the two motions is kept.

    Parameters
    ----------
    program : Program
    first : SolverReport
        Of the program's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : MeshOptions
    refinement : RefinementOptions
        After its deadline no round is begun; nor is one that looks as if it would end later.

    Returns
    -------
    Answer
        With all knots and collocation points.
    """
    reports, last, undone = [first], first, ""
    held: list[Refined] = []
    for _ in range(_MOST_ROUNDS):
        if _GROWTH * last.wall_time > refinement.deadline.left:
            undone = _UNDONE
            break
        finer, x = _halved(program, last.x, _losers(program, last.x), options)
        if finer.variables == program.variables or finer.intervals >= _MOST_INTERVALS:
            break
        report = accepted(solve(finer, x), last)
        reports.append(report)
        if not report.status.usable:
            break
        worth_it = report.objective < last.objective * (1.0 - options.tolerance)
        program, last = finer, report
        if worth_it:
            continue
        refined = refine(program, last, solve, refinement)
        doubled = _doubled(refined, solve, options, refinement)
        reports += [*refined.reports[1:], *doubled.reports]
        held += [refined, doubled]
        if not gain(refined, doubled, refinement) >= options.tolerance:
            break
    best = min(held, key=lambda refined: end_time(refined, refinement), default=None)
    if refinement.deadline.passed:
        undone = _UNDONE
    if best is None or last.objective < end_time(best, refinement):
        return Answer(program, ending_with(last, reports), undone)
    return Answer(best.program, ending_with(best.reports[-1], reports), undone)


def _losers(program: Program, x: np.ndarray) -> list[np.ndarray]:
    """Intervals of every phase that lose most time, ascending."""
    whole = program.end_time(x)
    try:
        lost = [_lost(phase, part) * (part[0] / whole) for phase, part in program.split(x)]
    except UnreachableError:  # between the collocation points
        return _every(program)
    together = np.concatenate(lost)
    order = np.argsort(-together, kind="stable")
    most = np.searchsorted(np.cumsum(together[order]), _SHARE * together.sum()) + 1
    chosen = np.isin(np.arange(len(together)), order[:most])
    return [np.flatnonzero(own) for own in np.split(chosen, np.cumsum([len(own) for own in lost])[:-1])]


def _lost(phase: Phase, x: np.ndarray) -> np.ndarray:
    """Part of the duration that each interval loses, (N,): how far as many limits as there are curves swing."""
    breaks = phase.breaks
    ratios = np.abs(phase.resampled(spread(breaks, _SAMPLES)).time_scaling_ratios(x))
    slack = 1.0 - np.sort(ratios, axis=1)[:, -len(phase.splines) :].clip(max=1.0)
    within = np.lib.stride_tricks.sliding_window_view(slack, _SAMPLES + 1, axis=0)[::_SAMPLES]
    return np.asarray(np.ptp(within, axis=2).sum(axis=1) * np.diff(breaks))


def _every(program: Program) -> list[np.ndarray]:
    return [np.arange(phase.intervals) for phase in program.phases]


def _halved(
    program: Program, x: np.ndarray, intervals: list[np.ndarray], options: MeshOptions
) -> tuple[Program, np.ndarray]:
    """Halve intervals of every phase: the finer program, and the same motion as its point."""
    pairs = zip(program.phases, intervals, strict=True)
    finer = program.with_phases(_with_halves(phase, own, options) for phase, own in pairs)
    motions = zip(program.motions(x), finer.phases, strict=True)
    return finer, finer.variables_from([motion.over(phase.knots) for motion, phase in motions])


def _with_halves(phase: Phase, intervals: np.ndarray, options: MeshOptions) -> Phase:
    breaks = phase.breaks
    shortest = max(_SHORTEST * options.tolerance, SHORTEST)
    intervals = intervals[np.diff(breaks)[intervals] >= 2.0 * shortest]
    finer = np.union1d(breaks, 0.5 * (breaks[intervals] + breaks[intervals + 1]))
    return phase.with_knots(
        clamped_knots(phase.degree, finer), merged(phase, spread(finer, options.points_per_interval))
    )


def _doubled(refined: Refined, solve: Solve, options: MeshOptions, refinement: RefinementOptions) -> Refined:
    """Halve every interval of a refined program, solve and refine again."""
    finer, x = _halved(refined.program, refined.x, _every(refined.program), options)
    return refine(finer, accepted(solve(finer, x), refined.reports[-1]), solve, refinement)
