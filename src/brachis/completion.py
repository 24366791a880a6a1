"""From a solved program to a verified motion: refinement, trajectory, verification."""

from __future__ import annotations

import contextlib

import numpy as np

from brachis.attempt import Attempt
from brachis.errors import UnreachableError
from brachis.extract import extract, where_it_failed
from brachis.nlp import Program
from brachis.refine import Refined, RefinementOptions, Solve, refine
from brachis.solvers import SolverReport
from brachis.verify import verify_trajectory

_SECOND_LOOKS = 4
"""Times that a motion which the verification refuses is refined again where it failed."""


def completed(
    attempt: Attempt, program: Program, reports: tuple[SolverReport, ...], solve: Solve, options: RefinementOptions
) -> Attempt:
    """Refine and verify; only verify where the time is up.

    Parameters
    ----------
    attempt : Attempt
        Of which the program is made.
    program : Program
    reports : tuple of SolverReport
        Of all solves so far; the last one is the program's.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    Attempt
    """
    refined = refine(program, reports[-1], solve, options)
    done = _verified(attempt, reports[:-1], refined)
    for _ in range(_SECOND_LOOKS if options.max_rounds else 0):
        finer = None if options.deadline.passed else where_it_failed(done)
        if finer is None:
            break
        report = solve(finer, refined.x)
        if not report.status.usable:
            break
        refined = refine(finer, report, solve, options)
        done = _verified(attempt, reports[:-1], refined)
    return done


def _verified(attempt: Attempt, before: tuple[SolverReport, ...], refined: Refined) -> Attempt:
    """Make the trajectory of a refined program and verify it; `before` are the reports of earlier solves."""
    start = attempt.start
    assert start is not None  # noqa: S101
    problem, trajectory, verification = start.problem, None, None
    if refined.converged and np.isfinite(refined.violation):
        with contextlib.suppress(UnreachableError):
            trajectory = extract(start, refined)
            verification = verify_trajectory(trajectory, own_limits=problem.further)
    return attempt.finished(
        reports=(*before, *refined.reports),
        refined=refined,
        trajectory=trajectory,
        verification=verification,
        tolerance=problem.task.refinement.tolerance,
    )
