"""Trying initial guesses and solvers until one gives a motion within the limits everywhere."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from brachis.errors import BrachisError, PlanningError
from brachis.feasibility import explain_failure
from brachis.nlp import Transcription
from brachis.nlp.constraints.branch_margin import MARGIN
from brachis.nlp.guess import guesses
from brachis.refine import Refined, RefinementOptions, Solve, refine
from brachis.result import Attempt
from brachis.solvers import Solver, SolverOptions, SolverReport, solver_named
from brachis.task import SolverSettings, Task

Listener = Callable[[str], None]
"""Told in plain words what the planner is doing, between iterations; may raise KeyboardInterrupt."""

MARGINS = (0.1, 0.02, MARGIN)
"""Branch margins that are tried in turn; see `continued`."""
_HELD_BACK = 1e-4
"""A margin that is nearer to its bound than this holds the motion back."""
_MANY_VARIABLES = 150
"""Above this an active-set method spends its time in linear algebra, and ``auto`` begins with the interior point."""
_FEASIBLE = 1e-6
_PATIENCE = 100
"""Iterations that ``auto`` grants a solver on one guess, unless the task says otherwise: one that needs more grinds."""
_LEAST_TIME = 0.1
"""Seconds left to a solve that is begun."""


def search(problem: Transcription, task: Task, listener: Listener) -> tuple[tuple[Attempt, ...], int, Refined]:
    """Try guesses and solvers until one gives a motion within the limits everywhere.

    Parameters
    ----------
    problem : Transcription
    task : Task
    listener : callable

    Returns
    -------
    attempts : tuple of Attempt
    chosen : int
        Index of the attempt that gave the motion: one within the limits, or the one that came nearest to them.
    refined : Refined

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
    best: tuple[int, Refined] | None = None
    for x, number, solver in _ways(problem, task):
        solve = _solve_with(solver, task, deadline, listener)
        try:
            continued_problem, reports = continued(problem, x, solve, MARGINS)
        except ImportError as error:
            attempts.append(
                Attempt(solver.name, number, (), 0, np.inf, 1.0, 0, f"{solver.name}: not installed ({error})")
            )
            continue
        refined = refine(continued_problem, reports[-1], solve, options)
        attempts.append(_attempt(refined, reports[:-1], number, settings.tolerance))
        listener(attempts[-1].outcome)
        if refined.converged and (best is None or refined.excess < best[1].excess):
            best = len(attempts) - 1, refined
        content = refined.excess <= settings.tolerance or settings.max_rounds == 0
        if (refined.converged and content) or time.perf_counter() > deadline:
            break
    if best is not None and np.isfinite(best[1].excess):
        return tuple(attempts), *best
    reason = explain_failure(problem.decomposition)
    if isinstance(reason, BrachisError):
        raise reason
    outcomes = _summary(attempts) or "no reachable initial guess"
    raise PlanningError(f"no motion within the limits was found: {outcomes}", hint=reason)


def continued(
    problem: Transcription, x: np.ndarray, solve: Solve, margins: Sequence[float]
) -> tuple[Transcription, tuple[SolverReport, ...]]:
    """Solve with ever smaller branch margins, each from the last answer.

    Near a branch boundary the problem is badly conditioned, and a solver that meets the boundary early creeps along it.
    Far from it the solve is easy, and its answer is a good start for a smaller margin. A margin that does not hold the
    motion back ends the continuation.

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
            solved.append(outcome)
            x = outcome[1].x
            if tried.guard_slack(x) > _HELD_BACK:
                break
        else:
            failed.append(outcome)
            if solved:
                break
            if outcome[1].violation <= _FEASIBLE:  # it ran out of iterations on its way
                x = outcome[1].x
    order = [*failed, *solved]
    return order[-1][0], tuple(report for _, report in order)


def _ways(problem: Transcription, task: Task) -> Iterator[tuple[np.ndarray, int, Solver]]:
    """Yield guesses and solvers in the order of trying: every guess with the first two solvers, then the rest."""
    backends = solver_named(task.solver.name)
    if task.solver.name == "auto" and problem.variables > _MANY_VARIABLES:
        backends = (backends[1], backends[0], *backends[2:])
    known: list[np.ndarray] = []
    for number, x in enumerate(guesses(problem)):
        known.append(x)
        for solver in backends[:2]:
            yield x, number, solver
    for solver in backends[2:]:
        for number, x in enumerate(known[:2]):
            yield x, number, solver


def _solve_with(solver: Solver, task: Task, deadline: float, listener: Listener) -> Solve:
    """Make a function that runs one backend under the task's bounds."""
    settings = task.solver
    patience = settings.max_iterations
    if settings.name == "auto" and patience == SolverSettings.model_fields["max_iterations"].default:
        patience = _PATIENCE

    def progress(iteration: int, objective: float) -> None:
        listener(f"{solver.name}: iteration {iteration}, t_E = {objective:.4f} s")

    def solve(problem: Transcription, x: np.ndarray) -> SolverReport:
        remaining = max(deadline - time.perf_counter(), _LEAST_TIME)
        return solver.solve(problem, x, SolverOptions(settings.tolerance, patience, remaining), progress)

    return solve


def _attempt(refined: Refined, before: Sequence[SolverReport], number: int, tolerance: float) -> Attempt:
    """Put the outcome of an attempt into words."""
    last = refined.reports[-1]
    rounds = len(refined.reports) - 1
    if not refined.converged:
        outcome = f"{last.solver}: {last.status.value}"
    elif not np.isfinite(refined.excess):
        outcome = f"{last.solver}: the motion leaves the branch between collocation points"
    else:
        inside = "limits hold" if refined.excess <= tolerance else f"limits exceeded by {100.0 * refined.excess:.2g} %"
        outcome = f"{last.solver}: t_E = {refined.x[0]:.4f} s after {rounds} refinement rounds, {inside}"
    reports = (*before, *refined.reports)
    points = len(refined.problem.tau)
    return Attempt(last.solver, number, reports, rounds, refined.excess, refined.stretched, points, outcome)


def _summary(attempts: Sequence[Attempt]) -> str:
    """List the outcomes, equal ones once with their number."""
    counts = Counter(attempt.outcome for attempt in attempts)
    return "; ".join(outcome if n == 1 else f"{outcome} ({n} times)" for outcome, n in counts.items())
