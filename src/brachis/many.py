"""Many plans at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from typing import Any, Unpack

from brachis.arguments import count
from brachis.errors import BrachisError, InputError, write_count
from brachis.planner import Given, plan
from brachis.progress import report_progress
from brachis.result import Result
from brachis.search.processes import each, processes
from brachis.task import Source, TaskKeywords, check_keywords

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
        raise InputError("is one task", where="tasks", found=type(tasks).__name__, allowed="a list of tasks")
    if not isinstance(tasks, Iterable):
        raise InputError("wrong type", where="tasks", found=repr(tasks), allowed="a list of tasks")
    check_keywords(keywords, "plan_many", ("jobs", "progress"))
    given, jobs = list(tasks), processes(count(jobs, "jobs"))
    outcomes: list[Outcome] = []
    work = _outcome, given, keywords
    if callable(progress):
        heard, progress = progress, False
    else:
        heard = None
    with report_progress(None, progress) as tell, closing(each(*work, jobs=jobs, listener=_deaf)) as made:
        for outcome in made:
            outcomes.append(outcome)
            tell(f"planned {len(outcomes)} of {write_count(len(given), 'task')}")
            if heard is not None:
                heard(len(outcomes), len(given), outcome)
    return outcomes


def _deaf(_text: str) -> None:
    """Listen to nothing."""


def _outcome(given: Any, keywords: TaskKeywords, listener: Callable[[str], None]) -> Outcome:  # noqa: ANN401
    """Plan one task."""
    robot, task = given if isinstance(given, tuple) else (None, given)
    try:
        return plan(robot, task, listener=listener, progress=False, check_advice=False, **keywords)
    except BrachisError as error:
        return error
