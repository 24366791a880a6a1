"""What is done with a start: it is solved, and, where it is worth it, refined and verified.

1. `solve_candidate` solves from a joint path at the first collocation points.
2. `finish_candidate` adapts the mesh, refines and verifies.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.optimise.backends import SolveStatus, solver_named
from brachis.optimise.candidate import Candidate, InitialGuess
from brachis.optimise.completion import refine_and_verify
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

_MANY_VARIABLES = 150
"""Above this a cold solve takes seconds, and the program is first solved over some of its knots."""
_KNOT_TIME = 0.4
"""Part of the remaining time that may go into the knots."""


def solve_candidate(
    start: InitialGuess, deadline: Deadline, listener: Listener
) -> Candidate:
    """Solve from a start, at the first collocation points.

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
    program = coarsest(target) if target.variables > _MANY_VARIABLES else target
    x = initial_guess(program, start)
    if x is None:
        return Candidate.of(
            start, "the splines through the joint path leave the branch, or the chart"
        )
    session = _session(start, deadline, listener)
    try:
        x, before = solve_without_third_order_limits(program, x, session, MARGINS[0])
        if start.in_chart and not start.timed:
            program, reports = solve_in_chart(problem, program, x, session)
            joint_map = program.phases[0].joint_map
            target = target.with_phases(
                phase_in(problem, joint_map, phase.grid) for phase in target.phases
            )
        else:
            program, reports = solve_by_margin_continuation(
                program, x, session, MARGINS
            )
    except ImportError as error:
        return Candidate.of(start, f"{start.solver}: not installed ({error})")
    last = reports[-1]
    reports = (*before, *reports)
    coarse = last.objective if last.status.usable else np.inf
    return Candidate.of(
        start,
        _in_words(last.status),
        program=program,
        target=target,
        reports=reports,
        coarse=coarse,
    )


def finish_candidate(
    candidate: Candidate, deadline: Deadline, listener: Listener
) -> Candidate:
    """Adapt the mesh, refine and verify; only verify where the time is up.

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
    soon = deadline.part(_KNOT_TIME)
    options = RefinementOptions(
        settings.tolerance, settings.density, settings.max_rounds, soon
    )
    session = _session(start, soon, listener)
    reports = candidate.reports
    target = candidate.target
    if (
        candidate.keeps_knots
        and start.in_chart
        and not start.timed
        and not deadline.passed
    ):
        program, further = best_of_joints(start.problem, program, reports[-1], session)
        reports = (*reports[:-1], *further)
        target = program
    adapted = adapt_mesh(program, reports, session, task.spline, options, target=target)
    candidate = dataclasses.replace(candidate, not_completed=adapted.not_completed)
    options = dataclasses.replace(options, deadline=deadline)
    session = dataclasses.replace(session, deadline=deadline)
    return refine_and_verify(
        candidate, adapted.program, adapted.reports, session, options
    )


def _session(
    start: InitialGuess, deadline: Deadline, listener: Listener
) -> SolverSession:
    """Open a session of the start's solver under the task's bounds."""
    (backend,) = solver_named(start.solver)
    settings = start.problem.task.solver
    return SolverSession.for_task(
        backend, settings, start.joint_map, deadline, listener
    )


def _in_words(status: SolveStatus) -> str:
    name = status.name.lower().replace("_", " ")
    if not status.usable:
        return name
    return "planned" if status is SolveStatus.OPTIMAL else f"planned, {name}"
