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
from brachis.nlp import Phase, Program
from brachis.refine import Solve
from brachis.solvers import SolverReport

_FEWEST, _WITH_LEAST_SPEED = 12, 36
"""Intervals of the coarsest level, at least; more where a limit asks for a least speed, for fewer may not keep it."""


def coarsest(program: Program) -> Program:
    """Return the program over every 2^k-th of its knots, k as large as leaves a dozen intervals."""
    return next(_levels(program))


def solve_nested(
    target: Program, coarse: Program, report: SolverReport, solve: Solve, deadline: Deadline = NEVER
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
    reports, solved = [report], report
    for level in _levels(target):
        if level.intervals <= coarse.intervals:
            continue
        if deadline.passed:
            break
        pairs = list(zip(coarse.split(solved.x), level.phases, strict=True))
        finer = coarse.with_phases(own.with_knots(fine.knots, fine.t_norm) for (own, _), fine in pairs)
        start = finer.variables_from([own.motion(part).over(fine.knots) for (own, part), fine in pairs])
        report = accepted(solve(finer, start), solved)
        reports.append(report)
        if not report.status.usable:
            break
        coarse, solved = finer, report
    reached, asked = coarse.intervals, target.intervals
    undone = f"the motion has {reached} of {asked} intervals, of which more were not solved" if reached < asked else ""
    return Answer(coarse, ending_with(solved, reports), undone)


def _levels(program: Program) -> Iterator[Program]:
    """Programs over ever more of the knots, from the coarsest to the given one, with as many points an interval."""
    fewest = _WITH_LEAST_SPEED if any(limit.least_speed for limit in program.limits) else _FEWEST
    steps = [int(np.log2(max(phase.intervals / fewest, 1.0))) for phase in program.phases]
    for k in range(max(steps), 0, -1):
        pairs = zip(program.phases, steps, strict=True)
        yield program.with_phases(_thinned(phase, 2 ** min(k, own)) for phase, own in pairs)
    yield program


def _thinned(phase: Phase, every: int) -> Phase:
    """Keep every so many-th knot and collocation point, and the last ones."""
    breaks, t_norm = (values[_every(len(values), every)] for values in (phase.breaks, phase.t_norm))
    return phase.with_knots(clamped_knots(phase.degree, breaks), t_norm)


def _every(count: int, step: int) -> np.ndarray:
    return np.unique(np.append(np.arange(0, count, step), count - 1))
