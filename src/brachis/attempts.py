"""Trying initial guesses and solvers until one gives a motion within the limits everywhere."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from brachis.errors import BrachisError, PathError, PlanningError, UnreachableError
from brachis.feasibility import explain_failure
from brachis.mesh import coarsest, settle_knots
from brachis.nlp import Transcription
from brachis.nlp.constraints.branch_margin import MARGIN
from brachis.nlp.guess import guesses
from brachis.refine import Refined, RefinementOptions, Solve, refine
from brachis.result import Attempt
from brachis.solvers import Solver, SolverOptions, SolverReport, SolveStatus, solver_named
from brachis.task import SolverSettings, Task
from brachis.trajectory import Trajectory
from brachis.verify import Verification

Motion = tuple[Trajectory, Verification]
Judge = Callable[[Refined], Motion]
Listener = Callable[[str], None]
"""Told in plain words what the planner is doing, between iterations; may raise KeyboardInterrupt."""

MARGINS = (0.1, 0.02, MARGIN)
"""Branch margins that are tried in turn; see `continued`."""
_HELD_BACK = 1e-4
"""A margin that is nearer to its bound than this holds the motion back."""
_MANY_VARIABLES = 150
"""Above this a cold solve takes seconds, and the problem is first solved over some of its knots."""
_ON_ITS_WAY = 1e-3
_PATIENCE = 100
"""Iterations for each redundant joint that ``auto`` grants a solver on one guess, unless the task says otherwise."""
_WORTH_IT = 2e-4
"""A smaller branch margin that shortens the motion by less than this fraction is not worth its sharper turns."""
_SECOND_LOOKS = 4
_FAILURES = 2
_GOOD_PART = 0.1
_BESIDE = 1e-4
_KNOT_TIME = 0.4
"""Part of the remaining time that may go into the knots."""
_LEAST_TIME = 0.1
"""Seconds left to a solve that is begun."""


def search(
    problem: Transcription, task: Task, judge: Judge, listener: Listener
) -> tuple[tuple[Attempt, ...], int, Motion]:
    """Try guesses and solvers until one gives a motion that passes the verification.

    Parameters
    ----------
    problem : Transcription
    task : Task
    judge : callable
        Makes the trajectory of an answer and verifies it.
    listener : callable

    Returns
    -------
    attempts : tuple of Attempt
    chosen : int
        Index of the attempt that gave the motion: a verified one, or the one that came nearest to the limits.
    motion : tuple of Trajectory, Verification

    Raises
    ------
    PathError
        The path is out of reach, or too heavy to hold.
    PlanningError
        No attempt gave a motion.
    """
    settings = task.refinement
    options = RefinementOptions(settings.tolerance, settings.density, settings.max_rounds)
    deadline = time.perf_counter() + task.solver.time_limit
    attempts: list[Attempt] = []
    best: tuple[float, int, Motion] | None = None
    start = coarsest(problem) if problem.variables > _MANY_VARIABLES else problem
    for x, number, solver in _ways(start, task):
        solve = _solve_with(solver, task, problem.decomposition.r, deadline, listener)
        try:
            continued_problem, reports = continued(start, x, solve, MARGINS)
        except ImportError as error:
            attempts.append(
                Attempt(solver.name, number, (), 0, np.inf, 1.0, 0, f"{solver.name}: not installed ({error})")
            )
            continue
        budget = _KNOT_TIME * (deadline - time.perf_counter())
        continued_problem, reports = settle_knots(
            continued_problem, reports, solve, task.spline, options, target=problem, time_limit=budget
        )
        refined, motion = _refined_until_verified(continued_problem, reports[-1], solve, options, judge)
        attempts.append(_attempt(refined, reports[:-1], number, settings.tolerance, motion))
        listener(attempts[-1].outcome)
        if motion is not None and (best is None or _excess(motion) < best[0]):
            best = _excess(motion), len(attempts) - 1, motion
            if motion[1].passed or settings.max_rounds == 0:
                break
        if time.perf_counter() > deadline:
            break
        if best is None and len(attempts) == _FAILURES:
            _refuse_what_is_out_of_reach(problem)
    if best is not None:
        return tuple(attempts), *best[1:]
    reason = explain_failure(problem.decomposition)
    if isinstance(reason, BrachisError):
        raise reason
    outcomes = _summary(attempts) or "no reachable initial guess"
    raise PlanningError(f"no motion within the limits was found: {outcomes}", hint=reason)


def _refuse_what_is_out_of_reach(problem: Transcription) -> None:
    """Raise the reason where a good part of the path cannot be reached: further attempts would be in vain."""
    reason = explain_failure(problem.decomposition)
    if isinstance(reason, PathError) and reason.s_interval is not None and np.ptp(reason.s_interval) > _GOOD_PART:
        raise reason


def _refined_until_verified(
    problem: Transcription, report: SolverReport, solve: Solve, options: RefinementOptions, judge: Judge
) -> tuple[Refined, Motion | None]:
    """Refine a solved problem, and again where the verification finds a limit exceeded between the points."""
    refined = refine(problem, report, solve, options)
    motion = _judged(judge, refined)
    for _ in range(_SECOND_LOOKS if options.max_rounds else 0):
        finer = None if motion is None else _where_it_failed(refined, motion)
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
    if not (refined.converged and np.isfinite(refined.excess)):
        return None
    try:
        return judge(refined)
    except UnreachableError:
        return None


def _where_it_failed(refined: Refined, motion: Motion) -> Transcription | None:
    """Add collocation points where the verification found a limit exceeded; None where it found no such place."""
    trajectory, verification = motion
    failed = [check for check in verification.checks if not check.passed]
    if not failed or any(not check.name.endswith("ratio") or check.time is None for check in failed):
        return None
    tau = np.array([check.time for check in failed]) / trajectory.t_end
    near = tau[:, None] + _BESIDE * np.array([-1.0, 0.0, 1.0])
    return refined.problem.resampled(np.union1d(refined.problem.tau, np.clip(near.ravel(), 0.0, 1.0)))


def _excess(motion: Motion) -> float:
    """Return how far a motion exceeds its limits, as a fraction of them; less than any excess where it passed."""
    return -np.inf if motion[1].passed else motion[1].worst_ratio - 1.0


def continued(
    problem: Transcription, x: np.ndarray, solve: Solve, margins: Sequence[float]
) -> tuple[Transcription, tuple[SolverReport, ...]]:
    """Solve with ever smaller branch margins, each from the last answer.

    Near a branch boundary the problem is badly conditioned, and a solver that meets the boundary early creeps along it.
    Far from it the solve is easy, and its answer is a good start for a smaller margin. A margin that does not hold the
    motion back, or that hardly shortens it, ends the continuation.

    Parameters
    ----------
    problem : Transcription
    x : (v,) ndarray
        Starting point.
    solve : callable
    margins : sequence of float
        Least branch margins, descending.

    Returns
    -------
    problem : Transcription
        With the last margin for which the solve ended well; with the last one tried if none did.
    reports : tuple of SolverReport
        Of all solves; the last one belongs to `problem`.
    """
    solved: list[tuple[Transcription, SolverReport]] = []
    failed: list[tuple[Transcription, SolverReport]] = []
    bounds: set[tuple[float, ...]] = set()
    for margin in margins:
        tried = problem.with_margin(margin)
        if tried.guards in bounds:  # the closed form has no margins, or the start posture caps them
            continue
        bounds.add(tried.guards)
        outcome = tried, solve(tried, x)
        if outcome[1].status.usable:
            if solved and outcome[1].objective > (1.0 - _WORTH_IT) * solved[-1][1].objective:
                failed.append(outcome)
                break
            solved.append(outcome)
            x = outcome[1].x
            if tried.guard_slack(x) > _HELD_BACK:
                break
        else:
            failed.append(outcome)
            if solved or outcome[1].status is SolveStatus.TIME_LIMIT:
                break
            if outcome[1].violation <= _ON_ITS_WAY:  # it ran out of iterations on its way
                x = outcome[1].x
    order = [*failed, *solved]
    return order[-1][0], tuple(report for _, report in order)


def _ways(problem: Transcription, task: Task) -> Iterator[tuple[np.ndarray, int, Solver]]:
    """Yield guesses and solvers in the order of trying: every guess with the first two solvers, then the rest."""
    backends = solver_named(task.solver.name)
    known: list[np.ndarray] = []
    for number, x in enumerate(guesses(problem)):
        known.append(x)
        for solver in backends[:2]:
            yield x, number, solver
    for solver in backends[2:]:
        for number, x in enumerate(known[:2]):
            yield x, number, solver


def _solve_with(solver: Solver, task: Task, redundancy: int, deadline: float, listener: Listener) -> Solve:
    """Make a function that runs one backend under the task's bounds."""
    settings = task.solver
    patience = settings.max_iterations
    if settings.name == "auto" and patience == SolverSettings.model_fields["max_iterations"].default:
        patience = _PATIENCE * max(redundancy, 1)

    def progress(iteration: int, objective: float) -> None:
        listener(f"{solver.name}: iteration {iteration}, t_E = {objective:.4f} s")

    def solve(problem: Transcription, x: np.ndarray) -> SolverReport:
        remaining = max(deadline - time.perf_counter(), _LEAST_TIME)
        return solver.solve(problem, x, SolverOptions(settings.tolerance, patience, remaining), progress)

    return solve


def _attempt(
    refined: Refined, before: Sequence[SolverReport], number: int, tolerance: float, motion: Motion | None
) -> Attempt:
    """Put the outcome of an attempt into words."""
    last = refined.reports[-1]
    rounds = len(refined.reports) - 1
    if not refined.converged:
        outcome = f"{last.solver}: {last.status.value}"
    elif not np.isfinite(refined.excess):
        outcome = f"{last.solver}: the motion leaves the branch between collocation points"
    else:
        if refined.excess > tolerance:
            found = f"limits exceeded by {100.0 * refined.excess:.2g} %"
        elif motion is None:
            found = "too sharp for a trajectory"
        else:
            found = "verified" if motion[1].passed else "the verification fails"
        outcome = f"{last.solver}: t_E = {refined.x[0]:.4f} s after {rounds} refinement rounds, {found}"
    reports = (*before, *refined.reports)
    points = len(refined.problem.tau)
    return Attempt(last.solver, number, reports, rounds, refined.excess, refined.stretched, points, outcome, refined)


def _summary(attempts: Sequence[Attempt]) -> str:
    """List the outcomes, equal ones once with their number."""
    counts = Counter(attempt.outcome for attempt in attempts)
    return "; ".join(outcome if n == 1 else f"{outcome} ({n} times)" for outcome, n in counts.items())
