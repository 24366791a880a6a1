"""Candidates whose timing the phase plane knows: it is the plan but for the splines."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise import retiming
from brachis.optimise.backends import SolverReport, solvers_for
from brachis.optimise.candidate import Candidate, InitialGuess, verify
from brachis.optimise.improve import SolvedProgram, SolverSession
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.search.over_path import improve_guess

_MORE = 1.2
"""Times the violation by which a timing takes longer."""
_LESS = 0.9
"""Factor on an excess beyond a limit that such a longer time should bring, at least."""
_LONGEST = 0.1
"""Part of the time by which it may."""


def begin_with_timing(
    start: InitialGuess, program: Program
) -> tuple[Program, np.ndarray] | None:
    """Lay first splines along the fastest timing of a joint path, where the task leaves the knots open."""
    problem = start.problem
    spline = problem.task.spline
    is_given = spline.intervals != "auto"
    if is_given or problem.task.boundary.periodic or any(problem.time_laws):
        return None
    return retiming.begin_with_timing(program, start.legs, spline.points_per_interval)


def solve_over_path(
    start: InitialGuess, program: Program, session: SolverSession
) -> Candidate | None:
    """Solve from a guess over the path, where its timing may be the plan.

    That is where the phase plane knows all limits, and the knots are open. As a fallback other solvers solve over time.

    Parameters
    ----------
    start : InitialGuess
    program : Program
        Of its joint maps, over any knots.
    session : SolverSession

    Returns
    -------
    Candidate or None
        None where that is not so, or where the limits allow no timing.
    """
    problem = start.problem
    is_open = problem.task.spline.intervals == "auto"
    is_first = start.solver == solvers_for(problem.task.solver.name)[0].name
    if not (is_open and is_first and retiming.is_timing_all(program)):
        return None
    reports: tuple[SolverReport, ...] = ()
    if not start.is_improved:
        try:
            better = improve_guess(start, program, session, retiming.ROUGH)
        except UnreachableError:
            return None
        start, program = better.start, better.program
        reports = better.found.reports
    if not start.is_improved:
        return None
    return Candidate.of(
        start,
        "planned",
        program=program,
        target=program,
        is_over_path=True,
        reports=reports,
        coarse=start.estimate,
    )


def plan_timing(
    candidate: Candidate,
    program: Program,
    timings: Sequence[PhaseTiming | None],
    reports: tuple[SolverReport, ...],
    options: RefinementOptions,
) -> Candidate | None:
    """Lay splines along the timings of all phases, and verify them.

    Where a limit is exceeded by a little between the places looked at, the motion takes a little longer, if that helps.

    Parameters
    ----------
    candidate : Candidate
    program : Program
        Over any knots.
    timings : sequence of PhaseTiming or None
    reports : tuple of SolverReport
        Of earlier solves.
    options : RefinementOptions

    Returns
    -------
    Candidate or None
        None where a phase has no timing.
    """
    assert candidate.start is not None
    spline = candidate.start.problem.task.spline
    laid = retiming.lay_splines(
        program,
        timings,
        spline.tolerance,
        spline.points_per_interval,
        options.deadline,
    )
    if laid is None:
        return None
    finer, report = laid
    factor = 1.0
    if options.tolerance < report.violation < _LONGEST:
        factor += _MORE * report.violation
    worst = np.inf
    for number in itertools.count(1):
        own = SolvedProgram(
            finer, (report,), violation=report.violation, time_scaled=factor
        )
        done = verify(candidate, reports, own)
        found = done.verification
        if done.is_settled or found is None:
            return done
        failed = [check for check in found.checks if not check.passed]
        ratio = found.worst_ratio
        if not all(check.of_limit for check in failed) or ratio > worst:
            return done
        worst = 1.0 + _LESS * (ratio - 1.0)
        # Torques that gravity adds to fall more slowly.
        more = number * _MORE * max(ratio - 1.0, options.tolerance)
        factor *= 1.0 + more
        if factor > 1.0 + _LONGEST:
            break
    return done
