"""Solves over time that lead from one program to the next: fewer limits first, large branch margins, more points.

Branch margins: near a branch boundary the problem is badly conditioned, and a solver that meets the boundary early
creeps along it. Far from it the solve is easy, and its answer is a good start for a smaller margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from brachis.common import tolerances
from brachis.limits.safeguards import HELD_BACK
from brachis.optimise.backends import SolveStatus
from brachis.optimise.improve import (
    Solve,
    SolvedProgram,
    attempt_once,
    improve,
)
from brachis.optimise.program import Program

_FAR = 0.5
"""Violation, as a part of a limit, that a smaller branch margin does not mend."""


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
