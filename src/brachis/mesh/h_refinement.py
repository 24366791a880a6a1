"""A mesh refined from coarse to fine by exact knot insertion, so that every solve starts from the motion before it.

A time-optimal motion has 1 + r limits active at almost every instant, and jumps from one set of them to another. A
spline can only ramp: where it does, time is lost, about the ramp's length times its height. The intervals that lose
most are halved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.bspline import clamped_knots, spread
from brachis.deadline import Deadline
from brachis.errors import UnreachableError
from brachis.mesh.judgement import SHORTEST, Answer, accepted, ending_with
from brachis.nlp import Phase, Program
from brachis.refine import Solve, merged
from brachis.solvers import SolverReport

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
    program: Program, first: SolverReport, solve: Solve, options: MeshOptions, deadline: Deadline
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
    reports, last, gains = [first], first, [1.0]
    is_settled = False
    for _ in range(_MOST_ROUNDS):
        if _GROWTH * last.wall_time > deadline.left:
            return Answer(program, ending_with(last, reports), _UNDONE)
        intervals = _every(program) if is_settled else _losers(program, last.x, options)
        finer, x = _halved(program, last.x, intervals, options)
        if finer.variables > _MOST_VARIABLES:
            return Answer(program, ending_with(last, reports), _UNDONE)
        if finer.variables == program.variables:
            break
        report = accepted(solve(finer, x), last)
        reports.append(report)
        if not report.status.usable:
            break
        gains.append(1.0 - report.objective / last.objective)
        program, last = finer, report
        is_settled = sum(gains[-2:]) < _ENOUGH * options.tolerance
        if is_settled and 2 * program.variables > _FEW_VARIABLES:
            break
    return Answer(program, ending_with(last, reports))


def _losers(program: Program, x: np.ndarray, options: MeshOptions) -> list[np.ndarray]:
    """Intervals of every phase that lose most time and are long enough to be halved, ascending."""
    whole = program.end_time(x)
    try:
        lost = [
            _lost(phase, part) * (part[0] / whole) * _can_be_halved(phase, options) for phase, part in program.split(x)
        ]
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


def _can_be_halved(phase: Phase, options: MeshOptions) -> np.ndarray:
    """Tell of every interval, (N,), whether its halves are long enough."""
    return np.diff(phase.breaks) >= 2.0 * max(_SHORTEST * options.tolerance, SHORTEST)


def _with_halves(phase: Phase, intervals: np.ndarray, options: MeshOptions) -> Phase:
    breaks = phase.breaks
    intervals = intervals[_can_be_halved(phase, options)[intervals]]
    finer = np.union1d(breaks, 0.5 * (breaks[intervals] + breaks[intervals + 1]))
    return phase.with_knots(
        clamped_knots(phase.degree, finer), merged(phase, spread(finer, options.points_per_interval))
    )
