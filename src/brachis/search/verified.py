"""From a solved program to a verified motion."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from brachis.common.words import write_count
from brachis.errors import UnreachableError
from brachis.optimise.backends import SolverReport
from brachis.optimise.extraction import extract_motion
from brachis.optimise.improve import Solve, SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, refine
from brachis.search.stages import (
    Candidate,
    FinishedCandidate,
    RankedCandidate,
    facts_of,
    name_coordinates,
)
from brachis.trajectory import Trajectory
from brachis.verify import Verification, verify_trajectory

_DENSER = 4
"""Factor on the density of the grid for a second refinement. A factor of 2 is enough for the measured peaks, which are
close to a singular posture of the UR10 on its rail. The factor 4 leaves a reserve, and only motions that would fail are
refined again."""


def refine_and_verify(
    candidate: RankedCandidate | FinishedCandidate,
    program: Program,
    reports: tuple[SolverReport, ...],
    solve: Solve,
    options: RefinementOptions,
) -> Candidate:
    """Refine and verify a motion; if the time is up, only verify it.

    Close to a singularity, a peak may be narrower than the spacing of the refinement's grid. If only the verification
    detects such a peak, the motion is refined once more, on a denser grid.

    Parameters
    ----------
    candidate : RankedCandidate or FinishedCandidate
        Candidate from which the program was made.
    program : Program
    reports : tuple of SolverReport
        Reports of all solves so far; the last report is that of the program.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    Candidate
        See `verify`.
    """
    refined = refine(program, reports[-1], solve, options)
    outcome = verify(candidate, reports[:-1], refined)
    if outcome.is_settled or refined.violation > options.tolerance:
        return outcome
    denser = replace(options, density=_DENSER * options.density)
    again = refine(refined.program, refined.report, solve, denser)
    before = (*reports[:-1], *refined.reports[:-1])
    return verify(candidate, before, again)


def verify(
    candidate: RankedCandidate | FinishedCandidate,
    before: tuple[SolverReport, ...],
    refined: SolvedProgram,
    motion: Trajectory | None = None,
) -> Candidate:
    """Extract the trajectory of a refined program, unless it is given, and verify it.

    Parameters
    ----------
    candidate : RankedCandidate or FinishedCandidate
    before : tuple of SolverReport
        Reports of earlier solves.
    refined : SolvedProgram
    motion : Trajectory, optional

    Returns
    -------
    Candidate
        A `FinishedCandidate` if a trajectory was found.
    """
    problem = candidate.problem
    verification = None
    if refined.converged and np.isfinite(refined.violation):
        with contextlib.suppress(UnreachableError):
            trajectory = motion or extract_motion(problem, refined.program, refined.x)
            verification = verify_trajectory(trajectory, own_limits=problem.own_limits)
    maps = [phase.joint_map for phase in refined.program.phases]
    tolerance = problem.task.refinement.tolerance
    known = facts_of(candidate) | {
        **name_coordinates(maps),
        "status": _in_words(refined, verification, tolerance),
        "reports": (*before, *refined.reports),
    }
    if verification is None:
        return Candidate(**known)
    return FinishedCandidate(
        **known,
        problem=problem,
        family=candidate.family,
        refined=refined,
        optimum=refined,
        trajectory=trajectory,
        verification=verification,
        not_completed=candidate.not_completed,
    )


def _in_words(
    refined: SolvedProgram, verification: Verification | None, tolerance: float
) -> str:
    """Describe the outcome of a refined program, whose limits may be exceeded by a fraction `tolerance`."""
    last = refined.report
    if verification is not None and verification.passed:
        return "verified"
    if not refined.converged:
        return f"{last.solver}: {last.status.value}"
    if not np.isfinite(refined.violation):
        return f"{last.solver}: the motion leaves the branch, or the chart, between collocation points"
    if refined.violation > tolerance:
        reason = f"limits exceeded by {100.0 * refined.violation:.2g} %"
    elif verification is None:
        reason = "the motion is too sharp for a trajectory"
    else:
        reason = "the verification fails"
    rounds = write_count(len(refined.reports) - 1, "refinement round")
    return f"{last.solver}: t_E = {refined.t_end:.4f} s after {rounds}, {reason}"
