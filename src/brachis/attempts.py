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
from brachis.task import Task

Listener = Callable[[str], None]
"""Told in plain words what the planner is doing, between iterations; may raise KeyboardInterrupt."""

MARGINS = (0.1, 0.02, MARGIN)
"""Branch margins that are tried in turn; see `continued`."""
_HELD_BACK = 1.01
_MANY_VARIABLES = 150
"""Above this an active-set method spends its time in linear algebra, and ``auto`` begins with the interior point."""
_PATIENCE = 100
"""Iterations that ``auto`` grants a solver on one guess: an active-set method that needs more is grinding."""


def search(problem: Transcription, task: Task, listener: Listener) -> tuple[tuple[Attempt, ...], Refined]:
    """Try guesses and solvers until one gives a motion within the limits everywhere.

    Parameters
    ----------
    problem : Transcription
    task : Task
    listener : callable

    Returns
    -------
    attempts : tuple of Attempt
    refined : Refined
        Of the last attempt, or of the one that came nearest to the limits.

    Raises
    ------
    PathError
        The path is out of reach, or too heavy to hold.
    PlanningError
        No attempt gave a motion.
    """
    settings = task.refinement
    options = RefinementOptions(settings.tolerance, settings.density, settings.max_rounds)
    began = time.perf_counter()
    attempts: list[Attempt] = []
    best: Refined | None = None
    for x, number, solver in _ways(problem, task):
        solve = _solve_with(solver, task, listener)
        refined = refine(*continued(problem, x, solve, MARGINS), solve, options)
        attempts.append(_attempt(refined, number, settings.tolerance))
        listener(attempts[-1].outcome)
        if refined.converged and refined.excess <= settings.tolerance:
            return tuple(attempts), refined
        if refined.converged and (best is None or refined.excess < best.excess):
            best = refined
        if time.perf_counter() - began > task.solver.time_limit:
            break
    if best is not None and np.isfinite(best.excess):
        return tuple(attempts), best
    reason = explain_failure(problem.decomposition)
    if isinstance(reason, BrachisError):
        raise reason
    outcomes = _summary(attempts) or "no reachable initial guess"
    raise PlanningError(f"no motion within the limits was found: {outcomes}", hint=reason)


def continued(
    problem: Transcription, x: np.ndarray, solve: Solve, margins: Sequence[float]
) -> tuple[Transcription, SolverReport]:
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
    report : SolverReport
    """
    best: tuple[Transcription, SolverReport] | None = None
    last: tuple[Transcription, SolverReport] | None = None
    for margin in margins:
        tried = problem.with_margin(margin)
        last = tried, solve(tried, x)
        if last[1].status.usable:
            best, x = last, last[1].x
            if tried.least_margin(x) > _HELD_BACK * margin:
                break
        elif best is not None:
            break
    return best or last  # type: ignore[return-value]


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


def _solve_with(solver: Solver, task: Task, listener: Listener) -> Solve:
    """Make a function that runs one backend under the task's bounds."""
    settings = task.solver
    patience = min(settings.max_iterations, _PATIENCE) if settings.name == "auto" else settings.max_iterations
    options = SolverOptions(settings.tolerance, patience, settings.time_limit)

    def progress(iteration: int, objective: float) -> None:
        listener(f"{solver.name}: iteration {iteration}, t_E = {objective:.4f} s")

    return lambda problem, x: solver.solve(problem, x, options, progress)


def _attempt(refined: Refined, number: int, tolerance: float) -> Attempt:
    """Put the outcome of an attempt into words."""
    last = refined.reports[-1]
    rounds = len(refined.reports) - 1
    if not refined.converged:
        outcome = f"{last.solver}: {last.status.value}"
    else:
        inside = "limits hold" if refined.excess <= tolerance else f"limits exceeded by {100.0 * refined.excess:.2g} %"
        outcome = f"{last.solver}: t_E = {refined.x[0]:.4f} s after {rounds} refinement rounds, {inside}"
    return Attempt(
        last.solver, number, refined.reports, refined.excess, refined.stretched, len(refined.problem.tau), outcome
    )


def _summary(attempts: Sequence[Attempt]) -> str:
    """List the outcomes, equal ones once with their number."""
    counts = Counter(attempt.outcome for attempt in attempts)
    return "; ".join(outcome if n == 1 else f"{outcome} ({n} times)" for outcome, n in counts.items())
