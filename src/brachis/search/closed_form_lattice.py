"""The lattice of one choice of redundant joints, whose closed form gives the postures.

The redundant joints are cut into cells. Every node (a cell, a branch and the posture that the closed form gives there)
is joined to the cells around it at the next station, on the same branch and clear of its boundary. One redundant joint
is searched completely at the lattice's spacing. Of several, all neighbours along one joint at a time and random ones,
and a layer keeps a bounded number of nodes, half of them the nearest and half far from each other.
"""

from __future__ import annotations

import numpy as np

from brachis.deadline import NEVER, Deadline
from brachis.problem import Decomposition
from brachis.robot.joint_space import TURN, complement
from brachis.search.cells import Cells, unique
from brachis.search.joint_path import NO_ANSWER, OTHER_BRANCH, beyond_ranges, causes_of
from brachis.search.lattice import LARGEST_STEP, Lattice, shortest
from brachis.search.layer import Layer

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
        self._rest = np.array(complement(given.robot.n, decomposition.redundant), dtype=int)
        turning = given.robot.revolute & np.isin(np.arange(given.robot.n), self._rest)
        super().__init__(given, turning, density=density, nodes=nodes, seed=seed, deadline=deadline)
        self.decomposition, self._solver = decomposition, decomposition.match.solver
        self._turns = np.flatnonzero(turning)
        self._cells = Cells.of(decomposition, cells_per_turn, self._origin)
        self._clear = _CLEAR
        if self._origin is not None:
            at_origin = self._solver.branch_margins(self._origin[None], decomposition.branches[0])[0]
            self._clear = float(np.minimum(_CLEAR, 0.5 * at_origin.min(initial=np.inf)))

    def _at_end(self, last: Layer) -> np.ndarray:
        """See `Lattice`: the motion ends in another posture of the end's cell, from which the plan goes on to it."""
        assert self.problem.end is not None  # noqa: S101
        allowed = np.full(self._robot.n, LARGEST_STEP)
        allowed[self._redundant] = self._cells.size
        return np.asarray(np.all(np.abs(last.q - self.problem.end) <= allowed, axis=1))

    def _first_layer(self, rng: np.random.Generator) -> Layer | dict[str, int]:
        """Make the node of the given posture, or nodes all over the ranges where none is given, or say why not."""
        r = self._cells.r
        if self._origin is not None:
            none, q = np.zeros(1, dtype=int), self._origin[None].astype(float)
            return Layer(np.zeros((1, r), dtype=int), none + self.decomposition.branches[0], q, q, q, np.zeros(1), none)
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
        cell, branch, q = cells[which[inside]], np.array(self.decomposition.branches)[branch[inside]], q[inside]
        nothing = np.zeros(len(q))
        return self._kept(Layer(cell, branch, q, q, q, nothing, nothing.astype(int)))

    def _answers(self, cells: np.ndarray, station: int) -> np.ndarray:
        """Non-redundant joints of all branches, (C, B, A, m)."""
        target = np.repeat(self._targets[station][None], len(cells), axis=0)
        return self._solver.solve(target, self._cells.positions(cells))

    def _edges(self, before: Layer, station: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of parents, (E,), and cells, (E, r), that may be joined; at the very end the given end's, too."""
        offsets = self._cells.neighbours(rng)
        parent = np.repeat(np.arange(len(before.branch)), len(offsets))
        edges = before.cell[parent] + np.tile(offsets, (len(before.branch), 1))
        end = self.problem.end
        if self._to_end and end is not None and station == len(self.s) - 1:
            aim = np.tile(self._cells.near(end[self._redundant]), (len(before.branch), 1))
            parent = np.append(parent, np.arange(len(before.branch)))
            edges = np.vstack([edges, aim])
        return parent, edges

    def _next(self, before: Layer, station: int, rng: np.random.Generator) -> Layer | dict[str, int]:
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
        low, high = np.minimum(before.low[parent], q), np.maximum(before.high[parent], q)
        found = exists[where, branch, alternative]
        with np.errstate(invalid="ignore"):
            inside = self._inside(low, high)
            near = np.all(np.abs(step) <= LARGEST_STEP, axis=1)
        good = found & inside.all(axis=1) & near
        if not good.any():
            return causes_of(self._robot, exists.any(axis=(1, 2))[where], found, inside, near)
        parent, where, step = parent[good], where[good], step[good]
        length = before.length[parent] + self._lengths(before.q, step, parent)
        layer = Layer(cells[where], branch[good], q[good], low[good], high[good], length, parent)
        turn = np.where(self._telling[self._turns], turn[good], 0.0)
        return self._kept(layer[shortest(length, np.column_stack([where, layer.branch, alternative[good], turn]))])

    def _kept(self, layer: Layer) -> Layer | dict[str, int]:
        """Keep nodes clear of the branch boundary that can be held against gravity, not too many of them."""
        clear = np.ones(len(layer.branch), dtype=bool)
        for branch in np.unique(layer.branch):
            own = layer.branch == branch
            margins = self._solver.branch_margins(layer.q[own], int(branch))
            clear[own] = margins.min(axis=1, initial=np.inf) >= self._clear
        held, refused = self._held(layer.q[clear])
        if not held.any():
            return refused | ({OTHER_BRANCH: int((~clear).sum())} if not clear.all() else {})
        kept = layer[np.flatnonzero(clear)[held]]
        return kept if self._cells.r <= 1 else kept.bounded(self._nodes, kept.length, self._robot, self.problem.limits)
