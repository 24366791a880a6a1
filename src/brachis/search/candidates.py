"""What is done with an initial guess: it is solved, and, if it is worth it, refined and verified.

1. `solve_candidate` solves from a joint path at the first collocation points.
2. `finish_candidate` adapts the mesh, refines and verifies.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.optimise.backends import SolveStatus, solver_named
from brachis.optimise.candidate import (
    Candidate,
    InitialGuess,
    refine_and_verify,
)
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.mesh import adapt_mesh, coarsest
from brachis.optimise.refine import RefinementOptions
from brachis.optimise.session import SolverSession
from brachis.optimise.transcription import phase_in, program_of
from brachis.search.phase_plane import initial_guess, initial_knots
from brachis.search.solving import (
    MARGINS,
    best_of_joints,
    solve_by_margin_continuation,
    solve_in_chart,
    solve_without_third_order_limits,
)


def solve_candidate(
    start: InitialGuess, deadline: Deadline, listener: Listener
) -> Candidate:
    """Solve from a guess, at the first collocation points.

    Parameters
    ----------
    start : InitialGuess
    deadline : Deadline
    listener : callable

    Returns
    -------
    Candidate
    """
    problem = start.problem
    target = program_of(problem, start.joint_map, initial_knots(start))
    # With more variables a cold solve takes seconds: it is first solved over some of its knots.
    program = coarsest(target) if target.variables > 150 else target
    x = initial_guess(program, start)
    if x is None:
        return Candidate.of(
            start, "the splines through the joint path leave the branch, or the chart"
        )
    session = _open_session(start, deadline, listener)
    try:
        x, before = solve_without_third_order_limits(program, x, session, MARGINS[0])
        if _is_free_chart(start):
            solved = solve_in_chart(problem, program, x, session)
            joint_map = solved.program.phases[0].joint_map
            target = target.with_phases(
                phase_in(problem, joint_map, phase.grid) for phase in target.phases
            )
        else:
            solved = solve_by_margin_continuation(program, x, session, MARGINS)
    except ImportError as error:
        return Candidate.of(start, f"{start.solver}: not installed ({error})")
    status = solved.report.status
    words = status.name.lower().replace("_", " ")
    if status is SolveStatus.OPTIMAL:
        words = "planned"
    elif status.usable:
        words = f"planned, {words}"
    return Candidate.of(
        start,
        words,
        program=solved.program,
        target=target,
        reports=(*before, *solved.reports),
        coarse=solved.report.objective if status.usable else np.inf,
    )


def finish_candidate(
    candidate: Candidate, deadline: Deadline, listener: Listener
) -> Candidate:
    """Adapt the mesh, refine and verify; only verify if the time is up.

    Parameters
    ----------
    candidate : Candidate
        A usable one.
    deadline : Deadline
    listener : callable

    Returns
    -------
    Candidate
    """
    start = candidate.start
    program = candidate.program
    assert start is not None and program is not None
    task = start.problem.task
    settings = task.refinement
    # Of the time that is left, the knots may take this part.
    soon = deadline.part(0.4)
    options = RefinementOptions(
        settings.tolerance, settings.density, settings.max_rounds, soon
    )
    session = _open_session(start, soon, listener)
    target = candidate.target
    solved = SolvedProgram(program, candidate.reports)
    if candidate.keeps_knots and _is_free_chart(start) and not deadline.passed:
        solved = best_of_joints(start.problem, solved, session)
        target = solved.program
    adapted = adapt_mesh(solved, session, task.spline, options, target=target)
    candidate = dataclasses.replace(candidate, not_completed=adapted.not_completed)
    options = dataclasses.replace(options, deadline=deadline)
    session = dataclasses.replace(session, deadline=deadline)
    return refine_and_verify(
        candidate, adapted.program, adapted.reports, session, options
    )


def _is_free_chart(start: InitialGuess) -> bool:
    """Tell whether the chart may still be changed: that around a motion is kept."""
    return start.in_chart and not start.timed


def _open_session(
    start: InitialGuess, deadline: Deadline, listener: Listener
) -> SolverSession:
    """Open a session of the guess's solver under the task's bounds."""
    (backend,) = solver_named(start.solver)
    settings = start.problem.task.solver
    return SolverSession.for_task(
        backend, settings, start.joint_map, deadline, listener
    )
