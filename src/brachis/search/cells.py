"""Cells of the redundant joints, from which the lattice is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.problem import Decomposition, Problem
from brachis.robot.joint_space import TURN

_CELLS_PER_METRE = 1.0 / 3.0  # of those of a turn
_REACH = 2.0  # m
_FAR = 20.0  # rad or m: nobody goes further, and every cell takes memory
_WINDOW = 1.0 / 8.0  # of a turn
_RANDOM = 24
_SPREAD = 2.5
_SINGLE = (1, 2, 4, 8)


@dataclass(frozen=True)
class Cells:
    """A grid over the redundant joints.

    Attributes
    ----------
    origin : (r,) ndarray
        Position of cell 0, rad or m.
    size : (r,) ndarray
        rad or m.
    first, last : (r,) int ndarray
        Cells at which a motion with a free start may begin.
    window : int
        Cells within which the next station's are looked for, of a single redundant joint.
    """

    origin: np.ndarray
    size: np.ndarray
    first: np.ndarray
    last: np.ndarray
    window: int

    @classmethod
    def of(cls, decomposition: Decomposition, cells_per_turn: int, posture: np.ndarray | None) -> Cells:
        """Lay out the cells of a choice of redundant joints.

        The posture, (n,), from which joint paths begin is the middle of a cell. Where none is given, the cells cover
        closed ranges, a turn of an open revolute joint, and what of an open prismatic joint is near where the path
        begins.
        """
        given, joints = decomposition.problem, list(decomposition.redundant)
        turning = given.robot.revolute[joints]
        low, high = given.robot.limits.position_lower[joints], given.robot.limits.position_upper[joints]
        size = cell_sizes(turning, cells_per_turn)
        if posture is not None:
            origin = posture[joints]
        else:
            places = [0.0 if turns else _nearby(given, joint) for joint, turns in zip(joints, turning, strict=True)]
            origin = np.clip(places, low, high)
        closed = np.isfinite(low) & np.isfinite(high)
        reach = np.where(turning, 0.5 * TURN, _REACH + given.path.length)
        reach = np.where(closed, np.maximum(reach, _FAR), reach)
        lowest, highest = np.maximum(low, origin - reach), np.minimum(high, origin + reach)
        first, last = np.ceil((lowest - origin) / size), np.floor((highest - origin) / size)
        return cls(origin, size, first.astype(int), last.astype(int), round(_WINDOW * cells_per_turn))

    @property
    def r(self) -> int:
        """Number of redundant joints."""
        return len(self.size)

    def positions(self, cells: np.ndarray) -> np.ndarray:
        """Redundant joints, (K, r), rad or m, at the middle of cells (K, r)."""
        return np.asarray(self.origin + cells * self.size)

    def near(self, positions: np.ndarray) -> np.ndarray:
        """Cell, (r,), in which positions (r,) are."""
        return np.rint((positions - self.origin) / self.size).astype(int)

    def everywhere(self, most: int, rng: np.random.Generator) -> np.ndarray:
        """List the cells at which a motion may begin, (C, r); of several joints `most` random ones."""
        if self.r == 0:
            return np.zeros((1, 0), dtype=int)
        if self.r == 1:
            return np.arange(self.first[0], self.last[0] + 1)[:, None]
        return rng.integers(self.first, self.last + 1, (most, self.r))

    def neighbours(self, rng: np.random.Generator) -> np.ndarray:
        """Offsets to the cells that the next station may be in, (O, r): all within the window, or a sample."""
        if self.r == 0:
            return np.zeros((1, 0), dtype=int)
        if self.r == 1:
            return np.arange(-self.window, self.window + 1)[:, None]
        single = [sign * step * row for row in np.eye(self.r, dtype=int) for step in _SINGLE for sign in (-1, 1)]
        random = np.rint(rng.normal(0.0, _SPREAD, (_RANDOM, self.r))).astype(int)
        return np.unique(np.vstack([np.zeros((1, self.r), dtype=int), single, random]), axis=0)


def cell_sizes(revolute: np.ndarray, cells_per_turn: int) -> np.ndarray:
    """Sizes of the cells of joints, (n,), rad or m, of which a mask tells the revolute ones."""
    return np.where(revolute, TURN, 1.0 / _CELLS_PER_METRE) / cells_per_turn


def unique(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different cells, (C, r), and where each given one, (K, r), is among them, (K,)."""
    span = np.ptp(cells, axis=0) + 1
    weights = np.append(np.cumprod(span[:0:-1])[::-1], 1)[: len(span)]
    keys = (cells - cells.min(axis=0)) @ weights.astype(int)
    _, first, where = np.unique(keys, return_index=True, return_inverse=True)
    return cells[first], where.ravel()


def _nearby(given: Problem, joint: int) -> float:
    """Where a prismatic joint takes the tool, with the other joints at zero, nearest to the path's beginning, m."""
    q = np.zeros(given.robot.n)
    there = np.array(given.robot.tool_placement(q).translation)
    q[joint] = 1.0
    axis = (np.array(given.robot.tool_placement(q).translation) - there)[list(given.task_map.axes)]
    wanted = given.path.sample(np.zeros(1)).target[0, : len(given.task_map.axes)]
    return float(axis @ (wanted - there[list(given.task_map.axes)]) / max(axis @ axis, 1e-12))
