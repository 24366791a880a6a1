"""The lattice of all postures of the arm, whatever branch or choice of joints they are of.

At every node the r joints that move most in the arm's self-motion there are cut into
cells; the postures at the cells around, at the next station, follow by Newton's method.
So every posture that a continuous motion reaches from the nodes before is found, at the
spacing of the cells, and no closed form ends it. Where neither end is given, the first
layer comes from all closed forms there are, which see the whole self-motion manifold, or,
for arms without one, from random postures. Two postures are joined if no joint moves far
and the step is along the self-motion: what the next target asks of the joints apart, most
of it lies in the null space of the Jacobian. Of several redundant joints, cells are
sampled, and a layer keeps a bounded number of nodes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.kinematics import Newton, moving_most, null_spaces, solve_each
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.joints import TURN, complement
from brachis.search.closed_form_lattice import Cells, cell_sizes
from brachis.search.joint_path import JointPath, distinct, sampling_box
from brachis.search.lattice import (
    LARGEST_STEP,
    Edges,
    Lattice,
    Layer,
    farthest,
    shortest,
)


def start_postures(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    newton: Newton,
    cells_per_turn: int,
    count: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Find postures all over the self-motion manifold at the path's beginning, ranges left out of account.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        Their closed forms give the postures, on all branches.
    newton : Newton
        Brings random postures to the beginning where there is no closed form.
    cells_per_turn : int
        Spacing of a single redundant joint; see `Cells`.
    count : int
        Choices of several redundant joints, or random postures.
    rng : Generator

    Returns
    -------
    q : (K, n) ndarray
        rad or m.
    seeds : (K,) int ndarray
        Which of the decompositions gave it; -1 where chance did.
    """
    target = problem.path.sample(np.zeros(1)).target
    if not decompositions:
        low, high = sampling_box(problem.robot)
        drawn = rng.uniform(low, high, (count, problem.robot.n))
        q = newton.nearest(np.repeat(target, count, axis=0), drawn)
        q = q[np.isfinite(q).all(axis=1)]
        return q, np.full(len(q), -1)
    found = []
    for decomposition in decompositions:
        cells = Cells.of(decomposition, cells_per_turn, None)
        q_r = cells.positions(cells.everywhere(count, rng))
        answers = decomposition.match.solver.solve(
            np.repeat(target, len(q_r), axis=0), q_r
        )
        q = np.empty((*answers.shape[:3], problem.robot.n))
        q[..., list(decomposition.redundant)] = q_r[:, None, None]
        q[..., complement(problem.robot.n, decomposition.redundant)] = answers
        found.append(q[np.isfinite(q).all(axis=3)])
    return np.concatenate(found), np.repeat(
        np.arange(len(found)), [len(q) for q in found]
    )


_SAME = 1e-3
"""Spacing, rad or m, below which postures are the same node."""
_AROUND = 3.0
"""Distance, in cells, within which nodes are neighbours on the self-motion manifold."""


class PostureLattice(Lattice):
    """Lattice of all postures.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        Whose closed forms give the first layer where neither end is given.
    cells_per_turn : int, optional
        Cells of a turn of a revolute joint; a metre of a prismatic joint has a third as many.
    only_minima : bool, optional
        Whether of one redundant joint only joint paths of locally least length are taken.
    density, nodes, seed, deadline
        See `Lattice`.
    """

    def __init__(
        self,
        problem: Problem,
        decompositions: Sequence[Decomposition],
        *,
        cells_per_turn: int = 72,
        density: float = 1.0,
        nodes: int = 120,
        only_minima: bool = True,
        seed: int = 0,
        deadline: Deadline = NEVER,
    ) -> None:
        super().__init__(
            problem,
            problem.robot.revolute,
            density=density,
            nodes=nodes,
            seed=seed,
            deadline=deadline,
        )
        self._only_minima = only_minima
        self._decompositions = decompositions
        self._cells_per_turn = cells_per_turn
        revolute = problem.robot.revolute
        self._r = problem.robot.n - problem.task_map.m
        self._size = cell_sizes(revolute, cells_per_turn)
        self._newton = Newton(problem.task_map)
        self._modulo = revolute & ~self._counts_turns
        self._seeds: tuple[np.ndarray, np.ndarray] | None = None

    def _at_end(self, last: Layer) -> np.ndarray:
        """Tell which nodes of the last layer, (K,) bool, are the given end posture."""
        assert self.problem.end is not None
        return np.asarray(np.abs(last.q - self.problem.end).max(axis=1) < _SAME)

    def _choose(
        self, found: list[JointPath], ends: Layer, most: int
    ) -> list[JointPath]:
        """Choose joint paths, and name the closed forms from which they start."""
        return [
            dataclasses.replace(each, seed=self._seed_of(each.q[0]))
            for each in self._choose_minima(found, ends, most)
        ]

    def _choose_minima(
        self, found: list[JointPath], ends: Layer, most: int
    ) -> list[JointPath]:
        """Choose those no longer than any to a node around theirs, then some that differ.

        Of several redundant joints the nodes are samples: there are no such minima.
        """
        if self._r > 1:
            return distinct(found, most)
        first, second = self._near(ends.q, ends.q, _AROUND * float(self._size.max()))
        own = ends.branch[first] == ends.branch[second]
        around = np.full(len(ends.q), np.inf)
        np.minimum.at(around, first[own], ends.length[second[own]])
        least = around >= ends.length
        minima = [
            joint_path
            for joint_path, is_one in zip(found, least, strict=True)
            if is_one
        ][:most]
        if self._only_minima:
            return minima
        others = [
            each
            for each in distinct(found, most)
            if not any(each is one for one in minima)
        ]
        return minima + others[: most - len(minima)]

    def _start_nodes(self, rng: np.random.Generator) -> Layer:
        """Make nodes all over the self-motion manifold, one in a cell."""
        self._seeds = start_postures(
            self.problem,
            self._decompositions,
            self._newton,
            self._cells_per_turn,
            4 * self._nodes,
            rng,
        )
        q, seeds = self._seeds
        _, kept = np.unique(self._key(q, self._size), axis=0, return_index=True)
        return Layer.start(q[kept], seeds[kept])

    def _seed_of(self, q: np.ndarray) -> str:
        """Name the closed form that gave the start, (n,); empty where it was given."""
        if self._seeds is None:
            return ""
        postures, seeds = self._seeds
        nearest = int(np.abs(self._step(q, postures)).max(axis=1).argmin())
        if seeds[nearest] < 0:
            return "random"
        return self._decompositions[seeds[nearest]].name

    def _choose_starts(self, layer: Layer) -> Layer:
        """Label the starts: joint paths of different labels do not displace each other.

        Of one redundant joint a label is a connected component of the self-motion
        manifold; of several, a few postures far from each other have one each.
        """
        q = layer.q
        if self._r > 1:
            scaled = q / self._size
            chosen = np.unique([0, *farthest(scaled, scaled[:1], 11)])
            return Layer.start(q[chosen], np.arange(len(chosen)))
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        first, second = self._near(q, q, _AROUND * float(self._size.max()))
        graph = coo_array(
            (np.ones(len(first)), (first, second)), shape=(len(q), len(q))
        )
        return Layer.start(q, connected_components(graph, directed=False)[1])

    def _key(self, q: np.ndarray, size: np.ndarray | float) -> np.ndarray:
        """Round postures to whole numbers of a spacing, (K, n), without turns that do not count."""
        return np.rint(np.where(self._modulo, np.remainder(q, TURN), q) / size).astype(
            int
        )

    def _edges(self, before: Layer, station: int, rng: np.random.Generator) -> Edges:
        """List edges to the postures at the cells around the nodes, along self-motion."""
        values, jacobian = self._newton.task_coordinates(before.q)
        null = null_spaces(jacobian)
        wanted = self.problem.task_map.difference(self._targets[station][None], values)
        still = np.zeros((len(null), self._r))  # without self-motion
        square = np.concatenate([jacobian, np.swapaxes(null, 1, 2)], axis=1)
        needed = solve_each(square, np.concatenate([wanted, still], axis=1))
        if self._r <= 1:
            around = self._at_cells(before.q, jacobian, null, wanted, station)
            parent, q = self._pairs(before.q, around)
        else:
            parent, q = self._sample(before.q, null, needed, station, rng)
        if self._to_end and station == len(self.s) - 1:
            node, end = self._pairs(before.q, np.array([self.problem.end]))
            parent = np.append(parent, node)
            q = np.vstack([q, end])
        step = self._step(before.q[parent], q)
        own = step - needed[parent]
        small = np.all(np.abs(own) <= self._size, axis=1)
        # Postures across a fold of the manifold differ in other directions.
        along = np.linalg.norm(np.einsum("eir,ei->er", null[parent], own), axis=1)
        return Edges(
            parent,
            step,
            np.column_stack([before.branch[parent], self._key(q, _SAME)]),
            np.ones(len(parent), dtype=bool),
            small | (along >= 0.7 * np.linalg.norm(own, axis=1)),
        )

    def _pairs(
        self, before: np.ndarray, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nodes, (E,), with postures (E, n) of those given, (C, n), to which no joint moves far."""
        node, posture = self._near(before, q, LARGEST_STEP)
        return node, q[posture]

    def _near(
        self, first: np.ndarray, second: np.ndarray, reach: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs, (E,) and (E,), of postures between which no joint moves farther than `reach`."""
        from scipy.spatial import KDTree

        box = np.where(self._modulo, TURN, 0.0)
        one, other = (
            KDTree(np.where(self._modulo, np.remainder(q, TURN) % TURN, q), boxsize=box)
            for q in (first, second)
        )
        pairs = one.sparse_distance_matrix(
            other, reach, p=np.inf, output_type="ndarray"
        )
        return pairs["i"], pairs["j"]

    def _at_cells(
        self,
        q: np.ndarray,
        jacobian: np.ndarray,
        null: np.ndarray,
        wanted: np.ndarray,
        station: int,
    ) -> np.ndarray:
        """Postures (C, n) at the cells around nodes with postures (K, n), on the way to the next station's target."""
        joints = moving_most(null / self._size[:, None])
        rows = np.eye(self._robot.n)[joints]
        size = self._size[joints]
        at = np.take_along_axis(q, joints, axis=1)
        offsets = np.arange(-2, 3)[:, None] if self._r else np.zeros((1, 0), dtype=int)
        cells = np.rint(at / size).astype(int)[:, None] + offsets
        levels = cells * size[:, None]
        moved = levels - at[:, None]
        right = np.concatenate(
            [
                np.broadcast_to(wanted[:, None], (*moved.shape[:2], wanted.shape[1])),
                moved,
            ],
            axis=2,
        )
        augmented = np.concatenate([jacobian, rows], axis=1)
        which = np.repeat(np.arange(len(q)), len(offsets))
        cells, levels, right = (
            part.reshape(len(which), -1) for part in (cells, levels, right)
        )
        begun = q[which] + solve_each(augmented[which], right)
        regular = np.isfinite(begun).all(axis=1)
        which, begun, cells, levels = (
            part[regular] for part in (which, begun, cells, levels)
        )
        keys = np.concatenate([joints[which], cells, self._key(begun, 0.5)], axis=1)
        far = np.tile(np.abs(offsets).sum(axis=1), len(q))[regular]
        chosen = shortest(far.astype(float), keys)
        found = self._project(
            begun[chosen], rows[which[chosen]], levels[chosen], station
        )
        found = found[np.isfinite(found).all(axis=1)]
        return np.asarray(
            found[np.unique(self._key(found, _SAME), axis=0, return_index=True)[1]]
        )

    def _sample(
        self,
        q: np.ndarray,
        null: np.ndarray,
        needed: np.ndarray,
        station: int,
        rng: np.random.Generator,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nodes, (E,), and postures (E, n) around them: along each direction of self-motion, and at random."""
        single = [
            sign * step * row
            for row in np.eye(self._r)
            for step in (1.0, 4.0)
            for sign in (-1.0, 1.0)
        ]
        offsets = np.vstack(
            [
                np.zeros((1, self._r)),
                single,
                rng.normal(0.0, 2.5, (6, self._r)),
            ]
        )
        aside = np.einsum("kij,oj->koi", null, offsets) * self._size
        if self._to_end:  # one more: a part of the way to the given end
            left = self.problem.end - q
            homing = np.einsum("kir,kjr,kj->ki", null, null, left) / max(
                1, len(self.s) - station
            )
            aside = np.concatenate([aside, homing[:, None]], axis=1)
        parent = np.repeat(np.arange(len(q)), aside.shape[1])
        begun = ((q + needed)[:, None] + aside).reshape(len(parent), -1)
        rows = np.swapaxes(null, 1, 2)[parent]
        found = self._project(
            begun, rows, np.einsum("kij,kj->ki", rows, begun), station
        )
        exists = np.isfinite(found).all(axis=1)
        return parent[exists], found[exists]

    def _project(
        self, q: np.ndarray, rows: np.ndarray, levels: np.ndarray, station: int
    ) -> np.ndarray:
        """Postures (C, n) near given ones that meet a station's target; see `Newton.solve`."""
        return self._newton.solve(
            np.repeat(self._targets[station][None], len(q), axis=0), q, rows, levels
        )

    def _thin(self, layer: Layer) -> Layer:
        """Keep a bounded number of nodes of each label, of several redundant joints."""
        if self._r <= 1:
            return layer
        cost = layer.length
        if self._to_end:
            left = self.problem.end - layer.q
            cost = cost + self._lengths(layer.q, left, np.arange(len(left)))
        labels = np.unique(layer.branch)
        most = max(10, self._nodes // len(labels))
        parts = []
        for label in labels:
            own = layer.branch == label
            part = layer[own].thin(most, cost[own], self._robot, self.problem.limits)
            parts.append(part)
        return Layer(
            *(
                np.concatenate([getattr(part, each.name) for part in parts])
                for each in fields(Layer)
            )
        )
