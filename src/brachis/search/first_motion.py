"""A motion within the limits close to a joint path, found without a solve; it is sought first if there is little time.

Splines along a joint path nearly meet the limits if they are slow enough. But the splines of the phases are laid one by
one, so they do not quite meet each other, and limits are exceeded close to their ends. The remedy is the smoothest
change d of the variables after which the linearised rows are within their bounds:

    minimise   the mean over time of sum_i (weights_i d qddot_i)^2    subject to    lower <= rows(x) + J d <= upper.

This step is repeated a few times. All of this takes hundredths of a second, whereas a solve takes tenths of a second,
or seconds.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener, ignore
from brachis.errors import UnreachableError
from brachis.optimise.backends import (
    FEASIBLE,
    SolverReport,
    SolveStatus,
    report_point,
    residual,
    solvers_for,
)
from brachis.optimise.improve import Solve, SolverSession
from brachis.optimise.mesh import coarsest
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.optimise.transcription import program_of
from brachis.search.least_motion import least_acceleration
from brachis.search.phase_plane import initial_guess
from brachis.search.stages import (
    Candidate,
    FinishedCandidate,
    InitialGuess,
    RankedCandidate,
    begin_candidate,
    fail,
    rank,
)
from brachis.search.verified import refine_and_verify

LITTLE_TIME = 5.0
"""A first motion is sought if less time than this remains, s. With more time, the search itself finds a verified
motion."""
_NOT_COMPLETED = "there was time only for a first motion, which may be much slower than the fastest motion"
_SOLVE_SHARE = 0.6
"""Fraction of the remaining time in which a first motion is improved by a solve."""
_LONGEST_SOLVE = 0.5
"""Maximum time of this solve, s. Within 0.4 s, motions at process speeds became 15 to 35 % faster."""
_NEARLY = 0.05
"""Maximum violation with which the last iterate of this solve is used."""
_ROOM = 1.03
"""Factor on the end time of this iterate; otherwise rows at their bounds would exceed them between collocation
points."""
_SLOWER = (1.1, 1.5, 2.5)
"""Factors on the end times of the first splines, tried one after the other: with 1 most rows are at their bounds."""
_CHANGES = 10
"""Maximum number of changes."""
_LEAST_SHARE = 0.02
"""Smallest fraction of a change that is tried; if no larger fraction helps, the rows are far from linear."""
_ROUNDS = 12
"""Maximum number of sets of rows that are tried for a change."""
_MARGIN = 1e-3
"""Distance from their bounds at which rows are held, so that few bounds are exceeded between the collocation points."""
_ENOUGH = 1e-10
"""Violation that counts as small enough; with 1e-8, the tool moved backwards on its path between knots close to each
other."""
_DAMPING = 1e-8
"""Fraction of the largest diagonal entry that is added to a diagonal: some joints have no weight, and rows may be
dependent."""


def find_first_motion_of(
    guesses: Sequence[InitialGuess], deadline: Deadline, listener: Listener
) -> FinishedCandidate | None:
    """Find a verified motion close to the joint path of one of the guesses; None if none is found in time."""
    for guess in sorted(guesses, key=lambda guess: guess.estimate):
        if deadline.passed:
            break
        outcome = find_first_motion(guess, deadline)
        listener(outcome.describe())
        if isinstance(outcome, FinishedCandidate) and outcome.is_settled:
            return outcome
    return None


def find_first_motion(guess: InitialGuess, deadline: Deadline) -> Candidate:
    """Find a verified motion close to the joint path of a guess, over few knots.

    Parameters
    ----------
    guess : InitialGuess
    deadline : Deadline

    Returns
    -------
    Candidate
        A `FinishedCandidate` if a motion was found.
    """
    outcome = begin_candidate(guess, "no motion was found near the joint path")
    try:
        program = program_of(guess.problem, guess.maps_by_leg())
        candidate = replace(rank(guess, program), not_completed=_NOT_COMPLETED)
        pairs = zip(coarsest(program).phases, guess.legs, strict=True)
        program = program.with_phases(
            phase.restrict_to(curves) for phase, curves in pairs
        )
        x = initial_guess(program, guess)
        if x is None:
            return outcome
    except UnreachableError as error:
        return fail(outcome, str(error))
    options = RefinementOptions.of(guess.problem.task.refinement, deadline)
    solve = partial(_find_nearest, deadline=deadline)
    for factor in _SLOWER:
        report = solve(program, program.scale_time(x, factor))
        if report.status.usable:
            outcome = refine_and_verify(candidate, program, (report,), solve, options)
        if isinstance(outcome, FinishedCandidate) and outcome.is_settled:
            return _improve(candidate, outcome, solve, options)
        if deadline.passed:
            break
    return outcome


def _improve(
    candidate: RankedCandidate,
    first: FinishedCandidate,
    solve: Solve,
    options: RefinementOptions,
) -> FinishedCandidate:
    """Solve for a short time from a first motion; use the feasible motion closest to the last iterate if it is faster.

    From such a motion, at which no limit is active, an interior-point method makes much progress in a dozen iterations.
    """
    name = candidate.problem.task.solver.name
    backends = [solver for solver in solvers_for(name) if solver.is_interior]
    for backend in backends[:1]:
        if options.deadline.passed:
            break
        program = first.refined.program
        session = SolverSession.for_task(
            backend,
            candidate.problem,
            candidate.guess.joint_map,
            options.deadline.part(_SOLVE_SHARE).within(_LONGEST_SOLVE),
            ignore,
        )
        report = session(program, first.refined.x)
        if report.violation < _NEARLY and _ROOM * report.objective < first.t_end:
            nearest = solve(program, program.scale_time(report.x, _ROOM))
            better = refine_and_verify(candidate, program, (nearest,), solve, options)
            is_better = better.is_settled and better.t_end < first.t_end
            if isinstance(better, FinishedCandidate) and is_better:
                return better
    return first


def _find_nearest(program: Program, x: np.ndarray, deadline: Deadline) -> SolverReport:
    """Find a point within the limits close to x, (v,); the status is `ACCEPTABLE` if it is feasible."""
    began = time.perf_counter()
    violation = residual(program, x)
    count = 0
    while _ENOUGH < violation < np.inf and count < _CHANGES and not deadline.passed:
        count += 1
        change = _smoothest_change(program, x)
        share = 1.0
        while share > _LEAST_SHARE:
            changed = np.clip(x + share * change, program.x_lower, program.x_upper)
            remaining = residual(program, changed)
            if remaining < violation:
                break
            share *= 0.5
        else:
            break
        x = changed
        violation = remaining
    is_feasible = violation <= FEASIBLE
    return report_point(
        "nearest motion",
        program,
        x,
        SolveStatus.ACCEPTABLE if is_feasible else SolveStatus.STALLED,
        "a motion within the limits near the joint path",
        time.perf_counter() - began,
        count,
    )


def _smoothest_change(program: Program, x: np.ndarray) -> np.ndarray:
    """Find the smoothest change of x, (v,), after which the linearised rows are within their bounds; see the module."""
    import scipy.sparse as sp

    values = program.rows(x)
    places = (program.jacobian_rows, program.jacobian_columns)
    entries = sp.coo_array((program.jacobian(x), places), (len(values), len(x)))
    is_free = program.x_lower < program.x_upper
    jacobian = (entries * is_free).tocsr()
    metric = _measure_smoothness(program, x)
    margin = np.minimum(_MARGIN, 0.25 * (program.upper - program.lower))
    low = program.lower + margin - values
    high = program.upper - margin - values
    is_equal = low == high
    change = np.zeros(len(x))
    held = is_equal
    for _ in range(_ROUNDS):
        beyond = jacobian @ change
        is_missed = (beyond < low - _ENOUGH) | (beyond > high + _ENOUGH)
        if not is_missed.any():
            break
        held = held | is_missed
        rows = np.flatnonzero(held)
        if len(rows) > len(x):
            break
        # Rows are held at the closer bound, or at the one that they exceed.
        at_low = beyond[rows] - low[rows] < high[rows] - beyond[rows]
        goals = np.where(at_low, low[rows], high[rows])
        slopes = jacobian[rows].toarray()
        moved = np.linalg.solve(metric, slopes.T)
        forces = np.linalg.solve(_damp(slopes @ moved), goals)
        change = moved @ forces
        # Rows that would otherwise be pulled towards their bound are released.
        is_pulled = np.where(at_low, forces < 0.0, forces > 0.0)
        held[rows[is_pulled & ~is_equal[rows]]] = False
    return change


def _measure_smoothness(program: Program, x: np.ndarray) -> np.ndarray:
    """Return the matrix that weighs changes of x: by joint accelerations, and for durations by the relative change."""
    smooth = program.with_objective(least_acceleration(program, x, 1.0))
    curvature = smooth.curvature(x)
    assert curvature is not None
    metric = curvature.hessian(x, 1.0, np.zeros(len(program.lower)))
    durations = program.first_variables
    metric[durations] = 0.0
    metric[:, durations] = 0.0
    metric[durations, durations] = np.diag(metric).mean() / x[durations] ** 2
    return _damp(metric)


def _damp(matrix: np.ndarray) -> np.ndarray:
    """Make a matrix, (m, m), regular by increasing its diagonal."""
    return matrix + _DAMPING * np.diag(matrix).max() * np.eye(len(matrix))
