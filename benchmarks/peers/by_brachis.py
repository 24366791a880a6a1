"""brachis: ``search.effort: single`` for the chosen joint; the answer counts when it is verified."""

from __future__ import annotations

import time

import brachis
from peers.lines import Answer, Line


def solve(line: Line) -> Answer:
    """Plan without the least motion, as the others do."""
    began = time.process_time()
    result = brachis.plan(line.task, search={"effort": "single", "least_motion": False})
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
