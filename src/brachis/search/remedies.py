"""Advice with numbers: a number is advised only after a plan with it was verified."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from brachis.common.deadline import Deadline
from brachis.errors import BrachisError, Remedy
from brachis.task import Task, load_task, with_keys

_TIME = 20.0
"""Time, s, in which all numbers of one error are tried."""
_SHARE = 0.4
"""Part of the time that is left for one trial."""
_TRIALS = 10
"""Largest number of trials of one number."""
_NEAR = 1.04
"""The search ends where the smallest change that is enough is known up to this factor."""
_FASTER = 3
_LARGEST_STEP = 2.0
"""Power by which the factor between two numbers grows while they are all enough, or none is; its largest value."""
_ALONE = 3
"""Share of the time for a number that is tried once, where others have as many as they have trials."""
_DIGITS = 3
_ROUNDING = 0.01
"""Digits of numbers that are tried, and what they leave out of a ratio."""

Trial = Callable[[Task, Deadline, int | None], bool | None]
"""Says whether a plan of a task is found and verified before a deadline.

The last argument is how many batches of the search are tried; None: all. It returns None where a plan may exist."""


def try_remedies(
    error: BrachisError,
    task: Task,
    joints: Sequence[str],
    is_planned: Trial,
    deadline: Deadline,
) -> None:
    """Try the changes of numbers that an error names, and say in its hint what came out.

    Parameters
    ----------
    error : BrachisError
    task : Task
        That could not be planned.
    joints : sequence of str
        Names of the robot's joints.
    is_planned : callable
    deadline : Deadline
    """
    deadline = deadline.within(_TIME)
    content = task.to_dict()
    advice: list[str] = []
    weights = [_TRIALS if remedy.is_refined else _ALONE for remedy in error.remedies]
    for number, remedy in enumerate(error.remedies):
        own = deadline.part(weights[number] / sum(weights[number:]))

        def is_enough(
            value: float, most: int | None, remedy: Remedy = remedy, own: Deadline = own
        ) -> bool | None:
            limit = own.part(_SHARE) if most else own
            found: bool | None = False
            try:
                changed = load_task(_with_number(content, joints, remedy.key, value))
                found = is_planned(changed, limit, most)
            except BrachisError:
                pass
            return None if not found and limit.passed else found

        found = _try_numbers(remedy, is_enough, own)
        if found:
            advice.append(f"{remedy.verb} {remedy.key} to {found}")
    # One number alone may not be enough.
    untried = " and ".join(
        f"{remedy.verb} {remedy.key}" for remedy in error.remedies if remedy.is_refined
    )
    text = ", or ".join(advice) or (
        untried and f"{untried} (how far was not found out)"
    )
    if text:
        error.put_advice(text[:1].upper() + text[1:])


def _try_numbers(
    remedy: Remedy,
    is_enough: Callable[[float, int | None], bool | None],
    deadline: Deadline,
) -> str:
    """Look for the smallest change that is enough, and say which it is; empty where none was found.

    `is_enough` takes a number and how many batches of the search are tried, as a `Trial` does.
    """
    unit = f" {remedy.unit}" if remedy.unit else ""
    lowers = remedy.guess < remedy.asked
    away = -1.0 if lowers else 1.0
    good: float | None = None
    bad = remedy.asked
    step = _NEAR
    value = _round(remedy.guess, down=lowers)
    for _ in range(_TRIALS if remedy.is_refined else 1):
        if deadline.passed or value in (good, bad) or value <= 0.0:
            break
        if is_enough(value, 1):
            good = value
        else:
            bad = value
        if good is None:
            value *= step**away
        elif abs(math.log(good / bad)) <= math.log(_NEAR) + _ROUNDING:
            break
        else:
            middle = math.sqrt(good * bad)
            back = good / step**away
            value = (
                back
                if bad == remedy.asked and abs(back - good) < abs(middle - good)
                else middle
            )
        value = _round(value, down=lowers)
        step = min(step**_FASTER, _LARGEST_STEP)
    if good is None:
        return ""
    text = f"{good:g}{unit} (a plan with it was verified"
    # Quick trials may miss a plan; that there is none is said after a whole search alone.
    if remedy.is_refined and bad != remedy.asked and not deadline.passed:
        outcome = is_enough(bad, None)
        if outcome:
            text = f"{bad:g}{unit} (a plan with it was verified"
        elif outcome is False:
            text += f"; there was none with {bad:g}{unit}"
    return f"{text})"


def _round(value: float, *, down: bool) -> float:
    """Round to few digits, towards the larger change."""
    if value <= 0.0:
        return value
    digits = _DIGITS - 1 - math.floor(math.log10(value))
    return (math.floor if down else math.ceil)(value * 10.0**digits) / 10.0**digits


def _with_number(
    content: Mapping[str, Any], joints: Sequence[str], key: str, value: float
) -> dict[str, Any]:
    """Return a task, not checked yet, with a number changed; one for all joints is written joint by joint."""
    above, _, last = key.rpartition(".")
    if last not in joints or not above.startswith("robot.limits."):
        return with_keys(content, {key: value})
    place: Any = content
    for part in above.split("."):
        place = place[part]
    others = place if isinstance(place, Mapping) else {}
    if isinstance(place, int | float):
        others = dict.fromkeys(joints, place)
    return with_keys(content, {above: {**others, last: value}})
