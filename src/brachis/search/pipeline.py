"""From an initial guess to a verified motion: every task goes through these steps, in this order.

    joint path      from a lattice, from a given motion, or given by the task           `schedule`, `starts`
    over the path   joint path and speed together, in a chart or in closed form         `over_path`
    timing          the fastest one along the best joint path, by the phase plane       `PhaseTiming`
    splines         over given knots, or over knots where the timing needs them         `over_time`
    over time       the program with all limits, from these splines                     `over_time`
    knots           more of them, free ones, other coordinates over the same ones       `mesh`, `joint_choice`
    refinement      collocation points where limits are exceeded between others         `refine`
    verification    from URDF, path and limits alone                                    `verified`

`solve_candidate` goes as far as candidates have to be ranked by their end times; `finish_candidate` goes on from there
with those that may be the fastest. Where the phase plane knows all limits and the knots are open, the timing ranks, and
the program over time improves the joint path; splines along its timing are the answer where they are faster. Everywhere
else the program over time, over few knots at first, ranks.
"""

from __future__ import annotations

from dataclasses import replace

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import UnreachableError
from brachis.optimise.backends import solvers_for
from brachis.optimise.improve import SolvedProgram, SolverSession
from brachis.optimise.mesh import adapt_mesh
from brachis.optimise.refine import RefinementOptions
from brachis.optimise.retiming import FINE, improve_joint_paths, is_timing_all
from brachis.optimise.transcription import program_of
from brachis.search.joint_choice import best_of_joints
from brachis.search.over_path import plan_timing, solve_over_path
from brachis.search.over_time import (
    improve_timings,
    limit_along_timing,
    solve_over_time,
)
from brachis.search.stages import (
    Candidate,
    InitialGuess,
    SolvedCandidate,
    begin_candidate,
)
from brachis.search.verified import refine_and_verify

_FOR_KNOTS = 0.5
"""Part of the time left after which the knots are not refined further."""
NOT_TRIED = "not tried: the search ended"
"""Status of a candidate for which there was no time."""
SLOW = "not refined: no faster than another over all knots"
"""Status of a candidate that does not beat the best one before refinement."""
NO_TIMING = "the limits allow no timing"
"""Status of a candidate whose joint path cannot be followed within the limits."""


def solve_candidate(
    guess: InitialGuess, deadline: Deadline, listener: Listener
) -> Candidate:
    """Solve from a guess as far as candidates have to be ranked, unless the time is up.

    Parameters
    ----------
    guess : InitialGuess
    deadline : Deadline
    listener : callable

    Returns
    -------
    Candidate
        A solved one where the solve ended well.
    """
    if deadline.passed:
        return begin_candidate(guess, NOT_TRIED)
    try:
        program = program_of(guess.problem, guess.maps_by_leg())
    except UnreachableError as error:
        return begin_candidate(guess, str(error))
    session = _open_session(guess, deadline, listener)
    is_open = guess.problem.task.spline.intervals == "auto"
    # As a fallback other solvers solve over time.
    is_first = guess.solver == solvers_for(guess.problem.task.solver.name)[0].name
    solved = None
    if is_open and is_first and is_timing_all(program):
        solved = solve_over_path(guess, program, session)
    return solved or solve_over_time(guess, program, session)


def finish_candidate(
    candidate: SolvedCandidate, to_beat: float, deadline: Deadline, listener: Listener
) -> Candidate:
    """Improve a candidate as far as the time allows, and verify it.

    Parameters
    ----------
    candidate : SolvedCandidate
    to_beat : float
        End time over all knots, s, from which on it is not refined: another motion is as fast.
    deadline : Deadline
    listener : callable

    Returns
    -------
    Candidate
        A finished one where there is a motion.
    """
    session = _open_session(candidate.guess, deadline.part(_FOR_KNOTS), listener)
    settings = candidate.problem.task.refinement
    options = RefinementOptions.of(settings, deadline)
    finish = _finish_over_path if candidate.is_over_path else _finish_over_time
    return finish(candidate, session, options, to_beat)


def _finish_over_time(
    candidate: SolvedCandidate,
    session: SolverSession,
    options: RefinementOptions,
    to_beat: float,
) -> Candidate:
    """Choose coordinates and knots, refine and verify."""
    guess = candidate.guess
    solved = SolvedProgram(candidate.program, candidate.reports)
    target = candidate.target
    # The chart around a given motion is kept.
    is_free = guess.in_chart and guess.durations is None
    if candidate.keeps_knots and is_free and not session.deadline.passed:
        solved = best_of_joints(guess.problem, solved, session)
        target = solved.program
    spline = guess.problem.task.spline
    soon = replace(options, deadline=session.deadline)
    adapted = adapt_mesh(solved, session, spline, soon, target=target)
    undone = filter(None, (candidate.not_completed, adapted.not_completed))
    candidate = replace(candidate, not_completed="; ".join(undone))
    return _refine_if_fast(candidate, adapted, session, options, to_beat)


def _finish_over_path(
    candidate: SolvedCandidate,
    session: SolverSession,
    options: RefinementOptions,
    _to_beat: float,
) -> Candidate:
    """Improve joint paths further over the path, then over time, and follow the faster one's timing.

    What the program over time gains in the joint path stays; what its knots lose in the timing is regained by splines
    that are laid along it.
    """
    guess = candidate.guess
    program = candidate.program
    tolerance = guess.problem.task.spline.tolerance
    paths = improve_joint_paths(program, guess.legs, session, tolerance, FINE)
    reports = (*candidate.reports, *paths.reports)
    session = limit_along_timing(session)
    retimed = improve_timings(guess, program, paths, session)
    reports = (*reports, *retimed.reports)
    longest = retimed.t_end * (1.0 + tolerance) + guess.problem.dwell_time
    motions = []
    if retimed.solved is not None and retimed.solved.t_end < longest:
        solved = replace(retimed.solved, reports=reports)
        motion = _refine_if_fast(candidate, solved, session, options, longest)
        motions.append(motion)
        if motion.is_settled and motion.t_end < longest:
            return motion
    laid = plan_timing(candidate, retimed.program, retimed.timings, reports, options)
    if laid is not None:
        motions.append(laid)
    no_timing = replace(candidate, status=NO_TIMING, reports=reports)
    return min(
        motions,
        key=lambda motion: (not motion.is_settled, motion.t_end),
        default=no_timing,
    )


def _refine_if_fast(
    candidate: SolvedCandidate,
    adapted: SolvedProgram,
    session: SolverSession,
    options: RefinementOptions,
    to_beat: float,
) -> Candidate:
    """Refine and verify a motion over all its knots, if it is faster than what it has to beat.

    Rounds begin near their answer, which helps an active-set method, and an interior point not at all. So the task's
    first solver refines, and the one that found the motion if that fails.
    """
    if adapted.usable:
        candidate = replace(candidate, adapted=adapted.t_end)
        if adapted.t_end >= to_beat:
            return replace(candidate, status=SLOW)
    first = solvers_for(candidate.problem.task.solver.name)[0]
    outcomes: list[Candidate] = []
    for backend in dict.fromkeys((first, session.backend)):
        refining = replace(session, deadline=options.deadline, backend=backend)
        outcome = refine_and_verify(
            candidate, adapted.program, adapted.reports, refining, options
        )
        outcomes.append(outcome)
        if outcome.is_settled or options.deadline.passed:
            break
    return next((each for each in outcomes if each.is_settled), outcomes[0])


def _open_session(
    guess: InitialGuess, deadline: Deadline, listener: Listener
) -> SolverSession:
    """Open a session of the guess's solver under the task's bounds."""
    (backend,) = solvers_for(guess.solver)
    problem = guess.problem
    return SolverSession.for_task(
        backend,
        problem.task.solver,
        guess.joint_map,
        deadline,
        listener,
        has_time_law=any(problem.time_laws),
    )
