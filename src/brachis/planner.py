"""The whole pipeline on one page: task -> robot -> path -> decomposition -> NLP -> solve and refine -> verify."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence

from threadpoolctl import ThreadpoolController

from brachis import ik, plausibility
from brachis.custom_limits import LimitModel
from brachis.deadline import Deadline
from brachis.nlp import Transcription
from brachis.nlp.layout import SHORTEST_TIME
from brachis.result import Result
from brachis.robot import Robot
from brachis.robot.combine import robot_for
from brachis.search import Listener, find_fastest, first_start
from brachis.setting import Setting, choices, intervals_of, transcription
from brachis.task import Task, load_task


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
    remarks = plausibility.tell(plausibility.of_robot(robot), strict=strict, stacklevel=4)
    setting = Setting.of(robot, task, limits)
    places = plausibility.of_places(setting.task_map, setting.start, setting.end, task.path_start)
    remarks += plausibility.tell(places, strict=strict, stacklevel=4)
    found = find_fastest(choices(setting, families), deadline, listener)
    trajectory, verification = found.motion
    end_time = plausibility.of_end_time(trajectory.t_end, SHORTEST_TIME)
    remarks += plausibility.tell(end_time, strict=strict, stacklevel=4)
    return Result(
        task=task,
        trajectory=trajectory,
        verification=verification,
        family=found.family,
        attempts=found.attempts,
        chosen=found.chosen,
        timing={"load": loaded - began, "total": time.perf_counter() - began},
        candidates=found.candidates,
        interrupted=found.interrupted,
        undone=found.undone,
        warnings=remarks,
    )


def transcribe(
    robot: Robot, task: Task, *, families: Sequence[ik.Family] = (), limits: Sequence[LimitModel] = ()
) -> tuple[Transcription, str]:
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
    problem : Transcription
    family : str
        Family of the closed form.

    Raises
    ------
    InputError
        See `plan`.
    """
    setting = Setting.of(robot_for(robot, task.robot), task, limits)
    choice = choices(setting, families)[0]
    decomposition = choice.decomposition(*first_start(choice))
    problem = transcription(setting, decomposition, intervals_of(task))
    return problem, choice.match.family
