"""Advice with numbers: a number is advised only after a plan with this number was verified."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from brachis import ik
from brachis.common import interrupts
from brachis.common.deadline import Deadline
from brachis.common.progress import ignore
from brachis.errors import BrachisError, Remedy
from brachis.problem.problem import Decompositions
from brachis.problem.program import bind_task
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel
from brachis.robot.from_task import robot_from_settings
from brachis.search.hopeless import round_to_three_digits
from brachis.search.portfolio import Search
from brachis.task import Task, load_task, task_with, with_keys

_TIME = 20.0
"""Maximum time for testing all numbers of one error, s."""
_TRIALS = 10
"""Maximum number of trials of one number."""
_NEAR = 1.04
"""The search ends when the smallest change that is enough is known to within this factor."""


def try_remedies(
    error: BrachisError,
    robot: Robot,
    task: Task,
    families: Sequence[ik.Family],
    own_limits: Sequence[LimitModel],
    deadline: Deadline,
) -> None:
    """Try to change the numbers that an error names, and put the outcome into its hint.

    Parameters
    ----------
    error : BrachisError
    robot : Robot
    task : Task
        A task that could not be planned.
    families, own_limits : sequence
        As for `brachis.plan`.
    deadline : Deadline
        After this time, the hint names what to change, but not by how much.
    """
    if not error.remedies:
        return
    deadline = deadline.within(_TIME)
    content = task.to_dict()
    advice = []
    for number, remedy in enumerate(error.remedies):
        remedy_deadline = deadline.part(1.0 / (len(error.remedies) - number))

        def is_enough(
            value: float,
            max_batches: int | None,
            key: str = remedy.key,
            remedy_deadline: Deadline = remedy_deadline,
        ) -> bool | None:
            """Tell whether a value of the key gives a plan; None if the time ran out first."""
            soon = remedy_deadline.part(0.4) if max_batches else remedy_deadline
            try:
                changed = load_task(_with_number(content, robot, key, value))
                arm = robot
                if changed.robot != task.robot:
                    arm = robot_from_settings(changed.robot, urdf_text=robot.urdf)
                has_plan = is_planned(
                    arm, changed, families, own_limits, soon, max_batches
                )
            except BrachisError:
                has_plan = False
            return None if not has_plan and soon.passed else has_plan

        try:
            number_text = _try_numbers(remedy, is_enough, remedy_deadline)
        except KeyboardInterrupt:
            interrupts.clear()
            break
        if number_text:
            advice.append(f"{remedy.verb} {remedy.key} to {number_text}")
    # One number alone may not be enough.
    untried = " and ".join(f"{remedy.verb} {remedy.key}" for remedy in error.remedies)
    text = ", or ".join(advice) or f"{untried} (by how much is not known)"
    error.put_advice(text[:1].upper() + text[1:])


def is_planned(
    robot: Robot,
    task: Task,
    families: Sequence[ik.Family],
    own_limits: Sequence[LimitModel],
    deadline: Deadline,
    max_batches: int | None,
) -> bool | None:
    """Tell whether the first `max_batches` batches of a search, or all, lead to a verified plan.

    Return None if there may still be one: not all batches were tried, or the robot has further joint paths.
    """
    if max_batches:
        task = task_with(task, effort="single")
    problem = bind_task(robot, task, own_limits)
    search = Search(problem, Decompositions(problem, families), deadline, ignore)
    with search.end_early():
        search.run(max_batches=max_batches)
    if search.best is not None and search.best.verified:
        return True
    return None if max_batches or problem.r > 0 else False


IsEnough = Callable[[float, int | None], bool | None]
"""Function that tells whether a number is enough, from a number of search batches (None: all). None: a plan may
exist."""


def _try_numbers(remedy: Remedy, is_enough: IsEnough, deadline: Deadline) -> str:
    """Look for the smallest change that is enough, and say which it is; empty if none was found."""
    good, bad = _bracket(remedy, is_enough, deadline)
    if good is None:
        return ""
    verified = "(a plan with it was verified"
    # Quick trials may miss a plan, so the message says only after a complete search that no plan was found.
    if bad != remedy.current and not deadline.passed:
        outcome = is_enough(bad, None)
        if outcome:
            good = bad
        elif outcome is False:
            verified += f"; no plan was found with {bad:g} {remedy.unit}".rstrip()
    return f"{good:g} {remedy.unit}".rstrip() + f" {verified})"


def _bracket(
    remedy: Remedy, is_enough: IsEnough, deadline: Deadline
) -> tuple[float | None, float]:
    """Find the smallest change known to be enough (None if there is none), and the largest change that is not."""
    # Numbers are rounded towards the larger change.
    lowers = remedy.guess < remedy.current
    away = -1.0 if lowers else 1.0
    good = None
    bad = remedy.current
    step = _NEAR
    value = round_to_three_digits(remedy.guess, down=lowers)
    for _ in range(_TRIALS):
        if deadline.passed or value in (good, bad) or value <= 0.0:
            break
        if is_enough(value, 1):
            good = value
            if remedy.is_known and bad == remedy.current:
                break
        else:
            bad = value
        if good is None:
            value *= step**away
        elif abs(math.log(good / bad)) <= math.log(_NEAR) + 0.01:  # for the rounding
            break
        else:
            value = math.sqrt(good * bad)
            back = good / step**away
            if bad == remedy.current and abs(back - good) < abs(value - good):
                value = back
        value = round_to_three_digits(value, down=lowers)
        # While all numbers are enough, or none, the steps grow.
        step = min(step**3, 2.0)
    return good, bad


def _with_number(
    content: Mapping[str, Any], robot: Robot, key: str, value: float
) -> dict[str, Any]:
    """Return an unchecked task with a number changed; a number for all joints is first written joint by joint."""
    above, _, last = key.rpartition(".")
    if last not in robot.joint_names or ".limits." not in above:
        return with_keys(content, {key: value})
    setting: Any = content
    for name in re.findall(r"\w+", above):
        setting = setting[int(name) if name.isdigit() else name]
    if isinstance(setting, int | float):
        setting = dict.fromkeys(robot.joint_names, setting)
    by_joint = setting if isinstance(setting, Mapping) else {}
    return with_keys(content, {above: {**by_joint, last: value}})
