"""What the phase plane does with a guess and with a candidate: it times them, begins them, and times them again."""

from __future__ import annotations

import dataclasses

import numpy as np

from brachis.optimise import retiming
from brachis.optimise.backends import solvers_for
from brachis.optimise.candidate import (
    Candidate,
    InitialGuess,
    refine_and_verify,
    verify,
)
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.problem.problem import Problem

_LARGE = 2500
"""Rows above which a motion is retimed, and not refined: with so many, solves with more points take a minute."""


def is_large(program: Program) -> bool:
    """Tell whether a program is too large to be refined."""
    return len(program.lower) > _LARGE


def solvers_of(problem: Problem) -> list[str]:
    """Names of the solvers for a problem, the one that is tried first at the front."""
    curved = any(limit.guarantee.is_mean for limit in problem.limits)
    found = solvers_for(problem.task.solver.name, curved=curved)
    return [solver.name for solver in found]


def time_alone(start: InitialGuess, program: Program) -> SolvedProgram | None:
    """Time a joint path where nothing else is to be decided, over the knots that this needs."""
    spline = start.problem.task.spline
    if start.joint_map.r or spline.intervals != "auto" or spline.knots == "free":
        return None
    if start.solver != solvers_of(start.problem)[0]:  # as a fallback others solve
        return None
    return retiming.time_guess(
        program,
        start.legs,
        start.problem.leg_rates,
        spline.tolerance,
        spline.points_per_interval,
    )


def begin_with_timing(
    start: InitialGuess, program: Program
) -> tuple[Program, np.ndarray] | None:
    """Lay first splines along the fastest timing of a joint path, where the task leaves the knots open."""
    problem = start.problem
    spline = problem.task.spline
    is_open = spline.intervals == "auto" and spline.knots != "free"
    if not is_open or problem.task.boundary.periodic or any(problem.time_laws):
        return None
    return retiming.begin_with_timing(
        program, start.legs, problem.leg_rates, spline.points_per_interval
    )


def retime(
    candidate: Candidate, solved: SolvedProgram, options: RefinementOptions
) -> Candidate | None:
    """Give a motion the fastest timing of its joint path; None if it is as fast and easily refined, or not verified."""
    assert candidate.start is not None
    spline = candidate.start.problem.task.spline
    if not solved.usable:
        return None
    worth = spline.tolerance
    if is_large(solved.program):
        worth = -np.inf
    retimed = retiming.retime(
        solved, spline.tolerance, spline.points_per_interval, worth
    )
    if retimed is None:
        return None
    named = dataclasses.replace(candidate, optimum=solved)
    done = verify_timed(named, retimed, options)
    return done if done.verified else None


def verify_timed(
    candidate: Candidate, timed: SolvedProgram, options: RefinementOptions
) -> Candidate:
    """Verify a timing as it is; where that fails, lengthen it until the limits hold between the places looked at."""
    reports = timed.reports
    alone = SolvedProgram(timed.program, reports[-1:], violation=timed.report.violation)
    done = verify(candidate, reports[:-1], alone)
    if done.verified:
        return done
    return refine_and_verify(candidate, timed.program, reports, retiming.keep, options)
