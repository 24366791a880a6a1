"""Many given intervals, reached from few: coarse problems over some of the knots, then all of them.

A cold solve with hundreds of variables takes seconds; from a coarse motion, inserted exactly, it takes a few
iterations on every level.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brachis.bspline import clamped_knots
from brachis.deadline import NEVER, Deadline
from brachis.mesh.judgement import Answer, accepted, ending_with
from brachis.nlp import Transcription
from brachis.refine import Solve
from brachis.solvers import SolverReport

_FEWEST = 12
"""Intervals of the coarsest level, at least."""


def coarsest(problem: Transcription) -> Transcription:
    """Return the problem over every 2^k-th of its knots, k as large as leaves a dozen intervals."""
    return next(_levels(problem))


def grow(
    target: Transcription, coarse: Transcription, report: SolverReport, solve: Solve, deadline: Deadline = NEVER
) -> Answer:
    """Solve a problem from the answer of its coarsest one, level by level.

    Parameters
    ----------
    target : Transcription
    coarse : Transcription
        ``coarsest(target)``, perhaps with another branch margin, which is kept.
    report : SolverReport
        Of the coarse problem's solve.
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.

    deadline : Deadline, optional
        No level is begun after it.

    Returns
    -------
    Answer
        Over the target's knots; over those of the last level that was solved, where one could not be.
    """
    reports, solved = [report], report
    for level in _levels(target):
        if len(level.knots) <= len(coarse.knots):
            continue
        if deadline.passed:
            break
        finer = coarse.with_knots(level.knots, level.tau)
        start = finer.variables_from(coarse.motion(solved.x).over(finer.knots))
        report = accepted(solve(finer, start), solved)
        reports.append(report)
        if not report.status.usable:
            break
        coarse, solved = finer, report
    reached, asked = len(coarse.breaks) - 1, len(target.breaks) - 1
    undone = f"the motion has {reached} of {asked} intervals, of which more were not solved" if reached < asked else ""
    return Answer(coarse, ending_with(solved, reports), undone)


def _levels(problem: Transcription) -> Iterator[Transcription]:
    """Problems over ever more of the knots, from the coarsest to the given one, with as many points an interval."""
    breaks = problem.breaks
    steps = int(np.log2(max((len(breaks) - 1) / _FEWEST, 1.0)))
    for k in range(steps, 0, -1):
        chosen = np.unique(np.append(np.arange(0, len(breaks), 2**k), len(breaks) - 1))
        points = problem.tau[np.unique(np.append(np.arange(0, len(problem.tau), 2**k), len(problem.tau) - 1))]
        yield problem.with_knots(clamped_knots(problem.degree, breaks[chosen]), points)
    yield problem
