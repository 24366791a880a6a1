"""What is done with an initial guess: it is solved, and, if it is worth it, refined and verified.

1. `solve_candidate` solves over the path where its timing may be the plan (`over_path`), else over time at the first
   collocation points.
2. `finish_candidate` improves the joint path, over the path and over time, and follows its timing; or it adapts the
   mesh and refines. Then it verifies.

In between, changes of the solved program are tried, and the better motion is kept (`improve`). At the optimum any rows
that are transversal along the motion describe the same motions, but splines of their coordinates are not the same
curves: over the same knots one measure of self-motion may be a few parts in a thousand faster than another. So several
choices of single joints are tried, and the best one is kept.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, ChartRows, Newton, chart_around, transversality
from brachis.limits.safeguards import HELD_BACK
from brachis.optimise.backends import SolveStatus, solvers_for
from brachis.optimise.candidate import Candidate, InitialGuess, refine_and_verify
from brachis.optimise.guess import fit_curves, shortest_time
from brachis.optimise.improve import (
    Change,
    Solve,
    SolvedProgram,
    SolverSession,
    attempt_once,
    improve,
    keep_feasible,
)
from brachis.optimise.mesh import adapt_mesh, coarsest
from brachis.optimise.phase_timing import PhaseTiming, time_phases
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.optimise.retiming import (
    FINE,
    begin_with_timing,
    improve_joint_paths,
    is_timing_all,
    least_time,
)
from brachis.optimise.transcription import maps_by_leg, program_of, program_over
from brachis.problem.problem import Problem
from brachis.search.over_path import plan_timing, solve_over_path
from brachis.search.phase_plane import initial_guess
from brachis.task import SplineSettings

_ENTRIES = 500_000
"""Variables times rows of a program over time that improves a joint path: with more an iteration takes tenths of a
second."""
_ITERATIONS = 80
"""Iterations of a solve that does so: from the timing most solves take 5 to 25, one beside a singular posture 74."""
_WIDENING = 1e-6
"""See `SolverOptions`: along a timing hundreds of rows are at their bounds, and a solve of 0.1 s took 4 s without."""
_NEARLY = 0.01
"""Violation that refinement mends, where the iterations end a solve."""
_FIRST_LOSS = 0.05
"""Part of the time that first knots may lose, where a mesh is refined from them."""
_FIRST_INTERVALS = 16
"""Intervals of such a first mesh, about."""
NO_TIMING = "the limits allow no timing"
"""Status of a candidate whose joint path cannot be followed within the limits."""
_FOR_KNOTS = 0.5
"""Part of the time left after which the knots are not refined further."""
_FIRST_MARGIN = 0.1
"""Branch margin of a first solve: without it a rail at 0.1 m/s took three times as long, after four motions that left
their charts."""
NOT_TRIED = "not tried: the search ended"
"""Status of a candidate for which there was no time."""
SLOW = "not refined: no faster than another over all knots"
"""Status of a candidate that does not beat the best one before refinement."""
SELECTABLE = 0.05
"""Least transversality along the motion of joints that may take the place of the chart's rows."""


def solve_candidate(
    start: InitialGuess, deadline: Deadline, listener: Listener
) -> Candidate:
    """Solve from a guess, at the first collocation points, unless the time is up.

    Parameters
    ----------
    start : InitialGuess
    deadline : Deadline
    listener : callable

    Returns
    -------
    Candidate
    """
    if deadline.passed:
        return Candidate.of(start, NOT_TRIED)
    problem = start.problem
    try:
        target = program_of(problem, start.maps_by_leg())
    except UnreachableError as error:
        return Candidate.of(start, str(error))
    session = _open_session(start, deadline, listener)
    planned = solve_over_path(start, target, session)
    return planned or _solve_over_time(start, target, session)


def _solve_over_time(
    start: InitialGuess, target: Program, session: SolverSession
) -> Candidate:
    """Solve over time, with knots that the fastest timing needs, or those that are given: few of them at first."""
    target = _restrict(target, start.legs)
    task = start.problem.task
    begun = None
    is_open = task.spline.intervals == "auto" and not task.boundary.periodic
    if is_open and not any(start.problem.time_laws):
        # Over few knots, close together where the fastest timing of the joint path needs them.
        points = task.spline.points_per_interval
        with contextlib.suppress(UnreachableError):
            pairs = zip(target.phases, start.legs, strict=True)
            timings = [PhaseTiming.through(*pair) for pair in pairs]
            begun = begin_with_timing(
                target, timings, _FIRST_LOSS, _FIRST_INTERVALS, points
            )
    if begun is not None:
        program, x = begun
        target = program
    else:
        is_near = start.joint_map.r <= 1 and is_timing_all(target)
        # At a given speed motions leave their charts between few points.
        is_whole = is_near or any(start.problem.time_laws)
        program = target if is_whole else coarsest(target)
        first = initial_guess(program, start)
        if first is None:
            return Candidate.of(
                start,
                "the splines through the joint path leave the branch, or the chart",
            )
        x = first
    solved = keep_feasible(_solve_clear_first(program, x, session), x)
    status = solved.report.status
    words = status.name.lower().replace("_", " ")
    if status is SolveStatus.OPTIMAL:
        words = "planned"
    elif status.usable:
        words = f"planned, {words}"
    coarse = solved.t_end if status.usable else np.inf
    return Candidate.of(
        start,
        words,
        program=solved.program,
        target=target,
        reports=solved.reports,
        coarse=coarse,
        not_completed=solved.not_completed,
    )


def _solve_clear_first(
    program: Program, x: np.ndarray, session: SolverSession
) -> SolvedProgram:
    """Solve from x, (v,), clear of branch boundaries; near them too if that is how the motion is held back.

    Where many motions are equally fast, as at a given speed, they drift to the boundary, and leave the branch between
    the collocation points.
    """
    clear = attempt_once(session, program.with_margin(_FIRST_MARGIN), x)
    is_late = clear.report.status is SolveStatus.TIME_LIMIT
    is_free = clear.usable and clear.program.safeguard_slack(clear.x) > HELD_BACK
    if is_late or is_free:
        return clear
    near = attempt_once(session, program, clear.x if clear.usable else x)
    if near.usable or not clear.usable:
        return replace(near, reports=clear.reports + near.reports)
    return replace(clear, reports=near.reports + clear.reports)


def finish_candidate(
    candidate: Candidate, deadline: Deadline, listener: Listener
) -> Candidate:
    """Improve a candidate as far as the time allows, and verify it.

    A joint path is improved and its timing followed; a motion over time gets a finer mesh and is refined.

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
    assert candidate.start is not None
    session = _open_session(candidate.start, deadline.part(_FOR_KNOTS), listener)
    settings = candidate.start.problem.task.refinement
    options = RefinementOptions.of(settings, deadline)
    finish = _finish_over_path if candidate.is_over_path else _finish_over_time
    return finish(candidate, session, options)


def _finish_over_path(
    candidate: Candidate, session: SolverSession, options: RefinementOptions
) -> Candidate:
    """Improve joint paths further over the path, then over time, and follow the faster one's timing.

    What the solve over time gains in the joint path stays; what its knots lose in the timing is regained by splines
    that are laid along it.
    """
    start = candidate.start
    program = candidate.program
    assert start is not None and program is not None
    spline = start.problem.task.spline
    better_paths = improve_joint_paths(
        program, start.legs, session, spline.tolerance, FINE
    )
    timings: Sequence[PhaseTiming | None] = better_paths.timings
    reports = (*candidate.reports, *better_paths.reports)
    iterations = min(_ITERATIONS, session.options.max_iterations)
    bounds = replace(session.options, max_iterations=iterations, widening=_WIDENING)
    session = replace(session, options=bounds)
    refined = None
    solved = None
    if start.joint_map.r and not session.deadline.passed:
        restricted = _restrict(program, better_paths.curves)
        solved = _improve_over_time(restricted, timings, session, spline)
    if solved is not None:
        reports = (*reports, *solved.reports)
        pairs = zip(solved.program.phases, program.phases, strict=True)
        unrestricted = solved.program.with_phases(
            phase.with_limits(original.limits) for phase, original in pairs
        )
        new_timings = time_phases(unrestricted, solved.x)
        if least_time(new_timings) < better_paths.t_end:
            program = unrestricted
            timings = new_timings
        longest = least_time(timings) * (1.0 + spline.tolerance)
        longest += start.problem.dwell_time
        if solved.t_end < longest:
            refining = replace(session, deadline=options.deadline)
            refined = refine_and_verify(
                candidate, solved.program, reports, refining, options
            )
            if refined.is_settled and refined.t_end < longest:
                return refined
    followed = plan_timing(candidate, program, timings, reports, options)
    without_timing = replace(candidate, status=NO_TIMING, reports=reports)
    motions = [each for each in (refined, followed) if each is not None]
    return min(
        motions,
        key=lambda each: (not each.is_settled, each.t_end),
        default=without_timing,
    )


def _restrict(program: Program, curves: Sequence[np.ndarray]) -> Program:
    """Return a program with the limits that are near along the curves of its phases, (S, c) each."""
    pairs = zip(program.phases, curves, strict=True)
    return program.with_phases(phase.restrict_to(own) for phase, own in pairs)


def _improve_over_time(
    program: Program,
    timings: Sequence[PhaseTiming | None],
    session: SolverSession,
    spline: SplineSettings,
) -> SolvedProgram | None:
    """Solve over time from splines along the timings of all phases; None where that gives no motion."""
    r = program.phases[0].joint_map.r
    # Variables times rows grow with the square of the intervals.
    rows = (1 + r) * len(program.lower) / program.intervals
    intervals = int(np.sqrt(_ENTRIES / rows))
    begun = begin_with_timing(
        program, timings, spline.tolerance, intervals, spline.points_per_interval
    )
    if begun is None:
        return None
    session = replace(session, acceptable=_NEARLY)
    solved = attempt_once(session, *begun, accept_early_end=True)
    return solved if solved.usable else None


def _finish_over_time(
    candidate: Candidate, session: SolverSession, options: RefinementOptions
) -> Candidate:
    """Adapt the mesh, refine and verify."""
    start = candidate.start
    program = candidate.program
    assert start is not None and program is not None
    solved = SolvedProgram(program, candidate.reports)
    target = candidate.target
    # The chart around a given motion is kept.
    is_free = start.in_chart and start.durations is None
    if candidate.keeps_knots and is_free and not session.deadline.passed:
        solved = best_of_joints(start.problem, solved, session)
        target = solved.program
    spline = start.problem.task.spline
    soon = replace(options, deadline=session.deadline)
    adapted = adapt_mesh(solved, session, spline, soon, target=target)
    undone = filter(None, (candidate.not_completed, adapted.not_completed))
    named = replace(candidate, not_completed="; ".join(undone))
    return _refine_if_fast(named, adapted, session, options)


def _refine_if_fast(
    candidate: Candidate,
    adapted: SolvedProgram,
    session: SolverSession,
    options: RefinementOptions,
) -> Candidate:
    """Refine and verify a motion over all its knots, if it is faster than what it has to beat.

    Rounds begin near their answer, which helps an active-set method, and an interior point not at all. So the task's
    first solver refines, and the one that found the motion if that fails.
    """
    if adapted.usable:
        candidate = replace(candidate, adapted=adapted.t_end)
        if adapted.t_end >= candidate.to_beat:
            return replace(candidate, status=SLOW)
    session = replace(session, deadline=options.deadline)
    assert candidate.start is not None
    first = solvers_for(candidate.start.problem.task.solver.name)[0]
    done = None
    for backend in dict.fromkeys((first, session.backend)):
        own = replace(session, backend=backend)
        tried = refine_and_verify(
            candidate, adapted.program, adapted.reports, own, options
        )
        if done is None or tried.is_settled:
            done = tried
        if done.is_settled or options.deadline.passed:
            break
    assert done is not None
    return done


def _open_session(
    start: InitialGuess, deadline: Deadline, listener: Listener
) -> SolverSession:
    """Open a session of the guess's solver under the task's bounds."""
    (backend,) = solvers_for(start.solver)
    problem = start.problem
    return SolverSession.for_task(
        backend,
        problem.task.solver,
        start.joint_map,
        deadline,
        listener,
        has_time_law=any(problem.time_laws),
    )


def best_of_joints(
    problem: Problem, solved: SolvedProgram, solve: Solve
) -> SolvedProgram:
    """Solve again in a chart around the answer, and with joints in place of its rows, and keep the fastest.

    Parameters
    ----------
    problem : Problem
    solved : SolvedProgram
        A program in a chart.
    solve : callable

    Returns
    -------
    SolvedProgram
    """
    choices = [None, *_select_joints(solved)]
    points = [move_to_chart(problem, solved, rows) for rows in choices]
    return improve(
        solved,
        [_go_to(point) for point in points if point is not None],
        partial(attempt_once, solve),
        least_gain=0.0,
        go_on_above=None,
    )


def _go_to(point: tuple[Program, np.ndarray]) -> Change:
    """Change to a program and a point, whatever was kept so far."""
    return lambda _kept: point


def move_to_chart(
    problem: Problem, solved: SolvedProgram, rows: ChartRows | None = None
) -> tuple[Program, np.ndarray] | None:
    """Write a motion in a chart around itself; None if it has none.

    Parameters
    ----------
    problem : Problem
    solved : SolvedProgram
    rows : ChartRows, optional
        Of the chart; chosen anew if not given, as for `chart_around`.

    Returns
    -------
    program : Program
    x : (v,) ndarray
        The same motion but for what splines of the new coordinates cannot say.
    """
    try:
        motions = solved.program.motions(solved.report.x)
        dense = []
        for phase, motion in zip(solved.program.phases, motions, strict=True):
            t_norm = np.linspace(0.0, 1.0, 4 * len(phase.t_norm) + 1)
            times = t_norm * motion.t_end
            state = phase.joint_map.state(*motion.at(times), t=times)
            dense.append((motion.t_end, t_norm, state))
        s = np.concatenate([state.s for _, _, state in dense])
        q = np.concatenate([state.q for _, _, state in dense])
        chart = chart_around(problem.task_map, problem.path, s, q, rows)
        starts = np.array([state.q[0] for _, _, state in dense])
        maps = maps_by_leg(problem, chart, starts)
        grids = [phase.grid for phase in solved.program.phases]
        program = program_over(problem, maps, grids)
        parts = []
        for phase, (t_end, t_norm, state) in zip(program.phases, dense, strict=True):
            curves = chart.curves(state.s, state.q)
            parts.append(fit_curves(phase, t_end, t_norm, curves))
        return program, shortest_time(program, np.concatenate(parts))
    except UnreachableError:
        return None


def _select_joints(solved: SolvedProgram) -> list[ChartRows]:
    """Rows that select joints and are transversal along the motion, the most transversal ones first."""
    chart = solved.program.phases[0].joint_map
    assert isinstance(chart, ChartMap)
    states = solved.program.states(solved.report.x)
    q = np.concatenate([state.q for state in states])
    null = Newton(chart.task_map).self_motions(q)
    n, r = null.shape[1:]
    # Three choices of one redundant joint and one of several are tried: these solves take longest.
    most = (0, 3, 1)[min(r, 2)]
    selections = []
    for joints in itertools.islice(itertools.combinations(range(n), r), 500):
        rows = np.eye(n)[list(joints)]
        least = float(transversality(rows[None], null).min())
        if least >= SELECTABLE:
            selections.append((least, rows))
    selections.sort(key=lambda item: -item[0])
    return [ChartRows.constant(rows) for _, rows in selections[:most]]
