"""The smoothest motion among those that are as fast as the fastest one.

Where the shortest end time leaves freedom (a tool that may roll, joints far from their limits), many motions are
time-optimal, and the solver may return one that swings light joints to and fro. A second solve from this motion, over
the same knots and within the same limits,

    minimises   the mean of sum_i (weights_i qddot_i)^2    subject to    t_E <= (1 + slower) t_E of the fastest

The new motion is refined and verified like the first one. It is used if it is verified and smoother; otherwise the
fastest motion is kept. In both cases, bottlenecks are found from the multipliers of the fastest motion.

If a speed is given, `refine_smoothest` makes this solve before refinement: the fastest motion itself is not refined.
Before splines are laid along the timings of a program's many parts, `smoothen` makes it, because splines have too many
variables.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brachis.common import tolerances
from brachis.common.deadline import Deadline
from brachis.common.progress import Iteration, Listener, ignore
from brachis.common.summary import Summary
from brachis.errors import UnreachableError
from brachis.limits.joint import reciprocals_near
from brachis.optimise.backends import (
    FEASIBLE,
    Solver,
    SolverOptions,
    SolverReport,
    SolveStatus,
    interior_solver,
    solvers_for,
)
from brachis.optimise.improve import Solve, SolvedProgram, SolverSession
from brachis.optimise.objective import EndTime, LeastAcceleration
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.search.stages import FinishedCandidate, RankedCandidate
from brachis.search.verified import refine_and_verify
from brachis.task import Task
from brachis.trajectory import Trajectory
from brachis.verify import Verification

_KEPT_BACK = 0.1 * tolerances.END_TIME
"""Fraction of the end time by which refinement may still lengthen the motion."""
_WORTH_IT = 0.05
"""A motion replaces the fastest one if its accelerations are lower by at least this fraction."""
_LEAST = 1e-6
"""Value of the objective, relative to that of the first motion, below which no motion is much smoother."""
_MUCH_SMOOTHER = 0.5
"""Value of the objective, relative to that of the first motion, below which a solve is repeated from its solution."""
_MANY = 300
"""Number of variables above which an iteration of an active-set method takes tenths of a second, or seconds. A
smoother motion is then sought only if it may be slower, or if a speed is given, by an interior-point method. With 277
variables, 5 to 12 iterations took 1.5 to 2.2 s."""
_OPTIONS = SolverOptions(
    tolerance=1e-6,
    max_iterations=60,
    time_limit=np.inf,
    progress=1e-2,  # an approximate optimum is enough
    patience=5,
    anywhere=True,
    acceptable=FEASIBLE,
)
"""Options that bound the effort of a solve."""
_OF_INTERIOR = replace(_OPTIONS, max_iterations=20, first_step=0.01, damping=1.0)
"""For an interior-point method. After 20 iterations, accelerations were at most 10 % above those after 60. With a
damping of 0.1, limits were still exceeded after 60. With 10, accelerations were up to half as high again."""


@dataclass(frozen=True, eq=False, repr=False)
class LeastMotion(Summary):
    """Outcome of the search for the smoothest motion.

    Attributes
    ----------
    trajectory : Trajectory
        The smoothest motion, or the fastest one if that is kept.
    verification : Verification
        Verification of the trajectory.
    reduction : float
        Fraction by which the root mean square of the joint accelerations is lower; 0 if the fastest motion is kept.
    later : float
        Fraction by which the end time is later than the end time of the fastest motion.
    status : str
        Outcome in plain words.
    reports : tuple of SolverReport
        Reports of all solves.
    """

    trajectory: Trajectory
    verification: Verification
    reduction: float
    later: float
    status: str
    reports: tuple[SolverReport, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "status": self.status,
            "acceleration_reduction": self.reduction,
            "later": self.later,
            "iterations": sum(report.iterations for report in self.reports),
        }


def find_least_motion(
    fastest: FinishedCandidate, deadline: Deadline, listener: Listener
) -> LeastMotion:
    """Find the smoothest motion that is as fast as a candidate, or slower by no more than the task allows.

    Parameters
    ----------
    fastest : FinishedCandidate
    deadline : Deadline
    listener : callable

    Returns
    -------
    LeastMotion
    """
    try:
        return _solve(fastest, deadline, listener)
    except UnreachableError as error:
        return keep_fastest(fastest, f"the fastest motion is kept: {error}")


def _solve(
    fastest: FinishedCandidate, deadline: Deadline, listener: Listener
) -> LeastMotion:
    """Solve, refine and verify; use the new motion if it is verified and smoother by a worthwhile fraction."""
    before = fastest.refined
    task = fastest.problem.task
    count = len(before.x)
    status = ""
    if not fastest.verified:
        status = "the fastest motion is not verified"
    elif deadline.passed:
        status = "no time was left"
    elif fastest.is_smoothed and (fastest.problem.is_chain or not task.search.slower):
        status = "the motion was smoothed while it was planned"
    elif count > _MANY and not task.search.slower:
        status = f"the fastest motion is kept: {count} variables are too many to look for a smoother one"
    if status:
        return keep_fastest(fastest, status)
    soon = deadline.part(0.5)
    slower = max(task.search.slower, tolerances.END_TIME)
    solve, program, first = _solve_for_smoothest(task, before, slower, soon, listener)
    if not first.status.usable:
        status = f"the fastest motion is kept: {_reason(first)}"
        return keep_fastest(fastest, status, (first,))
    too_similar = (
        "the fastest motion is kept: no other motion is smoother by 5 % or more"
    )
    if 1.0 - np.sqrt(first.objective) < _WORTH_IT:
        return keep_fastest(fastest, too_similar, (first,))
    latest = before.t_end * (1.0 + slower)
    options = RefinementOptions.of(task.refinement, soon, latest)
    calmer = refine_and_verify(fastest, program, (first,), solve, options)
    if not (isinstance(calmer, FinishedCandidate) and calmer.verified):
        status = "the fastest motion is kept: a smoother one was not verified"
        return keep_fastest(fastest, status, calmer.reports)
    reduction = float(1.0 - np.sqrt(program.objective(calmer.refined.x)))
    if reduction < _WORTH_IT:
        return keep_fastest(fastest, too_similar, calmer.reports)
    later = calmer.t_end / fastest.t_end - 1.0
    status = f"joint accelerations (rms) {100.0 * reduction:.2g} % lower at {100.0 * later:+.2g} % end time"
    return LeastMotion(
        calmer.trajectory, calmer.verification, reduction, later, status, calmer.reports
    )


def refine_smoothest(
    candidate: RankedCandidate, fastest: SolvedProgram, deadline: Deadline
) -> FinishedCandidate | None:
    """Refine and verify the smoothest motion that is as fast as a solution over all knots, which is not refined itself.

    If the time is given, joints swing between the collocation points of a solution, and each refinement round moves
    these swings. A smooth motion needs few rounds.

    Parameters
    ----------
    candidate : RankedCandidate
    fastest : SolvedProgram
    deadline : Deadline

    Returns
    -------
    FinishedCandidate or None
        The motion, whose optimum is the fastest one. None if no such motion is verified.
    """
    task = candidate.problem.task
    soon = deadline.part(0.5)
    slower = tolerances.END_TIME
    latest = fastest.t_end * (1.0 + slower)
    options = RefinementOptions.of(task.refinement, soon, latest)
    with contextlib.suppress(UnreachableError):
        solve, program, first = _solve_for_smoothest(
            task, fastest, slower, soon, ignore
        )
        if not first.status.usable:
            return None
        reports = (*fastest.reports, first)
        smoothest = refine_and_verify(candidate, program, reports, solve, options)
        if isinstance(smoothest, FinishedCandidate) and smoothest.is_settled:
            with_end_time = smoothest.refined.program.with_objective(EndTime())
            refined = replace(smoothest.refined, program=with_end_time)
            return replace(
                smoothest, refined=refined, optimum=fastest, is_smoothed=True
            )
    return None


def smoothen(
    task: Task, fastest: SolvedProgram, deadline: Deadline
) -> np.ndarray | None:
    """Return a much smoother motion, (v,), that is as fast as a solution of a large program; None if none is known."""
    slower = task.spline.tolerance
    _, _, report = _solve_once(task, fastest, slower, deadline.part(0.3), ignore)
    return report.x if report.status.usable else None


def _solve_for_smoothest(
    task: Task,
    fastest: SolvedProgram,
    slower: float,
    deadline: Deadline,
    listener: Listener,
) -> tuple[Solve, Program, SolverReport]:
    """Solve for the smoothest motion as `_solve_once` does, again and again while this gains much.

    The function that is returned solves in refinement rounds.
    """
    slower -= _KEPT_BACK
    solve, program, report = _solve_once(task, fastest, slower, deadline, listener)
    objective = program.minimised
    assert isinstance(objective, LeastAcceleration)
    # The solver ends when it gains little of the first value, at which a motion that swings is far from the smoothest.
    while report.status.usable and _LEAST < report.objective < _MUCH_SMOOTHER:
        weights = objective.weights / np.sqrt(report.objective)
        scaled = program.with_objective(replace(objective, weights=weights))
        again = solve(scaled, report.x)
        if not again.status.usable or again.objective > _MUCH_SMOOTHER:
            break
        report = replace(again, objective=program.objective(again.x))
    # Refinement rounds begin close to their solution, so they may end sooner.
    return replace(solve, options=replace(solve.options, patience=2)), program, report


def _solve_once(
    task: Task,
    fastest: SolvedProgram,
    slower: float,
    deadline: Deadline,
    listener: Listener,
) -> tuple[SolverSession, Program, SolverReport]:
    """Solve once for the smoothest motion that is as fast, or slower by a fraction of up to `slower`.

    Returns
    -------
    solve : SolverSession
    program : Program
    report : SolverReport
    """
    objective = least_acceleration(fastest.program, fastest.x, slower)
    program = fastest.program.with_objective(objective)
    name = task.solver.name
    interior = interior_solver(name) if program.variables > _MANY else None
    solve = _session(interior or solvers_for(name)[0], deadline, listener)
    report = solve(program, program.scale_time(fastest.x, 1.0 + slower))
    return solve, program, report


def _reason(report: SolverReport) -> str:
    """Say why a solve found no smoother motion; the advice in the solver's status does not apply here."""
    if report.status is SolveStatus.TIME_LIMIT:
        return "time ran out before a smoother one was found"
    if report.status in (SolveStatus.EVALUATION_ERROR, SolveStatus.FAILED):
        return report.status.value
    return f"{report.iterations} iterations found no smoother one within the limits"


def keep_fastest(
    fastest: FinishedCandidate, status: str, reports: tuple[SolverReport, ...] = ()
) -> LeastMotion:
    """Keep the fastest motion."""
    return LeastMotion(
        fastest.trajectory, fastest.verification, 0.0, 0.0, status, reports
    )


def least_acceleration(
    program: Program, x: np.ndarray, slower: float
) -> LeastAcceleration:
    """Return the objective that is 1 at x, (v,), and lets phases last longer by a fraction of up to `slower`.

    Every joint's acceleration is measured relative to the joint's largest velocity. This is the velocity limit or, if
    there is none, the largest velocity at x of all joints with the same unit and without such a limit. Joints without
    any limit, such as the virtual roll of a tool, do not count.
    """
    # Phases with more joints have virtual ones, which do not count.
    least, phase = min(
        enumerate(program.phases), key=lambda pair: pair[1].joint_map.robot.n
    )
    robot = phase.joint_map.robot
    states = program.states(x)
    postures = states[least].q
    by_acceleration, weights = reciprocals_near(
        robot, phase.limits, postures[len(postures) // 2]
    )
    velocities = np.concatenate([state.qdot[:, : robot.n] for state in states])
    speeds = np.abs(velocities).max(axis=0)
    units = np.array(robot.position_units)
    for unit in set(robot.position_units):
        unlimited = (units == unit) & (weights == 0.0) & (by_acceleration > 0.0)
        if speeds[unlimited].any():
            weights[unlimited] = 1.0 / speeds[unlimited].max()
    longest = np.array([x_of_phase[0] for _, x_of_phase in program.split(x)]) * (
        1.0 + slower
    )
    objective = LeastAcceleration(weights, longest)
    size = program.with_objective(objective).objective(x)
    return replace(objective, weights=weights / np.sqrt(size or 1.0))


def _session(backend: Solver, deadline: Deadline, listener: Listener) -> SolverSession:
    """Open a session of a solver; any feasible motion is accepted, however the solve ended."""

    def progress(iteration: int, objective: float) -> None:
        rms = 100.0 * objective**0.5
        text = f"least motion: iteration {iteration}, joint accelerations (rms) {rms:.1f} %"
        listener(Iteration(text))

    options = _OF_INTERIOR if backend.is_interior else _OPTIONS
    return SolverSession(backend, options, deadline, progress)
