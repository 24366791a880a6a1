"""brachis: one guess for the chosen joint, or a search over all joints; an answer counts when it is verified."""

from __future__ import annotations

import time
from typing import Any

import brachis
from peers.lines import Answer, Line


def solve(line: Line) -> Answer:
    """Plan from one guess, without the least motion, as the others do."""
    return _plan(line, effort="single")


def search(line: Line) -> Answer:
    """Plan with all joints and the usual effort, in one process."""
    return _plan(line, effort="fast", redundant_joints="auto")


def _plan(line: Line, effort: str, **keys: Any) -> Answer:
    """Plan with some keys of the task changed."""
    began = time.process_time()
    settings = {"effort": effort, "jobs": 1, "least_motion": False}
    result = brachis.plan(line.task, search=settings, **keys)
    ended = time.process_time()
    trajectory = result.trajectory
    return Answer(
        0.0,
        ended - began,
        result.t_end,
        lambda t: (
            trajectory.position(t),
            trajectory.velocity(t),
            trajectory.acceleration(t),
        ),
    )
