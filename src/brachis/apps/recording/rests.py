"""Where a recorded motion waits: runs of rows with the same posture, between which it moves along the path."""

from __future__ import annotations

from itertools import chain, pairwise

import numpy as np

from brachis.apps.recording.nodes import Nodes
from brachis.apps.recording.recording import FEWEST_ROWS
from brachis.common import tolerances

_SLOW = 1e-3
"""Part of the largest velocity up to which a velocity at rest is rounding."""


def find_rests(nodes: Nodes) -> list[tuple[int, int]]:
    """Find the waits inside a motion: numbers of the first and the last node of each.

    A wait has five rows or more, none of them the first or the last one of the motion.
    """
    speed = np.abs(nodes.qdot).max(axis=1)
    same = np.all(np.abs(np.diff(nodes.q, axis=0)) <= tolerances.ROUNDING, axis=1)
    slow = speed <= _SLOW * speed.max()
    still = np.concatenate([[False], same & slow[1:] & slow[:-1], [False]])
    edges = np.flatnonzero(np.diff(still))
    runs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    last = len(nodes.t) - 1
    return [
        (first, end)
        for first, end in runs
        if first > 0 and end < last and end - first + 1 >= FEWEST_ROWS
    ]


def with_rests(nodes: Nodes, rests: list[tuple[int, int]]) -> Nodes:
    """Return the motion without the rounding of its positions, velocities and accelerations at rest."""
    states = np.stack([nodes.q, nodes.qdot, nodes.qddot])
    for first, end in rests:
        states[0, first : end + 1] = nodes.q[first]
        states[1:, first : end + 1] = 0.0
    q, qdot, qddot = states
    return Nodes(nodes.t, q, qdot, qddot, nodes.notes)


def split_at_rests(nodes: Nodes, rests: list[tuple[int, int]]) -> list[Nodes]:
    """Return the parts between waits in which the motion moves."""
    edges = [0, *chain(*rests), len(nodes.t) - 1]
    return [nodes.part(*ends) for ends in list(pairwise(edges))[::2]]
