"""Free knots: interval lengths as variables of the optimisation, from the answer for given ones."""

from __future__ import annotations

import numpy as np

from brachis.mesh.judgement import SHORTEST, Answer, accepted, end_time, ending_with, gain
from brachis.nlp import Program
from brachis.refine import RefinementOptions, Solve, refine
from brachis.solvers import SolverReport

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
    reports, best, x = [first], None, first.x
    shortest = max(shortest, SHORTEST * max(phase.intervals for phase in program.phases))
    for _ in range(_ROUNDS):
        if refinement.deadline.passed:
            break
        free = program.with_free_knots(shortest)
        moved = solve(free, free.variables_from(program.motions(x)))
        fixed, start = free.frozen(moved.x)
        # A few iterations, where the solver stalled before the knots came to rest.
        report = accepted(solve(fixed, start), reports[-1])
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
        program, x = refined.program, refined.x
    undone = "the knots were not moved as far as that pays" if refinement.deadline.passed else ""
    if best is None or not np.isfinite(end_time(best, refinement)):
        return Answer(given, ending_with(first, reports), undone)
    return Answer(best.program, ending_with(best.reports[-1], reports), undone)
