"""The whole pipeline on one page: task -> robot -> path -> decomposition -> NLP -> solve and refine -> verify."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from brachis import ik
from brachis.errors import BrachisError, PlanningError, UnreachableError
from brachis.feasibility import check_start, explain_failure, start_branch
from brachis.kinematics import Decomposition, interpolate
from brachis.nlp import Transcription
from brachis.nlp.guess import guesses
from brachis.path import build_path
from brachis.refine import Refined, RefinementOptions, refine
from brachis.robot import Robot, TaskSpace
from brachis.robot.from_task import robot_from_settings
from brachis.solvers import Solver, SolverOptions, SolverReport, solver_named
from brachis.task import Task, load_task
from brachis.trajectory import Trajectory
from brachis.verify import Verification, VerifyOptions, verify

Listener = Callable[[str], None]
"""Told in plain words what the planner is doing, between iterations; may raise KeyboardInterrupt."""

_PATIENCE = 100
"""Iterations that ``auto`` grants a solver on one guess: an active-set method that needs more is grinding."""


@dataclass(frozen=True)
class Attempt:
    """One initial guess with one solver.

    Attributes
    ----------
    solver : str
    guess : int
        Number of the initial guess.
    reports : tuple of SolverReport
        Of the first solve and every refinement round.
    excess : float
        Largest excess over a limit on the dense grid, as a fraction.
    stretched : float
        Factor by which the end time was lengthened at the very end.
    collocation_points : int
    outcome : str
        In plain words.
    """

    solver: str
    guess: int
    reports: tuple[SolverReport, ...]
    excess: float
    stretched: float
    collocation_points: int
    outcome: str


@dataclass(frozen=True)
class Result:
    """What a plan gives: trajectory, verification, and how they came about.

    Attributes
    ----------
    task : Task
        All that was asked, defaults spelled out; ``plan(result.task)`` repeats the plan.
    trajectory : Trajectory
    verification : Verification
    family : str
        Family of the closed form.
    attempts : tuple of Attempt
        The last one gave the trajectory.
    timing : dict of str to float
        Wall time of every stage, s.
    """

    task: Task
    trajectory: Trajectory
    verification: Verification
    family: str
    attempts: tuple[Attempt, ...]
    timing: dict[str, float] = field(default_factory=dict)

    @property
    def t_end(self) -> float:
        """End time, s."""
        return self.trajectory.t_end

    @property
    def verified(self) -> bool:
        """True where every check of the verification passed."""
        return self.verification.passed

    @property
    def report(self) -> SolverReport:
        """The last solve's report."""
        return self.attempts[-1].reports[-1]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of the plan as plain data for JSON."""
        last = self.attempts[-1]
        return {
            "t_end": self.t_end,
            "redundant_joints": list(self.trajectory.redundant_joints),
            "branch": self.trajectory.branch,
            "family": self.family,
            "status": self.report.status.name.lower(),
            "advice": self.report.status.value,
            "solver": self.report.solver,
            "iterations": sum(report.iterations for report in last.reports),
            "refinement_rounds": len(last.reports) - 1,
            "collocation_points": last.collocation_points,
            "stretched": last.stretched,
            "attempts": [attempt.outcome for attempt in self.attempts],
            "wall_time_s": self.timing["total"],
            "timing_s": self.timing,
            "verified": self.verified,
            "worst_ratio": self.verification.worst_ratio,
            "path_error": self.verification.path_error,
            "joint_names": list(self.trajectory.joint_names),
        }


def plan(
    robot: str | os.PathLike[str] | Robot | None,
    task: str | os.PathLike[str] | Mapping[str, object] | Task,
    *,
    families: Sequence[ik.Family] = (),
    listener: Listener | None = None,
) -> Result:
    """Plan the minimum-time motion of a robot along a path.

    Parameters
    ----------
    robot : path, Robot or None
        URDF file; None takes the one that the task names. A `Robot` is used as it is, with its own limits.
    task : path, mapping or Task
        Task file, or its content.
    families : sequence of Family, optional
        Closed forms to try before the built-in ones.
    listener : callable, optional
        Told what happens.

    Returns
    -------
    Result
        ``result.verified`` says whether the trajectory passed the verification.

    Raises
    ------
    InputError
        The task, URDF, path or start posture is wrong (`TaskError`, `UrdfError`, `LimitError`, `PathError`, ...).
    PlanningError
        No attempt gave a motion within the limits.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(None, "examples/01_scara_line.yaml")
    >>> result.verified, round(result.t_end, 2)
    (True, 2.48)
    """
    clock = _Clock()
    task = load_task(task)
    robot = robot if isinstance(robot, Robot) else robot_from_settings(task.robot, urdf=robot)
    clock.stage("load")
    problem, family = transcribe(robot, task, families=families)
    clock.stage("transcribe")
    attempts, refined = _search(problem, task, listener or (lambda _text: None))
    clock.stage("solve")
    trajectory = _trajectory(problem.decomposition, refined, task)
    clock.stage("trajectory")
    verification = verify(trajectory, VerifyOptions(ratio_tolerance=task.refinement.tolerance))
    clock.stage("verify")
    return Result(task, trajectory, verification, family, attempts, clock.total())


def transcribe(robot: Robot, task: Task, *, families: Sequence[ik.Family] = ()) -> tuple[Transcription, str]:
    """Turn a task into an NLP that can be inspected and solved.

    Parameters
    ----------
    robot : Robot
    task : Task
    families : sequence of Family, optional
        Closed forms to try before the built-in ones.

    Returns
    -------
    problem : Transcription
    family : str
        Family of the closed form.

    Raises
    ------
    InputError
        See `plan`.
    """
    task_space = TaskSpace.of(robot, task.task_space)
    start = robot.posture(task.start.joints, "start.joints")
    end = None if task.end == "free" else robot.posture(task.end.joints, "end.joints")
    path = build_path(task.path, task_space.value(robot.tool_placement(start)), task_space.rows)
    candidate = ik.find(robot, task_space, task.redundant_joints, families=families)
    redundant = tuple(robot.joint_names.index(name) for name in candidate.redundant_joints)
    check_start(robot, start, end, path, task_space)
    branch = start_branch(robot, task_space, candidate, start, task.branch)
    decomposition = Decomposition(robot, task_space, path, candidate.solver, redundant, branch, start)
    spline = task.spline
    problem = Transcription(
        decomposition,
        degree=spline.degree,
        intervals=spline.intervals,
        derivatives_at_rest=2 if spline.rest == "full" else 1,
        tau=np.linspace(0.0, 1.0, spline.points_per_interval * spline.intervals + 1),
        end=end,
    )
    return problem, str(candidate.family)


def _search(problem: Transcription, task: Task, listener: Listener) -> tuple[tuple[Attempt, ...], Refined]:
    """Try guesses and solvers until one gives a motion within the limits everywhere."""
    settings = task.refinement
    options = RefinementOptions(settings.tolerance, settings.density, settings.max_rounds)
    attempts: list[Attempt] = []
    best: Refined | None = None
    for number, (x, solver) in enumerate(_pairs(problem, task)):
        refined = refine(problem, x, _solve_with(solver, task, listener), options)
        attempts.append(_attempt(refined, number, settings.tolerance))
        listener(attempts[-1].outcome)
        if refined.converged and refined.excess <= settings.tolerance:
            return tuple(attempts), refined
        if refined.converged and (best is None or refined.excess < best.excess):
            best = refined
    if best is not None and np.isfinite(best.excess):
        return tuple(attempts), best
    reason = explain_failure(problem.decomposition)
    if isinstance(reason, BrachisError):
        raise reason
    outcomes = "; ".join(attempt.outcome for attempt in attempts) or "no reachable initial guess"
    raise PlanningError(f"no motion within the limits was found: {outcomes}", hint=reason)


def _pairs(problem: Transcription, task: Task) -> Iterator[tuple[np.ndarray, Solver]]:
    """Guesses and solvers in the order of trying: all guesses with the first solver, then the next solver."""
    backends = solver_named(task.solver.name)
    known: list[np.ndarray] = []
    for x in guesses(problem):
        known.append(x)
        yield x, backends[0]
    for solver in backends[1:]:
        for x in known[:2]:
            yield x, solver


def _solve_with(solver: Solver, task: Task, listener: Listener) -> Callable[[Transcription, np.ndarray], SolverReport]:
    """A function that runs one backend under the task's bounds."""
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
    if not last.status.usable:
        outcome = f"{last.solver}: {last.status.value}" + (f" (refinement round {rounds})" if rounds else "")
    else:
        inside = "limits hold" if refined.excess <= tolerance else f"limits exceeded by {100.0 * refined.excess:.2g} %"
        outcome = f"{last.solver}: t_E = {refined.x[0]:.4f} s after {rounds} refinement rounds, {inside}"
    return Attempt(
        last.solver, number, refined.reports, refined.excess, refined.stretched, len(refined.problem.tau), outcome
    )


def _trajectory(decomposition: Decomposition, refined: Refined, task: Task) -> Trajectory:
    """Turn the answer into a trajectory that can be evaluated without the closed form."""
    motion = refined.problem.motion(refined.x)
    try:
        nodes = interpolate(decomposition, motion.at, motion.breaks)
    except UnreachableError as error:
        raise PlanningError("the motion found leaves the branch between collocation points") from error
    robot = decomposition.robot
    return Trajectory(
        task=task,
        urdf=robot.urdf,
        robot=robot,
        redundant_joints=tuple(robot.joint_names[i] for i in decomposition.redundant),
        branch=decomposition.solver.branches[decomposition.branch],
        times=nodes.times,
        q=nodes.q,
        qdot=nodes.qdot,
        qddot=nodes.qddot,
        knots=motion.knots,
        degree=motion.degree,
        control_points=motion.control_points,
    )


class _Clock:
    """Wall time of stages."""

    def __init__(self) -> None:
        self._began = self._last = time.perf_counter()
        self._stages: dict[str, float] = {}

    def stage(self, name: str) -> None:
        """End the current stage."""
        now = time.perf_counter()
        self._stages[name] = now - self._last
        self._last = now

    def total(self) -> dict[str, float]:
        """Return the stages and their total, s."""
        return {**self._stages, "total": time.perf_counter() - self._began}
