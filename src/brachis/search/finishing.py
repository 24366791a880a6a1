"""Refining a plan until it passes the verification."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from brachis.errors import UnreachableError
from brachis.nlp import Program
from brachis.refine import Refined, RefinementOptions, Solve, refine
from brachis.result import Attempt
from brachis.solvers import SolverReport
from brachis.trajectory import Trajectory
from brachis.verify import Verification

Motion = tuple[Trajectory, Verification]
Judge = Callable[[Refined], Motion]
_SECOND_LOOKS = 4
_BESIDE = 1e-4


def refined_until_verified(
    program: Program, report: SolverReport, solve: Solve, options: RefinementOptions, judge: Judge
) -> tuple[Refined, Motion | None]:
    """Refine a solved program, and again where the verification finds a limit exceeded between the points.

    Parameters
    ----------
    program : Program
    report : SolverReport
        Of the program's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : RefinementOptions
    judge : callable
        Makes the trajectory of an answer and verifies it; raises `UnreachableError` where it leaves the branch.

    Returns
    -------
    refined : Refined
    motion : tuple of Trajectory, Verification, or None
        None where no trajectory came out.
    """
    refined = refine(program, report, solve, options)
    motion = _judged(judge, refined)
    for _ in range(_SECOND_LOOKS if options.max_rounds else 0):
        finer = None if motion is None or options.deadline.passed else _where_it_failed(refined, motion)
        if finer is None:
            break
        report = solve(finer, refined.x)
        if not report.status.usable:
            break
        refined = refine(finer, report, solve, options)
        motion = _judged(judge, refined)
    return refined, motion


def _judged(judge: Judge, refined: Refined) -> Motion | None:
    """Return the motion and its verification; None without an answer, or where it leaves the branch in between."""
    if not (refined.converged and np.isfinite(refined.violation)):
        return None
    try:
        return judge(refined)
    except UnreachableError:
        return None


def _where_it_failed(refined: Refined, motion: Motion) -> Program | None:
    """Add collocation points where the verification found a limit exceeded; None where it found no such place."""
    trajectory, verification = motion
    failed = [check for check in verification.checks if not check.passed]
    if not failed or any(not check.name.endswith("ratio") or check.time is None for check in failed):
        return None
    t_norm = np.array([check.time for check in failed]) / trajectory.t_end
    near = t_norm[:, None] + _BESIDE * np.array([-1.0, 0.0, 1.0])
    (phase,) = refined.program.phases
    return refined.program.resampled([np.union1d(phase.t_norm, np.clip(near.ravel(), 0.0, 1.0))])


def attempt_of(
    refined: Refined,
    before: Sequence[SolverReport],
    number: int,
    tolerance: float,
    motion: Motion | None,
    undone: str,
) -> Attempt:
    """Put down what became of a plan, in words too.

    Parameters
    ----------
    refined : Refined
    before : sequence of SolverReport
        Of the solves before refinement.
    number : int
        Of the candidate.
    tolerance : float
        Largest violation of a limit, as a fraction of it.
    motion : tuple of Trajectory, Verification, or None
    undone : str
        What was left undone, in words; empty where nothing.

    Returns
    -------
    Attempt
    """
    last = refined.reports[-1]
    rounds = len(refined.reports) - 1
    if not refined.converged:
        outcome = f"{last.solver}: {last.status.value}"
    elif not np.isfinite(refined.violation):
        outcome = f"{last.solver}: the motion leaves the branch between collocation points"
    else:
        if refined.violation > tolerance:
            found = f"limits exceeded by {100.0 * refined.violation:.2g} %"
        elif motion is None:
            found = "too sharp for a trajectory"
        else:
            found = "verified" if motion[1].passed else "the verification fails"
        outcome = f"{last.solver}: t_E = {refined.t_end:.4f} s after {rounds} refinement rounds, {found}"
    reports = (*before, *refined.reports)
    return Attempt(
        solver=last.solver,
        guess=number,
        reports=reports,
        refinement_rounds=rounds,
        violation=refined.violation,
        time_scaled=refined.time_scaled,
        collocation_points=refined.program.collocation_points,
        outcome=outcome,
        refined=refined,
        undone=undone,
    )
