"""Constant speeds of the tool over parts of the path: how far they are off, either way, as a share of the speed."""

from __future__ import annotations

import numpy as np

from brachis.task import ProcessSpeed
from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.limits.tool_speed import speeds


def worst_process_speed(given: Given) -> Worst | None:
    """Find the largest speed; a ratio of 1 is the process speed and its tolerance."""
    return _worst(given, 1.0)


def worst_least_process_speed(given: Given) -> Worst | None:
    """Find the smallest speed; a ratio of 1 is the process speed without its tolerance, 2 a tool at rest."""
    return _worst(given, -1.0)


def _worst(given: Given, side: float) -> Worst | None:
    """Find the worst part of the path."""
    parts = given.trajectory.task.tool_limits.process_speed
    within = given.within(np.array([part.s for part in parts])) if parts else []
    found = (_of_part(inside, part, side, alone=len(parts) == 1) for inside, part in zip(within, parts, strict=True))
    return max(found, key=lambda worst: worst.ratio, default=None)


def _of_part(inside: Given, part: ProcessSpeed, side: float, *, alone: bool) -> Worst:
    begin, end = part.s
    subject = "tool" if alone else f"tool, s = {begin:g} to {end:g}"
    return worst_between(
        inside,
        lambda states: 1.0 - part.tolerance + side * (speeds(inside.robot, states) / part.speed - 1.0),
        (subject,),
    )
