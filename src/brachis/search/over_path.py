"""Improve guesses over the path: optimise each joint path together with its timing, in a chart around it.

This takes tenths of a second. The result is used to rank guesses. If the phase plane covers all limits, the result is
the plan except for the splines. The lattice's joint path may be far from the closest local optimum. A chart is valid
around its own joint path. If its rows lose transversality along the better joint path, or if its margin holds the
motion back, a new chart is laid around the better joint path, and the search continues in it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, Newton, chart_around, transversality
from brachis.optimise.backends import SolverReport, solvers_for
from brachis.optimise.improve import SolvedProgram, SolverSession
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.optimise.retiming import (
    ROUGH,
    BetterPaths,
    PathEffort,
    improve_joint_paths,
    is_timing_all,
    lay_splines,
)
from brachis.optimise.transcription import program_over
from brachis.search.stages import (
    Candidate,
    FinishedCandidate,
    InitialGuess,
    RankedCandidate,
    rank,
)
from brachis.search.verified import verify

CHARTS = 4
"""Maximum number of charts in which a guess is improved, by default."""
_TRANSVERSAL = 0.5
"""Transversality of rows along a motion below which its chart is replaced by another."""


_EXCESS_FACTOR = 1.2
"""Relative lengthening of a motion in time, divided by the violation of the motion."""
_LARGEST_EXCESS = 0.1
"""Violation above which a motion is not lengthened."""
_LENGTHENINGS = 4
"""Maximum number of times that a motion is verified."""


@dataclass(frozen=True)
class BetterGuess:
    """An improved guess.

    Attributes
    ----------
    guess : InitialGuess
        Guess with the better joint path, its chart, and its least time as the estimate.
    program : Program
        Program in that chart, over the knots of the given program.
    paths : BetterPaths
        Better joint paths, with the reports of all solves.
    """

    guess: InitialGuess
    program: Program
    paths: BetterPaths


def improve_guess(
    guess: InitialGuess,
    program: Program,
    solve: SolverSession,
    effort: PathEffort,
    charts: int = CHARTS,
) -> BetterGuess:
    """Find a better joint path close to that of a guess.

    Parameters
    ----------
    guess : InitialGuess
    program : Program
        Program of the guess's joint maps, over any knots; see `improve_joint_paths`.
    solve : SolverSession
    effort : PathEffort
    charts : int, optional
        Maximum number of charts in which a better joint path is sought.

    Returns
    -------
    BetterGuess
        The guess keeps the given joint path if the limits allow no timing of it.

    Raises
    ------
    UnreachableError
        The given joint path leaves its joint map.
    """
    tolerance = guess.problem.task.spline.tolerance
    paths = improve_joint_paths(program, guess.legs, solve, tolerance, effort)
    better = BetterGuess(_replace_paths(guess, paths), program, paths)
    # A chart around a given motion is kept.
    if not guess.in_chart or guess.durations or not better.guess.is_improved:
        return better
    with contextlib.suppress(UnreachableError):
        for _ in range(charts - 1):
            moved = _lay_chart(better)
            if moved is None or solve.deadline.passed:
                break
            chart_program = program_like(program, moved)
            paths = improve_joint_paths(
                chart_program, moved.legs, solve, tolerance, effort
            )
            reports = (*better.paths.reports, *paths.reports)
            paths = replace(paths, reports=reports)
            gain = 1.0 - paths.t_end / better.paths.t_end
            if gain < -tolerances.GAIN:
                break
            better = BetterGuess(_replace_paths(moved, paths), chart_program, paths)
            if gain < tolerances.GAIN:
                break
    with contextlib.suppress(UnreachableError):
        better = _centre(better)
    return better


def program_like(program: Program, guess: InitialGuess) -> Program:
    """Return the program of a guess over the knots of another program."""
    grids = [phase.grid for phase in program.phases]
    return program_over(guess.problem, guess.maps_by_leg(), grids)


def _centre(better: BetterGuess) -> BetterGuess:
    """Lay the same chart around the better joint path, so that the search for a posture begins close to it.

    The coordinates stay the same, and so do the timings that were found. Raises UnreachableError if no chart can be
    laid.
    """
    chart, s, q = _chart_of(better.guess)
    centred = chart_around(chart.task_map, chart.path, s, q, chart.rows)
    guess = replace(better.guess, joint_map=centred)
    program = program_like(better.program, guess)
    return replace(better, guess=guess, program=program)


def _chart_of(guess: InitialGuess) -> tuple[ChartMap, np.ndarray, np.ndarray]:
    """Return the chart of a guess, its path coordinates, (S,), and postures, (S, n); or raise UnreachableError."""
    chart = guess.joint_map
    assert isinstance(chart, ChartMap)
    q = chart.postures(guess.joint_path)
    if not np.isfinite(q).all():
        raise UnreachableError("the joint path leaves the chart")
    return chart, guess.joint_path[:, 0], q


def _replace_paths(guess: InitialGuess, paths: BetterPaths) -> InitialGuess:
    """Return a guess with better joint paths, leg by leg, and their time."""
    if not np.isfinite(paths.t_end):
        return guess
    return guess.with_legs(paths.curves, paths.t_end)


def _lay_chart(better: BetterGuess) -> InitialGuess | None:
    """Lay a chart around a better joint path; None if its present chart is good enough.

    Raises UnreachableError if no chart can be laid.
    """
    chart, s, q = _chart_of(better.guess)
    newton = Newton(chart.task_map)
    rows = chart.rows.at(s)[0] * newton.scales
    least = transversality(rows, newton.self_motions(q)).min()
    if least >= _TRANSVERSAL and not better.paths.is_held_back:
        return None
    moved = chart_around(chart.task_map, chart.path, s, q)
    return replace(better.guess, joint_map=moved, joint_path=moved.curves(s, q))


def follows_timing(guess: InitialGuess, program: Program) -> bool:
    """Tell whether splines along the timing may be the plan: the phase plane covers all limits, ``intervals`` is auto.

    Other solvers, which are fallbacks, always solve over time.
    """
    task = guess.problem.task
    is_first = guess.solver == solvers_for(task.solver.name)[0].name
    is_open = task.spline.intervals == "auto"
    return is_open and is_first and guess.is_improved and is_timing_all(program)


def improve_over_path(
    guess: InitialGuess, program: Program, session: SolverSession
) -> RankedCandidate:
    """Improve a guess far enough for its time to rank it.

    Parameters
    ----------
    guess : InitialGuess
    program : Program
        Program of the guess's joint maps, over any knots.
    session : SolverSession

    Raises
    ------
    UnreachableError
        The joint path leaves its joint map.
    """
    better = improve_guess(guess, program.at_rest(), session, ROUGH)
    program = program_like(program, better.guess) if program.flies else better.program
    return rank(better.guess, program, better.paths.reports)


def lay_along_timing(
    candidate: RankedCandidate,
    program: Program,
    timings: Sequence[PhaseTiming | None],
    reports: tuple[SolverReport, ...],
    options: RefinementOptions,
) -> Candidate | None:
    """Lay splines along the timings of all phases, and verify them.

    If a limit is exceeded slightly between the points that were checked, the motion is lengthened slightly, and again
    if necessary.

    Parameters
    ----------
    candidate : RankedCandidate
    program : Program
        A program over any knots.
    timings : sequence of PhaseTiming or None
    reports : tuple of SolverReport
        Reports of earlier solves.
    options : RefinementOptions

    Returns
    -------
    Candidate or None
        None if a phase has no timing.
    """
    spline = candidate.problem.task.spline
    laid = lay_splines(
        program, timings, spline.tolerance, spline.points_per_interval, options.deadline
    )
    if laid is None:
        return None
    finer, report = laid
    excess = report.violation
    factor = 1.0
    for _ in range(_LENGTHENINGS):
        if options.tolerance < excess < _LARGEST_EXCESS:
            factor *= 1.0 + _EXCESS_FACTOR * excess
        longer = SolvedProgram(
            finer, (report,), violation=report.violation, time_scaled=factor
        )
        done = verify(candidate, reports, longer)
        if done.is_settled or not isinstance(done, FinishedCandidate):
            break
        if done.verification.worst_ratio <= 1.0 or options.deadline.passed:
            break
        excess = max(done.verification.worst_ratio - 1.0, 2.0 * options.tolerance)
    return done
