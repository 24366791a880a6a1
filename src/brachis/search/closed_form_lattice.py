"""The lattice of one choice of redundant joints, whose closed form gives the postures.

The redundant joints are cut into cells. Every node (a cell, a branch and the posture that the closed form gives there)
is joined to the cells around it at the next station, on the same branch and clear of its boundary. One redundant joint
is searched completely at the lattice's spacing. Of several, all neighbours along one joint at a time and random ones,
and a layer keeps a bounded number of nodes, half of them the nearest and half far from each other.

Cells of the redundant joints, from which the lattice is made.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.joints import TURN, complement
from brachis.search.joint_path import NO_ANSWER, OTHER_BRANCH, beyond_ranges, causes_of
from brachis.search.lattice import LARGEST_STEP, Lattice, Layer, shortest

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
    def of(
        cls,
        decomposition: Decomposition,
        cells_per_turn: int,
        posture: np.ndarray | None,
    ) -> Cells:
        """Lay out the cells of a choice of redundant joints.

        The posture, (n,), from which joint paths begin is the middle of a cell. Where none is given, the cells cover
        closed ranges, a turn of an open revolute joint, and what of an open prismatic joint is near where the path
        begins.
        """
        given, joints = decomposition.problem, list(decomposition.redundant)
        turning = given.robot.revolute[joints]
        low, high = (
            given.robot.limits.position_lower[joints],
            given.robot.limits.position_upper[joints],
        )
        size = cell_sizes(turning, cells_per_turn)
        if posture is not None:
            origin = posture[joints]
        else:
            places = [
                0.0 if turns else _nearby(given, joint)
                for joint, turns in zip(joints, turning, strict=True)
            ]
            origin = np.clip(places, low, high)
        closed = np.isfinite(low) & np.isfinite(high)
        reach = np.where(turning, 0.5 * TURN, _REACH + given.path.length)
        reach = np.where(closed, np.maximum(reach, _FAR), reach)
        lowest, highest = (
            np.maximum(low, origin - reach),
            np.minimum(high, origin + reach),
        )
        first, last = (
            np.ceil((lowest - origin) / size),
            np.floor((highest - origin) / size),
        )
        return cls(
            origin,
            size,
            first.astype(int),
            last.astype(int),
            round(_WINDOW * cells_per_turn),
        )

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
        single = [
            sign * step * row
            for row in np.eye(self.r, dtype=int)
            for step in _SINGLE
            for sign in (-1, 1)
        ]
        random = np.rint(rng.normal(0.0, _SPREAD, (_RANDOM, self.r))).astype(int)
        return np.unique(
            np.vstack([np.zeros((1, self.r), dtype=int), single, random]), axis=0
        )


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
    axis = (np.array(given.robot.tool_placement(q).translation) - there)[
        list(given.task_map.axes)
    ]
    wanted = given.path.sample(np.zeros(1)).target[0, : len(given.task_map.axes)]
    return float(
        axis @ (wanted - there[list(given.task_map.axes)]) / max(axis @ axis, 1e-12)
    )


_CLEAR = 0.02
_STARTS = 4  # times the nodes of a layer


class ClosedFormLattice(Lattice):
    """Lattice of a choice of redundant joints.

    Parameters
    ----------
    decomposition : Decomposition
    cells_per_turn : int, optional
        Cells of a turn of a revolute joint; a metre of a prismatic joint has a third as many.
    density, nodes, seed, deadline
        See `Lattice`.
    """

    def __init__(
        self,
        decomposition: Decomposition,
        *,
        cells_per_turn: int = 72,
        density: float = 1.0,
        nodes: int = 120,
        seed: int = 0,
        deadline: Deadline = NEVER,
    ) -> None:
        given = decomposition.problem
        self._redundant = list(decomposition.redundant)
        self._rest = np.array(
            complement(given.robot.n, decomposition.redundant), dtype=int
        )
        turning = given.robot.revolute & np.isin(np.arange(given.robot.n), self._rest)
        super().__init__(
            given, turning, density=density, nodes=nodes, seed=seed, deadline=deadline
        )
        self.decomposition, self._solver = decomposition, decomposition.match.solver
        self._turns = np.flatnonzero(turning)
        self._cells = Cells.of(decomposition, cells_per_turn, self._origin)
        self._clear = _CLEAR
        if self._origin is not None:
            at_origin = self._solver.branch_margins(
                self._origin[None], decomposition.branches[0]
            )[0]
            self._clear = float(np.minimum(_CLEAR, 0.5 * at_origin.min(initial=np.inf)))

    def _at_end(self, last: Layer) -> np.ndarray:
        """See `Lattice`: the motion ends in another posture of the end's cell, from which the plan goes on to it."""
        assert self.problem.end is not None
        allowed = np.full(self._robot.n, LARGEST_STEP)
        allowed[self._redundant] = self._cells.size
        return np.asarray(np.all(np.abs(last.q - self.problem.end) <= allowed, axis=1))

    def _first_layer(self, rng: np.random.Generator) -> Layer | dict[str, int]:
        """Make the node of the given posture, or nodes all over the ranges where none is given, or say why not."""
        r = self._cells.r
        if self._origin is not None:
            none, q = np.zeros(1, dtype=int), self._origin[None].astype(float)
            return Layer(
                np.zeros((1, r), dtype=int),
                none + self.decomposition.branches[0],
                q,
                q,
                q,
                np.zeros(1),
                none,
            )
        cells = self._cells.everywhere(_STARTS * self._nodes, rng)
        answers = self._answers(cells, 0)[:, self.decomposition.branches]
        which, branch, alternative = np.nonzero(np.isfinite(answers).all(axis=3))
        if not len(which):
            return {NO_ANSWER: len(cells)}
        q = np.empty((len(which), self._robot.n))
        q[:, self._redundant] = self._cells.positions(cells[which])
        q[:, self._rest] = answers[which, branch, alternative]
        within = self._inside(q, q)
        inside = within.all(axis=1)
        if not inside.any():
            return beyond_ranges(self._robot, within)
        cell, branch, q = (
            cells[which[inside]],
            np.array(self.decomposition.branches)[branch[inside]],
            q[inside],
        )
        nothing = np.zeros(len(q))
        return self._kept(Layer(cell, branch, q, q, q, nothing, nothing.astype(int)))

    def _answers(self, cells: np.ndarray, station: int) -> np.ndarray:
        """Non-redundant joints of all branches, (C, B, A, m)."""
        target = np.repeat(self._targets[station][None], len(cells), axis=0)
        return self._solver.solve(target, self._cells.positions(cells))

    def _edges(
        self, before: Layer, station: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of parents, (E,), and cells, (E, r), that may be joined; at the very end the given end's, too."""
        offsets = self._cells.neighbours(rng)
        parent = np.repeat(np.arange(len(before.branch)), len(offsets))
        edges = before.cell[parent] + np.tile(offsets, (len(before.branch), 1))
        end = self.problem.end
        if self._to_end and end is not None and station == len(self.s) - 1:
            aim = np.tile(
                self._cells.near(end[self._redundant]), (len(before.branch), 1)
            )
            parent = np.append(parent, np.arange(len(before.branch)))
            edges = np.vstack([edges, aim])
        return parent, edges

    def _next(
        self, before: Layer, station: int, rng: np.random.Generator
    ) -> Layer | dict[str, int]:
        """Join the nodes of a layer to the next station, or say why none can be."""
        parent, edges = self._edges(before, station, rng)
        cells, where = unique(edges)
        answers = self._answers(cells, station)
        exists, several = np.isfinite(answers).all(axis=3), self._solver.alternatives
        alternative = np.tile(np.arange(several), len(parent))
        parent, where = np.repeat(parent, several), np.repeat(where, several)
        branch = before.branch[parent]
        q = np.empty((len(parent), self._robot.n))
        q[:, self._redundant] = self._cells.positions(cells)[where]
        q[:, self._rest] = answers[where, branch, alternative]
        step = q - before.q[parent]
        turn = -np.round(step[:, self._turns] / TURN)
        step[:, self._turns] += TURN * turn
        q = before.q[parent] + step
        low, high = (
            np.minimum(before.low[parent], q),
            np.maximum(before.high[parent], q),
        )
        found = exists[where, branch, alternative]
        with np.errstate(invalid="ignore"):
            inside = self._inside(low, high)
            near = np.all(np.abs(step) <= LARGEST_STEP, axis=1)
        good = found & inside.all(axis=1) & near
        if not good.any():
            return causes_of(
                self._robot, exists.any(axis=(1, 2))[where], found, inside, near
            )
        parent, where, step = parent[good], where[good], step[good]
        length = before.length[parent] + self._lengths(before.q, step, parent)
        layer = Layer(
            cells[where], branch[good], q[good], low[good], high[good], length, parent
        )
        turn = np.where(self._telling[self._turns], turn[good], 0.0)
        return self._kept(
            layer[
                shortest(
                    length,
                    np.column_stack([where, layer.branch, alternative[good], turn]),
                )
            ]
        )

    def _kept(self, layer: Layer) -> Layer | dict[str, int]:
        """Keep nodes clear of the branch boundary that can be held against gravity, not too many of them."""
        clear = np.ones(len(layer.branch), dtype=bool)
        for branch in np.unique(layer.branch):
            own = layer.branch == branch
            margins = self._solver.branch_margins(layer.q[own], int(branch))
            clear[own] = margins.min(axis=1, initial=np.inf) >= self._clear
        held, refused = self._held(layer.q[clear])
        if not held.any():
            return refused | (
                {OTHER_BRANCH: int((~clear).sum())} if not clear.all() else {}
            )
        kept = layer[np.flatnonzero(clear)[held]]
        return (
            kept
            if self._cells.r <= 1
            else kept.bounded(
                self._nodes, kept.length, self._robot, self.problem.limits
            )
        )
