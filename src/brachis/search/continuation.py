"""Solves over time that lead from one program to the next: fewer limits first, large branch margins, more points.

Branch margins: near a branch boundary the problem is badly conditioned, and a solver that meets the boundary early
creeps along it. Far from it the solve is easy, and its answer is a good start for a smaller margin.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from brachis.common import tolerances
from brachis.errors import UnreachableError
from brachis.limits.safeguards import HELD_BACK, MARGINS
from brachis.optimise.backends import SolverReport, SolveStatus
from brachis.optimise.guess import shortest_time
from brachis.optimise.improve import (
    Solve,
    SolvedProgram,
    SolverSession,
    attempt_once,
    improve,
)
from brachis.optimise.program import Program
from brachis.optimise.refine import add_points_where_lost

_FAR = 0.5
"""Violation, as a part of a limit, that a smaller branch margin does not mend."""
_MOST_ADDED = 2
"""How often points are added."""


def solve_within_branch(
    program: Program, x: np.ndarray, session: SolverSession
) -> SolvedProgram:
    """Solve; while the motion leaves the branch, or the chart, between collocation points, add points there.

    Each solve begins at `x`: the last answer cannot be evaluated at the new points. Refinement, which begins with a
    motion, cannot add them.
    """
    solved = solve_by_margin_continuation(program, x, session, MARGINS)
    reports = solved.reports
    for _ in range(_MOST_ADDED):
        if not solved.usable or session.deadline.passed:
            break
        finer = add_points_where_lost(program, solved.x)
        if finer is None:
            break
        program = finer
        solved = solve_by_margin_continuation(program, x, session, MARGINS)
        reports = (*reports, *solved.reports)
    return replace(solved, reports=reports)


def solve_by_margin_continuation(
    program: Program, x: np.ndarray, solve: Solve, margins: Sequence[float]
) -> SolvedProgram:
    """Solve with ever smaller branch margins, each from the last answer.

    A margin that does not hold the motion back, or that hardly shortens it, ends the continuation. So does an answer
    far beyond the limits: no margin is that large.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
        Starting point.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    margins : sequence of float
        Least branch margins, descending.

    Returns
    -------
    SolvedProgram
        With the last margin for which the solve ended well; with the last one tried if none did.
    """

    def use(smaller: Program, kept: SolvedProgram) -> tuple[Program, np.ndarray] | None:
        """Go on with a smaller margin, from the answer so far; None if that is free of its margin."""
        if not kept.reports:
            return smaller, x
        report = kept.report
        is_free = kept.usable and kept.program.safeguard_slack(report.x) > HELD_BACK
        is_far = _FAR < report.violation < np.inf
        if is_free or is_far or report.status is SolveStatus.TIME_LIMIT:
            return None
        # An unusable answer may have run out of iterations on its way.
        return smaller, report.x if kept.usable or report.violation <= 1e-3 else x

    # Closed forms may have no margins, or the start posture caps them.
    programs = {
        each.safeguard_bounds: each for each in map(program.with_margin, margins)
    }
    return improve(
        SolvedProgram(program),
        [partial(use, smaller) for smaller in programs.values()],
        partial(attempt_once, solve),
        least_gain=tolerances.GAIN,
        go_on_above=tolerances.GAIN,
    )


def solve_without_third_order_limits(
    program: Program, x: np.ndarray, solve: Solve, margin: float
) -> tuple[np.ndarray, tuple[SolverReport, ...]]:
    """Find a better starting point for limits on the third derivative: the answer without them, time-scaled.

    Where the motion must slow down, such limits have local optima in which it all but stops. The fastest motion without
    them has slowed down where it must; its shape over time, slowed down as a whole, leads past them.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
        Starting point.
    solve : callable
    margin : float
        Least branch margin.

    Returns
    -------
    x : (v,) ndarray
        The given point without such limits, or if that solve failed.
    reports : tuple of SolverReport
        Of the solve without them.
    """
    if all(limit.order <= 2 for limit in program.limits):
        return x, ()
    easier = program.without_orders_above(2)
    report = solve(easier.with_margin(margin), x)
    if report.status.usable:
        with contextlib.suppress(UnreachableError):
            x = shortest_time(program, report.x)
    return x, (report,)
