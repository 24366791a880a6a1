"""Solving one NLP from one starting point, with ever smaller branch margins."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np

from brachis.deadline import Deadline
from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, JointMap
from brachis.limits.branch_margin import MARGIN
from brachis.nlp import Program
from brachis.nlp.guess import shortest_time
from brachis.progress import Iteration, Listener
from brachis.refine import Solve
from brachis.solvers import Solver, SolverOptions, SolverReport, SolveStatus
from brachis.task import SolverSettings

MARGINS = (0.1, 0.02, MARGIN)
"""Branch margins that are tried in turn; see `continued`."""
HELD_BACK = 1e-4
"""A margin that is nearer to its bound than this holds the motion back."""
_EASY = 2
"""Order of the limits with which solves from afar are easy; see `eased`."""
_ON_ITS_WAY = 1e-3
_STAGNATION = 1e-5, 10
"""Progress and patience in charts; see `SolverOptions`."""
_ITERATIONS = 100
"""Iterations for each redundant joint that ``auto`` grants a solver on one guess, unless the task says otherwise."""
WORTH_IT = 2e-4
"""A smaller branch margin that shortens the motion by less than this fraction is not worth its sharper turns."""


def continued(
    program: Program, x: np.ndarray, solve: Solve, margins: Sequence[float]
) -> tuple[Program, tuple[SolverReport, ...]]:
    """Solve with ever smaller branch margins, each from the last answer.

    Near a branch boundary the problem is badly conditioned, and a solver that meets the boundary early creeps along it.
    Far from it the solve is easy, and its answer is a good start for a smaller margin. A margin that does not hold the
    motion back, or that hardly shortens it, ends the continuation.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
        Starting point.
    solve : callable
    margins : sequence of float
        Least branch margins, descending.

    Returns
    -------
    program : Program
        With the last margin for which the solve ended well; with the last one tried if none did.
    reports : tuple of SolverReport
        Of all solves; the last one belongs to `program`.
    """
    solved: list[tuple[Program, SolverReport]] = []
    failed: list[tuple[Program, SolverReport]] = []
    bounds: set[tuple[float, ...]] = set()
    for margin in margins:
        tried = program.with_margin(margin)
        if tried.safeguard_bounds in bounds:  # the closed form has no margins, or the start posture caps them
            continue
        bounds.add(tried.safeguard_bounds)
        outcome = tried, solve(tried, x)
        if outcome[1].status.usable:
            if solved and outcome[1].objective > (1.0 - WORTH_IT) * solved[-1][1].objective:
                failed.append(outcome)
                break
            solved.append(outcome)
            x = outcome[1].x
            if tried.safeguard_slack(x) > HELD_BACK:
                break
        else:
            failed.append(outcome)
            if solved or outcome[1].status is SolveStatus.TIME_LIMIT:
                break
            if outcome[1].violation <= _ON_ITS_WAY:  # it ran out of iterations on its way
                x = outcome[1].x
    order = [*failed, *solved]
    return order[-1][0], tuple(report for _, report in order)


def eased(program: Program, x: np.ndarray, solve: Solve, margin: float) -> tuple[np.ndarray, tuple[SolverReport, ...]]:
    """Find a better starting point where limits ask for the third derivative: the answer without them, time-scaled.

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
        The given point where there are no such limits, or where that solve failed.
    reports : tuple of SolverReport
        Of the solve without them.
    """
    easier = program.up_to(_EASY)
    if len(easier.limits) == len(program.limits):
        return x, ()
    report = solve(easier.with_margin(margin), x)
    if report.status.usable:
        with contextlib.suppress(UnreachableError):
            x = shortest_time(program, report.x)
    return x, (report,)


def solve_with(
    solver: Solver, settings: SolverSettings, joint_map: JointMap, deadline: Deadline, listener: Listener
) -> Solve:
    """Make a function that runs one backend under the task's bounds.

    Parameters
    ----------
    solver : Solver
    settings : SolverSettings
    joint_map : JointMap
        Of what is solved. In a chart, where wandering among equally fast motions is common and no branch boundary slows
        a solve down on its way, fewer iterates without gain are waited for.
    deadline : Deadline
    listener : callable

    Returns
    -------
    callable
    """
    most = settings.max_iterations
    if settings.name == "auto" and most == SolverSettings.model_fields["max_iterations"].default:
        most = _ITERATIONS * max(joint_map.r, 1)
    stagnation = _STAGNATION if isinstance(joint_map, ChartMap) else ()

    def progress(iteration: int, objective: float) -> None:
        listener(Iteration(f"{solver.name}: iteration {iteration}, t_E = {objective:.4f} s"))

    def solve(program: Program, x: np.ndarray) -> SolverReport:
        remaining = deadline.within(settings.time_limit).left
        options = SolverOptions(settings.tolerance, most, remaining, *stagnation)
        return solver.solve(program, x, options, progress)

    return solve
