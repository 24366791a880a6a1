"""The whole pipeline on one page.

task -> robot -> path, limits -> decompositions -> joint paths (search) -> `solved` at the first collocation points
-> `finished`: mesh, refinement, trajectory, verification -> the calmest motion that is as fast -> result.

The search decides what is solved and finished, and in which order; the two functions say how.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Mapping, Sequence

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis import ik, plausibility
from brachis.attempt import Attempt, Start
from brachis.completion import completed
from brachis.custom_limits import LimitModel
from brachis.deadline import Deadline
from brachis.least_motion import calmest
from brachis.mesh import adapt_mesh, coarsest
from brachis.nlp import Program
from brachis.nlp.layout import SHORTEST_TIME
from brachis.problem import Problem, breaks_of, decompositions_of, phase_in, program_of
from brachis.refine import RefinementOptions, Solve
from brachis.result import Result
from brachis.robot import Robot
from brachis.robot.combine import robot_for
from brachis.search import (
    MARGINS,
    Listener,
    Stages,
    best_of_joints,
    continued,
    eased,
    find_fastest,
    first_breaks,
    first_map,
    first_point,
    solve_with,
    solved_in_chart,
)
from brachis.solvers import SolveStatus, solver_named
from brachis.task import Task, load_task

_MANY_VARIABLES = 150
"""Above this a cold solve takes seconds, and the program is first solved over some of its knots."""
_KNOT_TIME = 0.4
"""Part of the remaining time that may go into the knots."""


def plan(
    robot: str | os.PathLike[str] | Robot | None,
    task: str | os.PathLike[str] | Mapping[str, object] | Task,
    *,
    families: Sequence[ik.Family] = (),
    limits: Sequence[LimitModel] = (),
    listener: Listener | None = None,
    strict: bool = False,
) -> Result:
    """Plan the minimum-time motion of a robot along a path.

    Parameters
    ----------
    robot : path, Robot or None
        URDF file, in place of the one that the task names; None takes that one. A `Robot` stands for its URDF and what
        it was made with; what else the task's ``robot`` part sets (limits, gravity, frames, ...) is added to it.
    task : path, mapping or Task
        Task file, or its content.
    families : sequence of Family, optional
        Closed forms to try before the built-in ones.
    limits : sequence of LimitModel, optional
        Limits of your own beside those of the task: objects whose ``bind(robot)`` returns a `brachis.limits.Limit`.
        They are not saved with the motion; those of installed packages are named in the task (``custom_limits``).
    listener : callable, optional
        Told what happens.
    strict : bool, optional
        Whether figures that are hardly meant (degrees for rad, mm for m) are errors, not warnings.

    Returns
    -------
    Result
        ``result.verified`` says whether the trajectory passed the verification.

    Raises
    ------
    InputError
        The task, URDF, path or start posture is wrong (`TaskError`, `UrdfError`, `LimitError`, `PathError`, ...); a
        `Robot` and the task's ``robot`` part contradict each other (`TaskError`); figures are hardly meant and `strict`
        (`PlausibilityError`).
    PlanningError
        No attempt gave a motion within the limits.

    Warns
    -----
    PlausibilityWarning
        A figure is hardly meant.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(None, "examples/01_scara_line.yaml")
    >>> result.verified, round(result.t_end, 2)
    (True, 2.48)
    """
    # Batches are small: a second BLAS thread costs up to twenty times what it gives where cores are busy.
    with ThreadpoolController().limit(limits=1, user_api="blas"):
        return _plan(robot, load_task(task), families, limits, listener or (lambda _text: None), strict=strict)


def _plan(
    robot: str | os.PathLike[str] | Robot | None,
    task: Task,
    families: Sequence[ik.Family],
    limits: Sequence[LimitModel],
    listener: Listener,
    *,
    strict: bool,
) -> Result:
    """Run the pipeline stage by stage."""
    began = time.perf_counter()
    robot = robot_for(robot, task.robot)
    task = task.model_copy(update={"robot": robot.settings})
    loaded, deadline = time.perf_counter(), Deadline.after(task.search.time_limit)
    remarks = plausibility.of_robot(robot) + plausibility.of_points(task)
    remarks = plausibility.tell(remarks, strict=strict, stacklevel=4)
    problem = Problem.of(robot, task, limits)
    places = plausibility.of_places(problem.task_map, problem.start, problem.end, task.path_start)
    remarks += plausibility.tell(places, strict=strict, stacklevel=4)
    found = find_fastest(problem, decompositions_of(problem, families), Stages(solved, finished), deadline, listener)
    best = found.best
    assert best is not None and best.start is not None  # noqa: PT018, S101  (else nothing would have come back)
    assert best.trajectory is not None and best.verification is not None  # noqa: PT018, S101
    searched = time.perf_counter()
    over = Deadline(0.0) if found.interrupted else deadline
    least = calmest(best, over, listener) if task.search.least_motion else None
    calmed = time.perf_counter()
    end_time = plausibility.of_end_time(best.t_end, SHORTEST_TIME)
    remarks += plausibility.tell(end_time, strict=strict, stacklevel=4)
    return Result(
        task=problem.task,
        trajectory=best.trajectory if least is None else least.trajectory,
        verification=best.verification if least is None else least.verification,
        family=best.start.family,
        attempt=best.without_programs(),
        least_motion=least,
        timing={
            "load": loaded - began,
            "search": searched - loaded,
            "least_motion": calmed - searched,
            "total": time.perf_counter() - began,
        },
        candidates=found.in_order(),
        interrupted=found.interrupted,
        undone=found.undone(),
        warnings=remarks,
    )


def solved(start: Start, deadline: Deadline, listener: Listener) -> Attempt:
    """Solve from a start, at the first collocation points.

    Parameters
    ----------
    start : Start
    deadline : Deadline
    listener : callable

    Returns
    -------
    Attempt
    """
    problem = start.problem
    target = program_of(problem, start.joint_map, first_breaks(start))
    program = coarsest(target) if target.variables > _MANY_VARIABLES else target
    x = first_point(program, start)
    if x is None:
        return Attempt.of(start, "the splines through the joint path leave the branch, or the chart")
    solve = _solver(start, deadline, listener)
    try:
        x, before = eased(program, x, solve, MARGINS[0])
        if start.in_chart:
            program, reports = solved_in_chart(problem, program, x, solve)
            joint_map = program.phases[0].joint_map
            target = target.with_phases(phase_in(problem, joint_map, phase.grid) for phase in target.phases)
        else:
            program, reports = continued(program, x, solve, MARGINS)
    except ImportError as error:
        return Attempt.of(start, f"{start.solver}: not installed ({error})")
    reports, last = (*before, *reports), reports[-1]
    coarse = last.objective if last.status.usable else np.inf
    return Attempt.of(start, _in_words(last.status), program=program, target=target, reports=reports, coarse=coarse)


def finished(attempt: Attempt, deadline: Deadline, listener: Listener) -> Attempt:
    """Adapt the mesh, refine and verify; only verify where the time is up.

    Parameters
    ----------
    attempt : Attempt
        A usable one.
    deadline : Deadline
    listener : callable

    Returns
    -------
    Attempt
    """
    start, program = attempt.start, attempt.program
    assert start is not None and program is not None  # noqa: PT018, S101  (it is usable)
    task = start.problem.task
    settings, soon = task.refinement, deadline.part(_KNOT_TIME)
    options = RefinementOptions(settings.tolerance, settings.density, settings.max_rounds, soon)
    solve = _solver(start, soon, listener)
    reports, target = attempt.reports, attempt.target
    if attempt.keeps_knots and start.in_chart and not deadline.passed:
        program, further = best_of_joints(start.problem, program, reports[-1], solve)
        reports, target = (*reports[:-1], *further), program
    adapted = adapt_mesh(program, reports, solve, task.spline, options, target=target)
    attempt = dataclasses.replace(attempt, undone=adapted.undone)
    options, solve = dataclasses.replace(options, deadline=deadline), _solver(start, deadline, listener)
    return completed(attempt, adapted.program, adapted.reports, solve, options)


def _in_words(status: SolveStatus) -> str:
    name = status.name.lower().replace("_", " ")
    if not status.usable:
        return name
    return "planned" if status is SolveStatus.OPTIMAL else f"planned, {name}"


def _solver(start: Start, deadline: Deadline, listener: Listener) -> Solve:
    """Make a function that solves with the start's solver."""
    (solver,) = solver_named(start.solver)
    return solve_with(solver, start.problem.task.solver, start.joint_map, deadline, listener)


def transcribe(
    robot: Robot, task: Task, *, families: Sequence[ik.Family] = (), limits: Sequence[LimitModel] = ()
) -> tuple[Program, str]:
    """Turn a task into an NLP that can be inspected and solved.

    Parameters
    ----------
    robot : Robot
        As for `plan`.
    task : Task
    families : sequence of Family, optional
        Closed forms to try before the built-in ones.
    limits : sequence of LimitModel, optional
        As for `plan`.

    Returns
    -------
    program : Program
    family : str
        Family of the closed form.

    Raises
    ------
    InputError
        See `plan`.
    """
    problem = Problem.of(robot_for(robot, task.robot), task, limits)
    joint_map, family = first_map(problem, decompositions_of(problem, families))
    return program_of(problem, joint_map, breaks_of(task)), family
