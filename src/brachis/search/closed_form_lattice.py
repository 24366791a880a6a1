"""The lattice of one choice of redundant joints, whose closed form gives the postures.

The ranges of the redundant joints are cut into cells. A node is a cell, a branch and the posture that the closed form
gives there. Every node is joined to the surrounding cells at the next station, on the same branch and clear of the
branch's boundary. A single redundant joint is searched completely at the lattice's spacing. With several redundant
joints, nodes are joined to neighbours along one joint at a time and to random ones, and a layer keeps a bounded number
of nodes: half of them have the shortest joint paths, and half are far apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from brachis.problem.problem import Decomposition, Problem
from brachis.robot import Robot
from brachis.robot.joints import TURN, complement
from brachis.search.joint_path import OTHER_BRANCH
from brachis.search.lattice import LARGEST_STEP, Edges, Lattice, Layer, Options


@dataclass(frozen=True)
class Cells:
    """A grid over the redundant joints.

    Attributes
    ----------
    origin : (r,) ndarray
        Position of cell 0, rad or m.
    size : (r,) ndarray
        Size of a cell, rad or m.
    first, last : (r,) int ndarray
        First and last cells at which a motion with a free start may begin.
    window : int
        Number of cells to either side that are searched at the next station, if a single joint is redundant.
    """

    origin: np.ndarray
    size: np.ndarray
    first: np.ndarray
    last: np.ndarray
    window: int

    @classmethod
    def of(
        cls,
        decomposition: Decomposition,
        cells_per_turn: int,
        posture: np.ndarray | None,
    ) -> Cells:
        """Lay out the cells of a choice of redundant joints.

        If joint paths begin at a given posture, (n,), it is the middle of a cell. If no posture is given, the cells
        cover closed ranges, one turn of an open revolute joint, and the part of an open prismatic joint's range that is
        close to the start of the path.
        """
        problem = decomposition.problem
        joints = list(decomposition.redundant)
        turning = problem.robot.revolute[joints]
        low = problem.robot.limits.position_lower[joints]
        high = problem.robot.limits.position_upper[joints]
        size = cell_sizes(problem.robot, cells_per_turn)[joints]
        if posture is None:
            near = [_near_start(problem, joint) for joint in joints]
            origin = np.clip(np.where(turning, 0.0, near), low, high)
        else:
            origin = posture[joints]
        reach = np.where(turning, 0.5 * TURN, 2.0 + problem.path.length)
        # Closed ranges are covered completely, up to 20 rad or m to either side, because every cell takes memory.
        closed = np.isfinite(low) & np.isfinite(high)
        reach = np.where(closed, np.maximum(reach, 20.0), reach)
        first = np.ceil((np.maximum(low, origin - reach) - origin) / size).astype(int)
        last = np.floor((np.minimum(high, origin + reach) - origin) / size).astype(int)
        return cls(origin, size, first, last, round(cells_per_turn / 8.0))

    @property
    def r(self) -> int:
        """Number of redundant joints."""
        return len(self.size)

    def positions(self, cells: np.ndarray) -> np.ndarray:
        """Return the positions of the redundant joints, (K, r), rad or m, in the middle of cells (K, r)."""
        return self.origin + cells * self.size

    def near(self, positions: np.ndarray) -> np.ndarray:
        """Return the cells, (..., r), that contain positions, (..., r)."""
        return np.rint((positions - self.origin) / self.size).astype(int)

    def everywhere(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """List the cells at which a motion may begin, (C, r); with several joints, `count` random cells."""
        if self.r == 1:
            return np.arange(self.first[0], self.last[0] + 1)[:, None]
        return rng.integers(self.first, self.last + 1, (count if self.r else 1, self.r))

    def neighbours(self, rng: np.random.Generator) -> np.ndarray:
        """Return offsets to the cells that are tried at the next station, (O, r): the whole window, or a sample."""
        if self.r == 1:
            return np.arange(-self.window, self.window + 1)[:, None]
        still = np.zeros((1, self.r), dtype=int)
        if self.r == 0:
            return still
        single = np.kron([[1], [2], [4], [8]], np.eye(self.r, dtype=int))
        random = np.rint(rng.normal(0.0, 2.5, (24, self.r))).astype(int)
        return np.unique(np.vstack([still, single, -single, random]), axis=0)


def cell_sizes(robot: Robot, cells_per_turn: int) -> np.ndarray:
    """Return the cell sizes of the joints, (n,), rad or m; a range has at least four cells."""
    limits = robot.limits
    size = np.where(robot.revolute, TURN, 3.0) / cells_per_turn
    return np.minimum(size, 0.25 * (limits.position_upper - limits.position_lower))


def unique(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct cells, (C, r), and for each of `cells`, (K, r), its index among them, (K,)."""
    # Each cell gets a number, because NumPy takes many times as long to sort rows.
    span = np.ptp(cells, axis=0) + 1
    weights = np.append(np.cumprod(span[:0:-1])[::-1], 1)[: len(span)]
    keys = (cells - cells.min(axis=0)) @ weights.astype(int)
    _, first, where = np.unique(keys, return_index=True, return_inverse=True)
    return cells[first], where.ravel()


def _near_start(problem: Problem, joint: int) -> float:
    """Return the position of a slide, m, that brings the tool closest to the path's start; other joints are at 0."""
    axes = list(problem.task_map.axes)
    q = np.zeros((2, problem.robot.n))
    q[1, joint] = 1.0
    tool, displaced_tool = problem.robot.tool_placements(q)[0][:, axes]
    axis = displaced_tool - tool
    beginning = problem.path.sample(np.zeros(1)).target[0, : len(axes)]
    return float(axis @ (beginning - tool) / max(axis @ axis, 1e-12))


def solve_all(
    decomposition: Decomposition, targets: np.ndarray, q_r: np.ndarray
) -> np.ndarray:
    """Return postures, (C, B, A, n), on all branches for targets (C, m) and redundant joints (C, r), or NaN."""
    n = decomposition.problem.robot.n
    answers = decomposition.match.solver.solve(targets, q_r)
    q = np.empty((*answers.shape[:3], n))
    q[..., list(decomposition.redundant)] = q_r[:, None, None]
    q[..., complement(n, decomposition.redundant)] = answers
    return q


class ClosedFormLattice(Lattice):
    """Lattice for one choice of redundant joints.

    Parameters
    ----------
    decomposition : Decomposition
    **options
        See `Lattice`.
    """

    def __init__(
        self, decomposition: Decomposition, **options: Unpack[Options]
    ) -> None:
        problem = decomposition.problem
        self.decomposition = decomposition
        self._redundant = list(decomposition.redundant)
        turning = problem.robot.revolute.copy()
        turning[self._redundant] = False
        super().__init__(problem, turning, **options)
        self._solver = decomposition.match.solver
        self._modulo = turning
        self._given_branch = decomposition.branches[0]
        self._cells = Cells.of(decomposition, self._cells_per_turn, self._origin)
        # Minimum branch margin of nodes: 0.02, or half the margin of the given posture if this is less.
        self._clear = 0.02
        if self._origin is not None:
            margins = self._solver.branch_margins(
                self._origin[None], self._given_branch
            )
            self._clear = min(0.02, 0.5 * margins.min(initial=np.inf))

    def _at_end(self, last: Layer) -> np.ndarray:
        """Tell which nodes, (K,) bool, are in the cell of the given end posture, which the plan reaches exactly."""
        allowed = np.full(self._robot.n, LARGEST_STEP)
        allowed[self._redundant] = self._cells.size
        return np.all(np.abs(last.q - self.problem.end) <= allowed, axis=1)

    def _start_nodes(self, rng: np.random.Generator) -> Layer:
        """Create nodes spread over the ranges of the redundant joints."""
        cells = self._cells.everywhere(4 * self._nodes, rng)
        branches = np.array(self.decomposition.branches)
        q = self._postures(cells, 0)[:, branches]
        exists = np.isfinite(q).all(axis=3)
        return Layer.start(q[exists], branches[np.nonzero(exists)[1]])

    def _postures(self, cells: np.ndarray, station: int) -> np.ndarray:
        """Return the postures, (C, B, A, n), in cells, (C, r), on all branches."""
        targets = np.repeat(self._targets[station][None], len(cells), axis=0)
        return solve_all(self.decomposition, targets, self._cells.positions(cells))

    def _edges(self, before: Layer, station: int, rng: np.random.Generator) -> Edges:
        """List edges to the surrounding cells; at the last station, also to the cell of the given end posture."""
        offsets = self._cells.neighbours(rng)
        nodes = np.arange(len(before.branch))
        node_cells = self._cells.near(before.q[:, self._redundant])
        parent = np.repeat(nodes, len(offsets))
        around = (node_cells[:, None] + offsets).reshape(len(parent), self._cells.r)
        end = self.problem.end
        if self._to_end and end is not None and station == len(self.s) - 1:
            aim = np.tile(self._cells.near(end[self._redundant]), (len(nodes), 1))
            parent = np.append(parent, nodes)
            around = np.vstack([around, aim])
        cells, where = unique(around)
        postures = self._postures(cells, station)
        several = self._solver.alternatives
        alternative = np.tile(np.arange(several), len(parent))
        parent = np.repeat(parent, several)
        where = np.repeat(where, several)
        branch = before.branch[parent]
        q = postures[where, branch, alternative]
        step = self._step(before.q[parent], q)
        turns = np.nan_to_num(np.round((before.q[parent] + step - q) / TURN))
        return Edges(
            parent,
            step,
            np.column_stack([where, branch, alternative, turns[:, self._counts_turns]]),
            np.isfinite(postures).all(axis=3).any(axis=(1, 2))[where],
        )

    def _keep(self, layer: Layer, choose: Callable[[Layer], Layer]) -> Layer | str:
        """Choose among the nodes that are clear of the branch boundary and can be held at rest."""
        clear = np.ones(len(layer.branch), dtype=bool)
        for branch in np.unique(layer.branch):
            on_branch = layer.branch == branch
            margins = self._solver.branch_margins(layer.q[on_branch], int(branch))
            clear[on_branch] = margins.min(axis=1, initial=np.inf) >= self._clear
        return super()._keep(layer[clear], choose) or OTHER_BRANCH

    def _thin(self, layer: Layer) -> Layer:
        """Keep a bounded number of nodes if several joints are redundant."""
        if self._cells.r <= 1:
            return layer
        return layer[self._choose_some(layer, self._nodes)]
