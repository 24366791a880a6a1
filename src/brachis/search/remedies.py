"""Advice with numbers: a number is advised only after a plan with it was verified."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from brachis.deadline import Deadline
from brachis.errors import BrachisError, Remedy
from brachis.task import Task, load_task, with_keys

_TIME = 15.0
"""Time, s, in which all numbers of one error are tried."""
_SHARE = 0.4
"""Part of the time that is left for one trial."""
_TRIALS = 10
"""Largest number of trials of one number."""
_NEAR = 1.04
"""The search ends where the smallest change that is enough is known up to this factor."""
_FURTHER = 0.7
"""While nothing is enough, the number is multiplied, or divided, by this."""
_DIGITS = 3

Trial = Callable[[Task, Deadline], bool]
"""Says whether a plan of a task is found and verified before a deadline."""


def try_remedies(error: BrachisError, task: Task, joints: Sequence[str], is_planned: Trial, deadline: Deadline) -> None:
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
    advice = []
    for remedy in error.remedies:

        def is_enough(value: float, remedy: Remedy = remedy) -> bool | None:
            limit = deadline.part(_SHARE)
            try:
                changed = load_task(_with_number(content, joints, remedy.key, value))
                found = is_planned(changed, limit)
            except BrachisError:
                found = False
            return None if limit.passed and not found else found

        found = _try_numbers(remedy, is_enough, deadline)
        text = f"{remedy.verb} {remedy.key} to {found}"
        if found:
            advice.append(text)
    # One number alone may not be enough.
    untried = " and ".join(f"{remedy.verb} {remedy.key}" for remedy in error.remedies if remedy.is_refined)
    text = ", or ".join(advice) or untried
    if text:
        error.put_advice(text[:1].upper() + text[1:])


def _try_numbers(remedy: Remedy, is_enough: Callable[[float], bool | None], deadline: Deadline) -> str:
    """Look for the smallest change that is enough, and say which it is; empty where none was found.

    Of a number `is_enough` says None where the time was up.
    """
    lowers = remedy.guess < remedy.asked
    unit = f" {remedy.unit}" if remedy.unit else ""
    good: float | None = None
    bad = remedy.asked
    step = _NEAR
    is_tried = False
    if not remedy.guess > 0.0:
        return ""
    value = _rounded(remedy.guess, down=lowers)
    for _ in range(_TRIALS if remedy.is_refined else 1):
        if deadline.passed:
            break
        outcome = is_enough(value)
        if outcome:
            good = value
        else:
            bad, is_tried = value, outcome is not None
        if good is None:
            value *= _FURTHER if lowers else 1.0 / _FURTHER
        elif max(good / bad, bad / good) <= _NEAR * (1.0 + 1e-2):
            break
        else:
            middle, next_one = math.sqrt(good * bad), good * step if lowers else good / step
            is_beyond = next_one >= middle if lowers else next_one <= middle
            value, step = (middle, step) if is_beyond or is_tried and step > _NEAR else (next_one, step**3)
        value = _rounded(value, down=lowers)
        if value in (good, bad):
            break
    if good is None:
        return ""
    limit = f"; none was found with {bad:g}{unit}" if remedy.is_refined and is_tried else ""
    return f"{good:g}{unit} (a plan with it was verified{limit})"


def _rounded(value: float, *, down: bool) -> float:
    """Round to few digits, towards the larger change."""
    digits = _DIGITS - 1 - math.floor(math.log10(abs(value)))
    return (math.floor if down else math.ceil)(value * 10.0**digits) / 10.0**digits


def _with_number(content: Mapping[str, Any], joints: Sequence[str], key: str, value: float) -> dict[str, Any]:
    """Return a task, not checked yet, with a number changed; one that stands for all joints is written joint by joint."""
    above, _, last = key.rpartition(".")
    if last not in joints:
        return with_keys(content, {key: value})
    place: Any = content
    for part in above.split("."):
        place = place[part]
    others = place if isinstance(place, Mapping) else {}
    if isinstance(place, int | float):
        others = dict.fromkeys(joints, place)
    return with_keys(content, {above: {**others, last: value}})
