"""Nodes of the lattice at one station."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.robot import Robot
from brachis.search.course import weights_near

_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Layer:
    """Nodes at a station.

    Attributes
    ----------
    cell : (K, r) int ndarray
    slot : (K,) int ndarray
        Index into the closed form's branches.
    q : (K, n) ndarray
        Postures, rad or m, lifted as the courses there are.
    length : (K,) ndarray
        Of the shortest course to the node.
    parent : (K,) int ndarray
        Its last node in the layer before.
    """

    cell: np.ndarray
    slot: np.ndarray
    q: np.ndarray
    length: np.ndarray
    parent: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> Layer:
        """Return some of the nodes, by index or mask."""
        return Layer(*(getattr(self, name)[chosen] for name in ("cell", "slot", "q", "length", "parent")))

    def bounded(self, most: int, robot: Robot) -> Layer:
        """Keep `most` nodes: half of them the nearest, the others far from each other and from those."""
        if len(self.slot) <= most:
            return self
        order = np.argsort(self.length, kind="stable")
        half = most // 2
        nearest, others = self[order[:half]], self[order[half:]]
        # Farthest points: each further node is the one that is farthest from all that are kept.
        weights = weights_near(robot, self.q[order[0]])
        places, kept = others.q * weights, nearest.q * weights
        distance = np.abs(places[:, None] - kept[None]).max(axis=2).min(axis=1)
        chosen: list[int] = []
        for _ in range(most - half):
            chosen.append(int(np.argmax(distance)))
            distance = np.minimum(distance, np.abs(places - places[chosen[-1]]).max(axis=1))
        return self[np.sort(np.concatenate([order[:half], order[half:][np.unique(chosen)]]))]


def all_lifts(q: np.ndarray, joints: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lift angles by multiples of 2 pi in all ways that closed ranges allow, into open ranges in one way.

    Parameters
    ----------
    q : (K, n) ndarray
    joints : (c,) int ndarray
        Those that are lifted.
    lower, upper : (n,) ndarray

    Returns
    -------
    which : (L,) int ndarray
        Row of `q` from which each lifted posture comes; rows that no lift brings into the ranges are missing.
    q : (L, n) ndarray
    """
    which, q = np.arange(len(q)), q.copy()
    for joint in joints:
        low, high = lower[joint], upper[joint]
        if np.isfinite(low):
            q[:, joint] -= _TURN * np.floor((q[:, joint] - low) / _TURN)  # the lowest lift inside
        elif np.isfinite(high):
            q[:, joint] += _TURN * np.floor((high - q[:, joint]) / _TURN)
        if not (np.isfinite(low) and np.isfinite(high)):
            continue
        count = np.maximum(np.floor((high - q[:, joint]) / _TURN).astype(int) + 1, 0)
        rows = np.repeat(np.arange(len(q)), count)
        turns = np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
        which, q = which[rows], q[rows]
        q[:, joint] += _TURN * turns
    return which, q
