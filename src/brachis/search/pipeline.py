"""From an initial guess to a verified motion: the steps in their order.

    joint path      from a lattice, at random, from a given motion, or from the task
    over the path   joint path and speed together                                       a better InitialGuess
    timing          the fastest timing of that joint path, by the phase plane           RankedCandidate
    over time       the program with all limits, from splines along that timing         SolvedProgram
    knots           finer or free knots; other coordinates over the same knots          SolvedProgram
    refinement      more collocation points where limits are exceeded between them      SolvedProgram
    verification    from URDF, path and limits alone                                    FinishedCandidate

`rank_candidate` goes as far as the timing, whose duration, `Candidate.estimate`, ranks the candidates. Limits that the
phase plane does not cover (jerk, torque rate, means) do not affect this duration. `finish_candidate` continues with the
candidates that may be the fastest, in one of two ways:

- `_finish_over_time`, if knots are given (``intervals: 20``, or ``knots: free``), or if the phase plane does not cover
  one of the limits. The solution of the program over time is refined. Where a speed is given, the smoothest motion that
  is as fast is refined in its place.
- `_finish_over_path`, for ``intervals: auto`` and limits that the phase plane covers. The program over time improves
  the joint path. Its solution is refined if it is about as fast as the timing of its own joint path; otherwise splines
  are laid along this timing. For a large program they are laid first, unless its solution is much faster.

The coordinates are those of a closed form if the task names its redundant joints. Otherwise they are those of a chart,
which measures self-motion around a joint path. A prescribed joint path leaves nothing to improve: it is timed, and
splines are laid along the timing.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener, ignore
from brachis.errors import UnreachableError
from brachis.optimise.backends import solvers_for
from brachis.optimise.improve import SolvedProgram, SolverSession
from brachis.optimise.mesh import adapt_mesh
from brachis.optimise.refine import RefinementOptions
from brachis.optimise.retiming import FINE, improve_joint_paths, is_timing_all
from brachis.optimise.transcription import program_of
from brachis.search.by_parts import finish_by_parts
from brachis.search.first_motion import LITTLE_TIME
from brachis.search.joint_choice import best_of_joints
from brachis.search.least_motion import find_least_motion, refine_smoothest, smoothen
from brachis.search.over_path import follows_timing, improve_over_path, lay_along_timing
from brachis.search.over_time import (
    improve_timings,
    shorten_solves,
    solve_over_time,
)
from brachis.search.stages import (
    NO_TIMING,
    NOT_TRIED,
    SLOW,
    Candidate,
    FinishedCandidate,
    InitialGuess,
    Marks,
    RankedCandidate,
    begin_candidate,
    fail,
    faster,
    rank,
)
from brachis.search.verified import refine_and_verify
from brachis.trajectory import Trajectory

_BEFORE_REFINEMENT = 0.5
"""Fraction of the remaining time for everything before refinement."""
_IF_SHORT = 0.2
"""The same fraction if there is little time and splines are laid, which takes half a second. With 0.5, splines were
laid too late."""
_WORTH_REFINING = 0.05
"""Fraction of the time that refinement must save for a large program to be refined before splines are laid."""


def rank_candidate(
    guess: InitialGuess, deadline: Deadline, _listener: Listener
) -> Candidate:
    """Improve the joint path of a guess over the path, so that candidates can be ranked; skip it if the time is up.

    Parameters
    ----------
    guess : InitialGuess
    deadline : Deadline

    Returns
    -------
    Candidate
        A ranked candidate, unless the joint path leaves its joint map, or the time is up.
    """
    if deadline.passed:
        return begin_candidate(guess, NOT_TRIED)
    # A given motion is the first point of the program over time if this program gives the final solution.
    is_motion = guess.durations is not None
    has_given_knots = guess.problem.task.spline.intervals != "auto"
    try:
        program = program_of(guess.problem, guess.maps_by_leg())
        begins_over_time = has_given_knots or not is_timing_all(program)
        if guess.is_improved or (is_motion and begins_over_time):
            return rank(guess, program)
        return improve_over_path(guess, program, _open_session(guess, deadline, ignore))
    except UnreachableError as error:
        return begin_candidate(guess, str(error))


def finish_candidate(
    candidate: RankedCandidate, to_beat: Marks, deadline: Deadline, listener: Listener
) -> Candidate:
    """Improve a candidate as far as the time allows, and verify it.

    Parameters
    ----------
    candidate : RankedCandidate
    to_beat : Marks
        End times of the fastest motion so far.
    deadline : Deadline
    listener : callable

    Returns
    -------
    Candidate
        A `FinishedCandidate` if a motion was found.
    """
    settings = candidate.problem.task.refinement
    options = RefinementOptions.of(settings, deadline)
    program = candidate.program
    is_divided = len(candidate.problem.flights) > 1
    if is_divided and not (is_timing_all(program) or program.means):
        finish_part = partial(
            finish_candidate, to_beat=Marks(), deadline=deadline, listener=listener
        )
        smooth_part = partial(_smooth_part, deadline=deadline, listener=listener)
        return finish_by_parts(candidate, finish_part, smooth_part)
    is_followed = follows_timing(candidate.guess, candidate.program)
    is_short = is_followed and deadline.left < LITTLE_TIME
    share = _IF_SHORT if is_short else _BEFORE_REFINEMENT
    session = _open_session(candidate.guess, deadline.part(share), listener)
    finish = _finish_over_path if is_followed else _finish_over_time
    try:
        return finish(candidate, session, options, to_beat)
    except UnreachableError as error:
        return fail(candidate, str(error))


def _smooth_part(
    part: FinishedCandidate, share: float, deadline: Deadline, listener: Listener
) -> Trajectory:
    """Return the smoothest motion of a part of a program, sought for a share of the remaining time if the task asks."""
    if not part.problem.task.search.least_motion:
        return part.trajectory
    return find_least_motion(part, deadline.part(share), listener).trajectory


def _finish_over_time(
    candidate: RankedCandidate,
    session: SolverSession,
    options: RefinementOptions,
    to_beat: Marks,
) -> Candidate:
    """Solve over time, choose coordinates and knots, refine and verify."""
    guess = candidate.guess
    spline = guess.problem.task.spline
    pairs = zip(candidate.program.phases, guess.legs, strict=True)
    # Rows that are far from their bounds all along the joint path are left out.
    program = candidate.program.with_phases(
        phase.restrict_to(curves) for phase, curves in pairs
    )
    solved = solve_over_time(guess, program, session)
    if not solved.usable:
        words = solved.report.status.name.lower().replace("_", " ")
        return fail(candidate, words, solved.reports)
    # A program over many knots is solved from the solution over few knots.
    target = solved.program if spline.intervals == "auto" else program
    has_given_knots = spline.intervals != "auto" and spline.knots != "free"
    has_all_knots = solved.program.intervals == target.intervals
    # The chart around a given motion is kept, and so is a joint that the task names.
    is_free = guess.in_chart and guess.durations is None
    if not (has_given_knots and has_all_knots):
        candidate = replace(candidate, begun=solved.t_end)
        if solved.t_end >= to_beat.begun:
            reports = (*candidate.reports, *solved.reports)
            return replace(candidate, status=SLOW, reports=reports)
    elif is_free and not session.deadline.passed:
        solved = best_of_joints(guess.problem, solved, session)
        target = solved.program
    soon = replace(options, deadline=session.deadline)
    adapted = adapt_mesh(solved, session, spline, soon, target=target)
    adapted = replace(adapted, reports=(*candidate.reports, *adapted.reports))
    undone = filter(None, (solved.not_completed, adapted.not_completed))
    candidate = replace(candidate, not_completed="; ".join(undone))
    if adapted.usable:
        candidate = replace(candidate, adapted=adapted.t_end)
        if adapted.t_end >= to_beat.adapted:
            return replace(candidate, status=SLOW, reports=adapted.reports)
    is_smoothed = target.has_time_laws and guess.problem.task.search.least_motion
    if adapted.usable and is_smoothed and not options.deadline.passed:
        smoothest = refine_smoothest(candidate, adapted, options.deadline)
        if smoothest is not None:
            return smoothest
    return _refine(candidate, adapted, session, options)


def _finish_over_path(
    candidate: RankedCandidate,
    session: SolverSession,
    options: RefinementOptions,
    to_beat: Marks,
) -> Candidate:
    """Improve joint paths further over the path, then over time, and follow the faster of the two timings.

    The joint path that the program over time improves is kept. The time that its knots cost is regained by splines that
    are laid along the timing. Parts that meet in motion stop over the path; the program over time finds their speeds.
    """
    guess = candidate.guess
    task = guess.problem.task
    program = candidate.program
    tolerance = task.spline.tolerance
    at_rest = program.at_rest()
    paths = improve_joint_paths(at_rest, guess.legs, session, tolerance, FINE)
    reports = (*candidate.reports, *paths.reports)
    session = shorten_solves(session)
    is_smoothed = guess.problem.is_chain and task.search.least_motion
    smooth = partial(smoothen, task, deadline=options.deadline) if is_smoothed else None
    retimed = improve_timings(guess, program, paths, session, smooth)
    reports = (*reports, *retimed.reports)
    least = retimed.t_end + guess.problem.dwell_time
    candidate = replace(candidate, adapted=least, reports=reports)
    if to_beat.adapted <= least < np.inf:
        return replace(candidate, status=SLOW)
    longest = least + tolerance * retimed.t_end
    solved = retimed.solved
    # Refining a large program takes ten times as long as laying splines.
    is_laid_first = (
        solved is not None
        and session.choose_for_large(solved.program) is not None
        and least < (1.0 + _WORTH_REFINING) * solved.t_end
    )

    def lay() -> Candidate | None:
        """Lay splines along the timing."""
        laid = lay_along_timing(
            candidate, retimed.program, retimed.timings, reports, options
        )
        if isinstance(laid, FinishedCandidate) and solved is not None:
            return replace(laid, optimum=solved, is_smoothed=retimed.is_smoothed)
        return laid

    def refine() -> Candidate | None:
        """Refine the motion over time if it is about as fast as the timing."""
        if solved is None or solved.t_end >= longest:
            return None
        return _refine(candidate, replace(solved, reports=reports), session, options)

    motions = []
    attempts = (lay, refine) if is_laid_first else (refine, lay)
    for attempt in attempts:
        motion = attempt()
        if motion is None:
            continue
        motions.append(motion)
        if motion.is_settled and (is_laid_first or motion.t_end < longest):
            return motion
    no_timing = replace(candidate, status=NO_TIMING)
    return faster(*motions, no_timing)


def _refine(
    candidate: RankedCandidate,
    adapted: SolvedProgram,
    session: SolverSession,
    options: RefinementOptions,
) -> Candidate:
    """Refine and verify a motion over all its knots.

    Refinement rounds begin close to their solution, which helps an active-set method, but not an interior-point method.
    So the task's first solver refines; if it fails, the solver that found the motion does.
    """
    first = solvers_for(candidate.problem.task.solver.name)[0]
    outcomes: list[Candidate] = []
    for backend in dict.fromkeys((first, session.backend)):
        refining = replace(
            session, deadline=options.deadline, backend=backend, interior=None
        )
        outcome = refine_and_verify(
            candidate, adapted.program, adapted.reports, refining, options
        )
        outcomes.append(outcome)
        if outcome.is_settled or options.deadline.passed:
            break
    return next((outcome for outcome in outcomes if outcome.is_settled), outcomes[0])


def _open_session(
    guess: InitialGuess, deadline: Deadline, listener: Listener
) -> SolverSession:
    """Open a session of the guess's solver with the solver settings of the task."""
    (backend,) = solvers_for(guess.solver)
    return SolverSession.for_task(
        backend, guess.problem, guess.joint_map, deadline, listener
    )
