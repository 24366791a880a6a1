"""Plan a motion: the whole pipeline, step by step in the order in which it runs.

1. `plan` reads the task and the robot.
2. `_plan` builds the problem: path, limits, decompositions into redundant joints.
3. `find_fastest` finds joint paths, solves from them, and refines and verifies the most promising ones.
4. `find_least_motion` looks for the calmest motion that is as fast.

`transcribe` stops before the solve; `plan_many` plans many tasks in several processes.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Unpack

from threadpoolctl import ThreadpoolController

from brachis import ik
from brachis.common import interrupts
from brachis.common.arguments import check_callable, check_list, count
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener, report_progress
from brachis.errors import BrachisError, InputError, write_count
from brachis.optimise.backends import solver_named
from brachis.optimise.candidate import Candidate, InitialGuess
from brachis.optimise.layout import SHORTEST_TIME
from brachis.optimise.least_motion import find_least_motion
from brachis.optimise.program import Program
from brachis.optimise.transcription import breaks_of, program_of
from brachis.problem.plausibility import (
    check_within_reach,
    of_end_time,
    of_places,
    of_robot,
    of_task,
)
from brachis.problem.problem import Decomposition, Problem, decompositions_of
from brachis.result import Result
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel
from brachis.robot.from_task import robot_for, robot_from_settings
from brachis.robot.plausibility import report_issues
from brachis.robot.urdf import read_file
from brachis.robots import is_robot, locate
from brachis.search import (
    GIVEN,
    find_fastest,
    first_map,
    given_start,
    is_planned,
    try_remedies,
)
from brachis.search.processes import each, processes
from brachis.task import Source, Task, TaskKeywords, check_keywords, task_with
from brachis.trajectory import Motion, Trajectory, motion_of

Given = Source | Robot | None
"""A robot, or a task; both may be the name of a file."""
_OWN_KEYWORDS = (
    "start_from",
    "families",
    "own_limits",
    "listener",
    "progress",
    "check_advice",
)


def plan(
    robot_or_task: Given = None,
    /,
    task: Source | None = None,
    *,
    start_from: Motion | None = None,
    families: Sequence[ik.Family] = (),
    own_limits: Sequence[LimitModel] = (),
    listener: Listener | None = None,
    progress: bool | None = None,
    check_advice: bool = True,
    **keywords: Unpack[TaskKeywords],
) -> Result:
    """Plan the minimum-time motion of a robot along a path.

    ``plan(task)``, ``plan(robot, task)`` and ``plan(robot, path=..., start=..., task_space=...)`` say the same in
    different ways; keywords beside a task change it.

    Parameters
    ----------
    robot_or_task : path, Robot, mapping, Task or None
        A robot: a `Robot`, a URDF file, or the name of one that comes with brachis (`brachis.robots`). It takes the
        place of the one that the task names; what else the task's ``robot`` part sets (limits, gravity, frames, ...) is
        added to it. None: the task's own. Or, alone, a task as below.
    task : path, mapping or Task, optional
        Task file, or its content.
    start_from : Result, Trajectory or path, optional
        A motion, or its file, of this task or one like it (other limits, another path), to start from in place of the
        search. The optimum next to it is found, in a fraction of the time. Where the motion cannot be used, or leads to
        no verified plan, the search goes on as usual, and ``result.not_completed`` says so.
    families : sequence of Family, optional
        Closed forms to try before the built-in ones.
    own_limits : sequence of LimitModel, optional
        Limits of your own beside those of the task: objects whose ``bind(robot)`` returns a `brachis.limits.Limit`.
        They are not saved with the motion; those of installed packages are named in the task (``custom_limits``).
    listener : callable, optional
        Told what happens, in a line of text at a time; ``logging`` has it under the name ``brachis``, stages at level
        INFO and iterations at DEBUG.
    progress : bool, optional
        Whether to show on standard error, or below a notebook's cell, what happens. Left out: in notebooks, unless
        there is a listener.
    check_advice : bool, optional
        Where there is no plan: whether numbers that the error advises are first tried in plans, for up to 20 s. False:
        the error names what to change, but not how far.
    **keywords
        Keys of the task, without their sections: ``path``, ``start``, ``task_space``, ``limits``, ``intervals``,
        ``effort``, ...; all of them: `brachis.task.TaskKeywords`.

    Returns
    -------
    Result
        ``result.verified`` says whether the trajectory passed the verification.

    Raises
    ------
    InputError
        The task, URDF, path or start posture is wrong (`TaskError`, `UrdfError`, `LimitError`, `PathError`, ...); a
        `Robot` and the task's ``robot`` part contradict each other (`TaskError`); the start posture looks like
        degrees, or with ``strict=True`` another figure is implausible (`PlausibilityError`).
    PlanningError
        No attempt gave a motion within the limits.

    Warns
    -----
    PlausibilityWarning
        A figure is hardly meant.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan("examples/01_scara_line.yaml", redundant_joints=["j1"], effort="single")
    >>> result.verified, round(result.t_end, 2)
    (True, 2.26)
    >>> again = brachis.plan(result.task, limits={"torque": 12}, start_from=result)
    >>> again.t_end < result.t_end
    True
    """
    # Batches are small: a second BLAS thread costs up to twenty times what it gives where cores are busy.
    check_callable(listener, "listener")
    with (
        ThreadpoolController().limit(limits=1, user_api="blas"),
        report_progress(listener, progress) as tell,
    ):
        began = time.perf_counter()
        check_list(families, "families", "closed forms")
        robot, asked = _read(robot_or_task, task, keywords)
        known = None if start_from is None else motion_of(start_from, "start_from")
        loaded = time.perf_counter()
        deadline = Deadline.after(asked.search.time_limit - (loaded - began))

        def is_task_planned(
            changed: Task, limit: Deadline, most: int | None
        ) -> bool | None:
            return _is_planned(robot, asked, changed, families, own_limits, limit, most)

        try:
            return _plan(
                robot,
                asked,
                families,
                own_limits,
                known,
                tell,
                (began, loaded),
                deadline,
            )
        except BrachisError as error:
            until = deadline if check_advice else Deadline(0.0)
            try:
                try_remedies(error, asked, robot.joint_names, is_task_planned, until)
            except KeyboardInterrupt:
                interrupts.clear()
            raise


def _read(
    first: Given, task: Source | None, keywords: TaskKeywords
) -> tuple[Robot, Task]:
    """Return the robot, and the task with all that the robot was made with."""
    check_keywords(keywords, "plan", _OWN_KEYWORDS)
    if is_robot(keywords.get("robot")):
        allowed = (
            "a robot comes first, without a name: brachis.plan('scara3', path=...)"
        )
        found = (
            repr(keywords["robot"])
            if isinstance(keywords["robot"], str)
            else type(keywords["robot"]).__name__
        )
        raise InputError(
            "this is the section of a task, a mapping",
            where="robot",
            found=found,
            allowed=allowed,
        )
    # Everything else than a robot is a task.
    alone = task is None and first is not None and not is_robot(first)
    given, source = (None, first) if alone else (first, task)
    named = locate(given)  # type: ignore[arg-type]
    if isinstance(named, str | os.PathLike):
        read_file(Path(named))  # a missing file is the first thing to say
    asked = task_with(source, **keywords)  # type: ignore[arg-type]
    robot = robot_for(named, asked.robot)
    return robot, asked.model_copy(update={"robot": robot.settings})


def _plan(
    robot: Robot,
    task: Task,
    families: Sequence[ik.Family],
    own_limits: Sequence[LimitModel],
    known: Trajectory | None,
    listener: Listener,
    times: tuple[float, float],
    deadline: Deadline,
) -> Result:
    """Run the pipeline stage by stage; `times` are those when it began and when the task was read, s."""
    began, loaded = times
    remarks = of_robot(robot) + of_task(task)
    remarks = report_issues(remarks, strict=task.strict, stacklevel=4)
    joints = write_count(robot.n, "joint")
    segments = write_count(len(task.path), "segment")
    listener(
        f"planning for {joints} along a path of {segments}, task space {_space(task)}"
    )
    problem = Problem.of(robot, task, own_limits)
    places = of_places(
        problem.task_map, problem.path, problem.start, problem.end, task.path_start
    )
    remarks += report_issues(places, strict=task.strict, stacklevel=4)
    decompositions = decompositions_of(problem, families)
    check_within_reach(problem.task_map, problem.path)
    first = None if known is None else _first(problem, decompositions, known)
    warm = first if isinstance(first, InitialGuess) else None
    found = find_fastest(
        problem,
        decompositions,
        deadline,
        listener,
        warm,
    )
    best = found.best
    assert best is not None and best.start is not None
    assert best.trajectory is not None and best.verification is not None
    searched = time.perf_counter()
    over = Deadline(0.0) if found.interrupted else deadline
    if task.search.least_motion:
        listener("looking for the calmest motion that is as fast")
    least = (
        find_least_motion(best, over, listener) if task.search.least_motion else None
    )
    calmed = time.perf_counter()
    end_time = of_end_time(best.t_end, SHORTEST_TIME)
    remarks += report_issues(end_time, strict=task.strict, stacklevel=4)
    total = time.perf_counter() - began
    listener(f"planned: t_E = {best.t_end:.4f} s, {best.status}, after {total:.2f} s")
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
            "total": total,
        },
        candidates=found.in_order(),
        interrupted=found.interrupted,
        not_completed=(*_not_used(first, best), *found.not_completed()),
        warnings=remarks,
    )


def _space(task: Task) -> str:
    return (
        task.task_space
        if isinstance(task.task_space, str)
        else f"[{', '.join(task.task_space)}]"
    )


def _first(
    problem: Problem, decompositions: Sequence[Decomposition], known: Trajectory
) -> InitialGuess | str:
    """Make a start of a known motion, for the solver that is tried first; or say why there is none."""
    curved = any(limit.guarantee.is_mean for limit in problem.limits)
    solver = solver_named(problem.task.solver.name, curved=curved)[0]
    start = given_start(problem, decompositions, known)
    return start if isinstance(start, str) else start.with_solver(solver.name)


def _not_used(first: InitialGuess | str | None, best: Candidate) -> tuple[str, ...]:
    """Say where the plan was to start from a known motion and does not."""
    if first is None or best.origin == GIVEN:
        return ()
    reason = first if isinstance(first, str) else "it led to no verified plan"
    return (
        f"the plan does not start from the given motion: {reason}; it was searched for as usual",
    )


def _is_planned(
    robot: Robot,
    task: Task,
    changed: Task,
    families: Sequence[ik.Family],
    own_limits: Sequence[LimitModel],
    deadline: Deadline,
    most: int | None,
) -> bool | None:
    """Tell whether a plan of a task that was changed is verified; see `brachis.search.is_planned`."""
    changed = task_with(changed, effort="single") if most else changed
    same = changed.robot == task.robot
    problem = Problem.of(
        robot if same else robot_from_settings(changed.robot, urdf_text=robot.urdf),
        changed,
        own_limits,
    )
    return is_planned(
        problem,
        decompositions_of(problem, families),
        deadline,
        most,
    )


def transcribe(
    robot_or_task: Given = None,
    /,
    task: Source | None = None,
    *,
    families: Sequence[ik.Family] = (),
    own_limits: Sequence[LimitModel] = (),
    **keywords: Unpack[TaskKeywords],
) -> tuple[Program, str]:
    """Turn a task into an NLP that can be inspected and solved.

    Parameters
    ----------
    robot_or_task, task, families, own_limits, **keywords
        As for `plan`.

    Returns
    -------
    program : Program
        Over as many equal knot intervals as the task says; with ``intervals: auto`` over the 10 of the first mesh,
        which `plan` refines.
    family : str
        Family of the closed form.

    Raises
    ------
    InputError
        See `plan`.

    Examples
    --------
    >>> import brachis
    >>> program, family = brachis.transcribe(brachis.examples.scara_line, redundant_joints=["j1"])
    >>> program.variables, family
    (36, 'planar')
    """
    robot, asked = _read(robot_or_task, task, keywords)
    problem = Problem.of(robot, asked, own_limits)
    joint_map, family = first_map(problem, decompositions_of(problem, families))
    return program_of(problem, joint_map, breaks_of(problem.task)), family


Outcome = Result | BrachisError
OnProgress = Callable[[int, int, Outcome], None]
"""Told after every plan: how many are done, of how many, and what came out."""


def plan_many(
    tasks: Iterable[Source | tuple[Given, Source]],
    *,
    jobs: int = 1,
    progress: bool | OnProgress | None = None,
    **keywords: Unpack[TaskKeywords],
) -> list[Outcome]:
    """Plan many tasks, in several processes; a plan that fails is an error in the list and stops no other.

    Parameters
    ----------
    tasks : iterable of path, mapping, Task, or pair of robot and task
        Each as `plan` takes it.
    jobs : int, optional
        Processes; no more than there are processors are used.
    progress : bool or callable, optional
        True: how many are done, as `plan` shows its progress; left out: in notebooks. A function: called after every
        plan, in the order of the tasks, with the number of those done, the number of all, and the outcome.
    **keywords
        Keys of all the tasks, as for `plan`.

    Returns
    -------
    list of Result or BrachisError
        In the order of the tasks. An error is what `plan` would have raised with ``check_advice=False``.

    Raises
    ------
    InputError
        One task is given in place of several, `jobs` is no number of processes, or there is no such keyword.
    KeyboardInterrupt
        Ctrl-C ends all.

    Examples
    --------
    >>> import brachis
    >>> tasks = [
    ...     {
    ...         "brachis": 1,
    ...         "robot": {"urdf": brachis.robots.path_of("scara3"), "tool_frame": "tool"},
    ...         "start": {"joints": [0.5236, -2.0944, 2.0944]},
    ...         "task_space": ["x", "y"],
    ...         "path": brachis.Line(by=[0.0, length]),
    ...     }
    ...     for length in (0.1, 9.0)
    ... ]
    >>> outcomes = brachis.plan_many(tasks, redundant_joints=["j1"], intervals=8, effort="single")
    >>> [type(outcome).__name__ for outcome in outcomes]
    ['Result', 'PathError']
    """
    if isinstance(tasks, str | os.PathLike | Mapping):
        raise InputError(
            "is one task",
            where="tasks",
            found=type(tasks).__name__,
            allowed="a list of tasks",
        )
    if not isinstance(tasks, Iterable):
        raise InputError(
            "wrong type", where="tasks", found=repr(tasks), allowed="a list of tasks"
        )
    check_keywords(keywords, "plan_many", ("jobs", "progress"))
    given = list(tasks)
    jobs = processes(count(jobs, "jobs"))
    outcomes: list[Outcome] = []
    work = _outcome, given, keywords
    if callable(progress):
        heard = progress
        progress = False
    else:
        heard = None
    with (
        report_progress(None, progress) as tell,
        closing(each(*work, jobs=jobs, listener=_deaf)) as made,
    ):
        for outcome in made:
            outcomes.append(outcome)
            tell(f"planned {len(outcomes)} of {write_count(len(given), 'task')}")
            if heard is not None:
                heard(len(outcomes), len(given), outcome)
    return outcomes


def _deaf(_text: str) -> None:
    """Listen to nothing."""


def _outcome(
    given: Any, keywords: TaskKeywords, listener: Callable[[str], None]
) -> Outcome:
    """Plan one task."""
    robot, task = given if isinstance(given, tuple) else (None, given)
    try:
        return plan(
            robot,
            task,
            listener=listener,
            progress=False,
            check_advice=False,
            **keywords,
        )
    except BrachisError as error:
        return error
