"""Functions that plan motions; the body of `plan` lists the steps in the order in which they run.

`transcribe` stops before the solve; `plan_many` plans many tasks in several processes.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, Unpack

from brachis import ik
from brachis.common import interrupts
from brachis.common.arguments import check_executor, check_listener, count
from brachis.common.deadline import Deadline
from brachis.common.interrupts import SigintHandler
from brachis.common.progress import Listener, ignore, report_progress
from brachis.common.threads import use_one_thread
from brachis.common.words import write_count
from brachis.errors import BrachisError, InputError, TaskError
from brachis.optimise.layout import SHORTEST_TIME
from brachis.problem.feasibility import check_regular
from brachis.problem.plausibility import (
    check_within_reach,
    of_end_time,
    of_places,
    of_robot,
)
from brachis.problem.problem import Decompositions, Problem, decompositions_of
from brachis.problem.program import bind_task
from brachis.problem.task_plausibility import of_task
from brachis.result import Result
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel
from brachis.robot.from_task import robot_for
from brachis.robot.plausibility import report_issues
from brachis.robot.urdf import read_file
from brachis.robots import is_robot, locate
from brachis.search import Search, TaskProgram, first_guess, try_remedies
from brachis.search.fewer_joints import search_motion
from brachis.search.given_motion import widen_plan
from brachis.search.least_motion import (
    LeastMotion,
    find_least_motion,
    keep_fastest,
)
from brachis.search.processes import process_count, run_in_processes
from brachis.search.schedule import has_charts
from brachis.search.stages import FinishedCandidate
from brachis.task import (
    Source,
    Task,
    TaskKeywords,
    check_keywords,
    part_names,
    task_with,
)
from brachis.timing import SlowTimingWarning, find_timing_gap
from brachis.trajectory import MotionSource, motion_of
from brachis.trajectory.program import check_times

RobotOrTask = Source | Robot | None
"""A robot or a task; either may be given as a file name."""
_OWN_KEYWORDS = (
    "start_from",
    "families",
    "own_limits",
    "listener",
    "progress",
    "check_advice",
)


def plan(
    robot_or_task: RobotOrTask = None,
    /,
    task: Source | None = None,
    *,
    start_from: MotionSource | None = None,
    families: Sequence[ik.Family] = (),
    own_limits: Sequence[LimitModel] = (),
    listener: Listener | None = None,
    progress: bool | None = None,
    check_advice: bool = True,
    **keywords: Unpack[TaskKeywords],
) -> Result:
    """Plan the minimum-time motion of a robot along a path.

    ``plan(task)``, ``plan(robot, task)`` and ``plan(robot, path=..., start=..., task_space=...)`` are three ways to
    state the same problem. Keywords given with a task change that task.

    Parameters
    ----------
    robot_or_task : path, Robot, mapping, Task or None
        A robot: a `Robot`, a URDF file, or the name of an included robot (`brachis.robots`). It replaces the robot that
        the task names; all other settings in the task's ``robot`` section (limits, gravity, frames, ...) still apply.
        If None, the task's own robot is used. If it is the only argument, it may also be a task, as described below.
    task : path, mapping or Task, optional
        Task file, or its content.
    start_from : Result, Trajectory or path, optional
        A known motion, or its file, from which the plan starts instead of a search. It may belong to this task or to a
        similar one (with different limits or a different path). The planner finds the optimum closest to this motion,
        in a fraction of the usual time. If the motion cannot be used, or leads to no verified plan, the search
        continues as usual, and ``result.not_completed`` says so.
    families : sequence of Family, optional
        Families of closed-form inverse kinematics to try before the built-in ones.
    own_limits : sequence of LimitModel, optional
        Limits of your own in addition to those of the task: objects whose ``bind(robot)`` returns a
        `brachis.limits.Limit`. They are not saved with the motion. Limits from installed packages are named in the task
        instead (``custom_limits``).
    listener : callable, optional
        Called with one line of text for each step of the work. The same lines go to the ``logging`` module under the
        name ``brachis``, stages at level INFO and iterations at DEBUG.
    progress : bool, optional
        Whether to show the progress on standard error, or below the cell in a notebook. By default it is shown only in
        notebooks, and only if there is no listener.
    check_advice : bool, optional
        If no plan is found, whether to test the values suggested by the error in further planning runs, for up to 20 s.
        If False, the error names what to change, but not by how much.
    **keywords
        Keys of the task, without the names of their sections: ``path``, ``start``, ``task_space``, ``limits``,
        ``intervals``, ``effort``, ... `brachis.task.TaskKeywords` lists them all.

    Returns
    -------
    Result
        ``result.verified`` says whether the trajectory passed the verification.

    Raises
    ------
    InputError
        The task, URDF, path or start posture is wrong (`TaskError`, `UrdfError`, `LimitError`, `PathError`, ...); a
        `Robot` and the task's ``robot`` section contradict each other (`TaskError`); the start posture looks like
        degrees, or with ``strict=True`` another figure is implausible (`PlausibilityError`).
    PlanningError
        No candidate gave a motion within the limits.

    Warns
    -----
    PlausibilityWarning
        A figure of the task, the robot or the motion is implausible.
    SlowTimingWarning
        Another timing of the same joint path is more than 2 % faster.

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
    check_listener(listener)
    ik.check_families(families)
    with (
        use_one_thread(),
        report_progress(listener, progress) as report,
    ):
        began = time.perf_counter()
        robot, loaded_task = read_arguments(robot_or_task, task, keywords)
        known = None if start_from is None else motion_of(start_from, "start_from")
        loaded = time.perf_counter()
        deadline = Deadline.after(loaded_task.search.time_limit - (loaded - began))
        try:
            remarks = of_robot(robot) + of_task(loaded_task)
            remarks = report_issues(remarks, strict=loaded_task.strict)
            _report_plan(robot, loaded_task, report)
            problem = bind_task(robot, loaded_task, own_limits)
            remarks += report_issues(of_places(problem), strict=loaded_task.strict)
            opening = partial(_open_search, families=families, report=report)
            search = search_motion(problem, robot, known, opening, deadline, report)
            best = search.best
            searched = time.perf_counter()
            report(
                f"{best.status}: t_E = {best.t_end:.4f} s, after {searched - began:.2f} s"
            )

            remaining = Deadline(0.0) if search.interrupted else deadline
            smoothed = _find_smoother(best, problem, remaining, report)
            ended = time.perf_counter()
            end_time = of_end_time(best.t_end, SHORTEST_TIME)
            remarks += report_issues(end_time, strict=loaded_task.strict)
            motion = best if smoothed is None else smoothed
            events = check_times(motion.trajectory.events, best.t_end)
            # A motion that is known is not refused.
            remarks += report_issues(events, strict=False)
            gap = None
            if not (deadline.passed or problem.is_chain):
                gap = find_timing_gap(motion.trajectory, problem.limits)
            if gap is not None and not end_time:
                slow = gap.issues()
                for issue in slow:
                    warnings.warn(str(issue), SlowTimingWarning, stacklevel=2)
                remarks += slow
        except BrachisError as error:
            until = deadline if check_advice else Deadline(0.0)
            try_remedies(error, robot, loaded_task, families, own_limits, until)
            raise
        total = time.perf_counter() - began
        report(f"planned: t_E = {best.t_end:.4f} s, {best.status}, after {total:.2f} s")
        return Result(
            task=problem.task,
            trajectory=motion.trajectory,
            verification=motion.verification,
            family=best.family,
            candidate=best,
            least_motion=smoothed,
            timing={
                "load": loaded - began,
                "search": searched - loaded,
                "least_motion": ended - searched,
                "total": total,
            },
            candidates=search.candidates,
            interrupted=search.interrupted,
            not_completed=search.not_completed,
            warnings=remarks,
            timing_gap=gap,
        )


def _open_search(
    problem: Problem,
    deadline: Deadline,
    *,
    families: Sequence[ik.Family],
    report: Listener,
) -> Search:
    """Open the search for a problem whose path is within reach."""
    decompositions = Decompositions(problem, families)
    if problem.task_map.is_of_tool:
        if has_charts(problem, decompositions):
            check_regular(problem.task, problem.task_map, problem.given_postures)
        else:
            # Decompositions are computed here, so that errors in them are reported before the path is checked.
            len(decompositions)
    check_within_reach(problem)
    return Search(problem, decompositions, deadline, report)


def _find_smoother(
    best: FinishedCandidate, problem: Problem, deadline: Deadline, report: Listener
) -> LeastMotion | None:
    """Find the smoothest motion that is as fast as the best one, if the task asks for it."""
    if not problem.task.search.least_motion:
        return None
    report("looking for the smoothest motion that is as fast")
    try:
        smoothest = find_least_motion(best, deadline, report)
    except KeyboardInterrupt:
        interrupts.clear()
        smoothest = keep_fastest(best, "interrupted")
    is_exact = best.problem.robot.n != problem.robot.n
    if is_exact and smoothest.trajectory is not best.trajectory:
        return widen_plan(smoothest, problem)
    return smoothest


def read_arguments(
    first: RobotOrTask, task: Source | None, keywords: TaskKeywords
) -> tuple[Robot, Task]:
    """Return the robot, and the task with all of the robot's settings."""
    check_keywords(keywords, "plan", _OWN_KEYWORDS)
    section = keywords.get("robot")
    if is_robot(section):
        raise InputError(
            "this is the robot section of a task, not a robot",
            where="robot",
            found=repr(section) if isinstance(section, str) else type(section).__name__,
            allowed="a robot as the first argument, as in brachis.plan('scara3', path=...)",
        )
    # Anything that is not a robot is a task.
    if task is None and first is not None and not is_robot(first):
        task = first  # type: ignore[assignment]
        first = None
    named = locate(first)  # type: ignore[arg-type]
    if isinstance(named, str | os.PathLike):
        read_file(Path(named))  # a missing file is reported before anything else
    loaded_task = task_with(task, **keywords)
    robot = robot_for(named, loaded_task.robot)
    return robot, loaded_task.model_copy(update={"robot": robot.settings})


def _report_plan(robot: Robot, task: Task, report: Listener) -> None:
    """Report the robot, and the path and the task space of a plan or the parts of its program."""
    joints = write_count(robot.n, "joint")
    if task.program:
        parts = ", ".join(part_names(task.program))
        report(f"planning for {joints} a program of {len(task.program)} parts: {parts}")
        return
    rows = task.task_space
    space = rows if isinstance(rows, str) else f"[{', '.join(rows)}]"
    segments = write_count(len(task.path), "segment")
    report(f"planning for {joints} along a path of {segments}, task space {space}")


def transcribe(
    robot_or_task: RobotOrTask = None,
    /,
    task: Source | None = None,
    *,
    families: Sequence[ik.Family] = (),
    own_limits: Sequence[LimitModel] = (),
    **keywords: Unpack[TaskKeywords],
) -> tuple[TaskProgram, str]:
    """Turn a task into an NLP that can be inspected and solved.

    Parameters
    ----------
    robot_or_task, task, families, own_limits, **keywords
        As for `plan`.

    Returns
    -------
    program : TaskProgram
        ``program.guess`` is an initial point x, ``program.names`` names the entries of x, and ``program.trajectory(x)``
        returns the motion that x describes, for `verify_trajectory`. Each phase has as many knot intervals as the task
        says. With ``intervals: auto``, a phase has 10 intervals, or 12 if its speed is given, whereas `plan` chooses
        the knots itself. With ``knots: free`` the lengths of the intervals are variables.
    family : str
        Name of the closed form's family.

    Raises
    ------
    InputError
        For the same reasons as in `plan`, or because no joint path was found (`PathError`).

    Examples
    --------
    >>> import brachis
    >>> program, family = brachis.transcribe(brachis.examples.scara_line, redundant_joints=["j1"])
    >>> program.variables, family, program.names[:3]
    (36, 'planar', ['t_end', 's[3]', 's[4]'])
    >>> trajectory = program.trajectory(program.guess)
    >>> trajectory.t_end == program.objective(program.guess)
    True
    """
    ik.check_families(families)
    robot, loaded_task = read_arguments(robot_or_task, task, keywords)
    if loaded_task.program:
        raise TaskError(
            "a program is not one NLP",
            where="program",
            allowed="a path or a move; brachis.plan plans programs",
        )
    problem = Problem.of(robot, loaded_task, own_limits)
    start = first_guess(problem, decompositions_of(problem, families))
    return TaskProgram(start), start.family


Outcome = Result | BrachisError
OnProgress = Callable[[int, int, Outcome], None]
"""Function called after every plan with the number of finished plans, the total number, and the outcome."""


def plan_many(
    tasks: Iterable[Source | tuple[RobotOrTask, Source]],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: bool | OnProgress | None = None,
    **keywords: Unpack[TaskKeywords],
) -> list[Outcome]:
    """Plan many tasks, in several processes or by an executor; a plan that fails becomes an error in the list.

    Parameters
    ----------
    tasks : iterable of path, mapping, Task, or pair of robot and task
        Each task in a form that `plan` accepts.
    jobs : int, optional
        Number of processes; it is limited to the number of processors.
    executor : Executor, optional
        Object that runs the plans in place of these processes: a Dask client, or any ``concurrent.futures.Executor``,
        such as those of mpi4py and parsl. Its workers read the tasks, so they need access to the files that the tasks
        name.
    progress : bool or callable, optional
        If True, the number of finished plans is shown in the same way as the progress of `plan`; by default it is shown
        only in notebooks. If a function is given, it is called after every plan, in the order of the tasks, with the
        number of finished plans, the total number, and the outcome.
    **keywords
        Keys to set in all the tasks, as for `plan`.

    Returns
    -------
    list of Result or BrachisError
        Outcomes in the order of the tasks. An error is the one that `plan` would have raised with
        ``check_advice=False``.

    Raises
    ------
    InputError
        A single task is given in place of a list, `jobs` is not a number of processes, or a keyword does not exist.
    KeyboardInterrupt
        Ctrl-C was pressed, which ends all plans.

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
    is_single = isinstance(tasks, str | os.PathLike | Mapping | Task)
    if is_single or not isinstance(tasks, Iterable):
        raise InputError(
            "this is one task, not a list of tasks" if is_single else "wrong type",
            where="tasks",
            found=type(tasks).__name__ if is_single else repr(tasks),
            allowed="a list of tasks",
        )
    check_keywords(keywords, "plan_many", ("jobs", "progress"))
    task_list = list(tasks)
    processes = process_count(count(jobs, "jobs"))
    work = run_in_processes(
        _plan_one, task_list, keywords, jobs=processes, listener=ignore
    )
    if executor is not None:
        check_executor(executor)
        futures = [
            executor.submit(_plan_one, task, keywords, ignore) for task in task_list
        ]
        work = (future.result() for future in futures)
    outcomes: list[Outcome] = []
    with (
        report_progress(None, False if callable(progress) else progress) as report,
        closing(work) as made,
    ):
        for outcome in made:
            outcomes.append(outcome)
            report(f"planned {len(outcomes)} of {write_count(len(task_list), 'task')}")
            if callable(progress):
                progress(len(outcomes), len(task_list), outcome)
    return outcomes


def _plan_one(
    item: Any, keywords: TaskKeywords, listener: Callable[[str], None]
) -> Outcome:
    """Plan one task; Ctrl-C ends the other plans too."""
    robot, task = item if isinstance(item, tuple) else (None, item)
    heard = SigintHandler.heard
    outcome: Outcome
    try:
        outcome = plan(
            robot,
            task,
            listener=listener,
            progress=False,
            check_advice=False,
            **keywords,
        )
    except BrachisError as error:
        outcome = error
    if SigintHandler.heard > heard:
        raise KeyboardInterrupt
    return outcome
