"""Nodes of the lattice at one station."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from brachis.limits import Limit
from brachis.robot import Robot
from brachis.search.joint_path import weights_near


@dataclass(frozen=True)
class Layer:
    """Nodes at a station.

    Attributes
    ----------
    cell : (K, r) int ndarray
        Of the redundant joints of a closed form; (K, 0) without one.
    branch : (K,) int ndarray
        What joint paths keep: index into the closed form's branches, or where they began.
    q : (K, n) ndarray
        Postures, rad or m, continuous along the joint paths there.
    low, high : (K, n) ndarray
        Least and largest positions along the joint path to the node.
    length : (K,) ndarray
        Of the shortest joint path to the node.
    parent : (K,) int ndarray
        Its last node in the layer before.
    """

    cell: np.ndarray
    branch: np.ndarray
    q: np.ndarray
    low: np.ndarray
    high: np.ndarray
    length: np.ndarray
    parent: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> Layer:
        """Return some of the nodes, by index or mask."""
        return Layer(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def bounded(self, most: int, cost: np.ndarray, robot: Robot, limits: Sequence[Limit]) -> Layer:
        """Keep `most` nodes: half of them of least `cost`, (K,), the others far from each other and from those."""
        if len(self.branch) <= most:
            return self
        order = np.argsort(cost, kind="stable")
        half = most // 2
        nearest, others = self[order[:half]], self[order[half:]]
        weights = weights_near(robot, limits, self.q[order[0]])
        chosen = farthest(others.q * weights, nearest.q * weights, most - half)
        return self[np.sort(np.concatenate([order[:half], order[half:][np.unique(chosen)]]))]


def farthest(places: np.ndarray, kept: np.ndarray, count: int) -> list[int]:
    """Choose among places (K, n), one after the other, the one that is farthest from all that are kept, (H, n)."""
    distance = np.abs(places[:, None] - kept[None]).max(axis=2).min(axis=1)
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.abs(places - places[chosen[-1]]).max(axis=1))
    return chosen
