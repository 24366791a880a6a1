"""What the phase plane does with a guess and with a candidate: it times them, begins them, and times them again."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from brachis.optimise import retiming
from brachis.optimise.backends import solvers_for
from brachis.optimise.candidate import Candidate, InitialGuess, verify
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.problem.problem import Problem

_MORE = 1.2
"""Times the violation by which a timing takes longer."""
_LONGEST = 0.1
"""Part of the time by which it may."""


def solvers_of(problem: Problem) -> list[str]:
    """Names of the solvers for a problem, the one that is tried first at the front."""
    curved = any(limit.guarantee.is_mean for limit in problem.limits)
    found = solvers_for(problem.task.solver.name, curved=curved)
    return [solver.name for solver in found]


def time_alone(start: InitialGuess, program: Program) -> SolvedProgram | None:
    """Time a joint path where nothing else is to be decided, over the knots that this needs."""
    spline = start.problem.task.spline
    if start.joint_map.r or spline.intervals != "auto":
        return None
    if start.solver != solvers_of(start.problem)[0]:  # as a fallback others solve
        return None
    points = spline.points_per_interval
    return retiming.time_guess(program, start.legs, spline.tolerance, points)


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


def is_timed(start: InitialGuess, program: Program) -> bool:
    """Tell whether motions get the timing of the phase plane: where it knows all limits, and the knots are open."""
    is_open = start.problem.task.spline.intervals == "auto"
    return is_open and retiming.is_timing_all(program)


def plan_timing(
    candidate: Candidate,
    solved: SolvedProgram,
    timings: Sequence[PhaseTiming | None],
    options: RefinementOptions,
) -> Candidate:
    """Give joint paths, one for each phase, their fastest timing, and verify it."""
    assert candidate.start is not None
    spline = candidate.start.problem.task.spline
    retimed = retiming.retime(
        solved, timings, spline.tolerance, spline.points_per_interval
    )
    return verify_timed(candidate, retimed, options)


def verify_timed(
    candidate: Candidate, timed: SolvedProgram, options: RefinementOptions
) -> Candidate:
    """Verify a timing; where a limit is exceeded by a little between the places looked at, it takes a little longer."""
    reports = timed.reports
    factor = 1.0
    for number in itertools.count(1):
        own = SolvedProgram(
            timed.program,
            reports[-1:],
            violation=timed.report.violation,
            time_scaled=factor,
        )
        done = verify(candidate, reports[:-1], own)
        found = done.verification
        if done.verified or found is None:
            return done
        failed = [check for check in found.checks if not check.passed]
        if not all(check.of_limit for check in failed):
            return done
        # Torques that gravity adds to fall more slowly.
        more = number * _MORE * max(found.worst_ratio - 1.0, options.tolerance)
        factor *= 1.0 + more
        if factor > 1.0 + _LONGEST:
            break
    return done
