"""The lattice of all postures of the arm, regardless of branches and of choices of redundant joints.

At every node, the ranges of the r joints that move most in the arm's self-motion there are cut into cells. Newton's
method finds the postures in the surrounding cells at the next station. So every posture that a continuous motion
reaches from the previous nodes is found, at the spacing of the cells, and no boundary of a closed form's branch ends
the search. If neither end is given, the first layer comes from all available closed forms, which cover the whole
self-motion manifold. For arms without a closed form, the first layer comes from random postures. Two postures are
joined if no joint moves far and the step is along the self-motion: apart from what the next target requires of the
joints, most of the step lies in the null space of the Jacobian. With several redundant joints, cells are sampled, and a
layer keeps a bounded number of nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from brachis.ik.newton import null_spaces
from brachis.kinematics import Newton, moving_most, solve_each
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.joints import TURN
from brachis.search.closed_form_lattice import Cells, cell_sizes, solve_all
from brachis.search.joint_path import PosturePath, distinct, sampling_box
from brachis.search.lattice import (
    LARGEST_STEP,
    Edges,
    Lattice,
    Layer,
    Options,
    farthest,
    shortest,
)

_SAME = 1e-3
"""Spacing, rad or m, below which postures count as the same node."""
_LONGER = 1.5
"""Factor on the least length to a posture above which a joint path to it counts as a detour."""
_ALWAYS = 1e-3
"""Length, s^2, up to which no joint path counts as a detour."""


class PostureLattice(Lattice):
    """Lattice of all postures.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        Their closed forms give the first layer if neither end is given.
    only_minima : bool, optional
        Whether only joint paths of locally least length are taken if one joint is redundant.
    **options
        See `Lattice`.
    """

    def __init__(
        self,
        problem: Problem,
        decompositions: Sequence[Decomposition],
        *,
        only_minima: bool = True,
        **options: Unpack[Options],
    ) -> None:
        revolute = problem.robot.revolute
        super().__init__(problem, revolute, **options)
        self._only_minima = only_minima
        self._decompositions = decompositions
        self._r = problem.r
        self._size = cell_sizes(problem.robot, self._cells_per_turn)
        # Distance within which nodes are neighbours on the self-motion manifold.
        self._around = 3.0 * self._size.max()
        self._newton = Newton(problem.task_map)
        self._modulo = revolute & ~self._counts_turns
        # Postures at a free start, (K, n), from each of the decompositions, or random ones.
        self._seeds: list[np.ndarray] = []

    def _at_end(self, last: Layer) -> np.ndarray:
        """Tell which nodes, (K,) bool, are at the given end posture."""
        return np.abs(last.q - self.problem.end).max(axis=1) < _SAME

    def _choose(
        self, joint_paths: list[PosturePath], ends: Layer, count: int
    ) -> list[PosturePath]:
        """Choose joint paths no longer than the ones to neighbouring nodes, then different ones; name their seeds.

        With several redundant joints, the nodes are samples, which have no such minima.
        """
        chosen = []
        if self._r <= 1:
            first, second = self._near(ends.q, ends.q, self._around)
            same_label = ends.branch[first] == ends.branch[second]
            around = np.full(len(ends.q), np.inf)
            np.minimum.at(around, first[same_label], ends.length[second[same_label]])
            chosen = np.flatnonzero(around >= ends.length)[:count].tolist()
        if self._r > 1 or not self._only_minima:
            indices = distinct(joint_paths, count)
            chosen += [i for i in indices if i not in chosen][: count - len(chosen)]
        return [
            replace(joint_paths[i], seed=self._seed_of(joint_paths[i].q[0]))
            for i in chosen
        ]

    def _start_nodes(self, rng: np.random.Generator) -> Layer:
        """Create nodes spread over the self-motion manifold at the start of the path, one in each cell."""
        target = self._targets[:1]
        count = 4 * self._nodes
        seeds = []
        for decomposition in self._decompositions:
            cells = Cells.of(decomposition, self._cells_per_turn, None)
            q_r = cells.positions(cells.everywhere(count, rng))
            q = solve_all(decomposition, np.repeat(target, len(q_r), axis=0), q_r)
            seeds.append(q[np.isfinite(q).all(axis=3)])
        if not seeds:
            low, high = sampling_box(self._robot)
            drawn = rng.uniform(low, high, (count, len(low)))
            q = self._newton.nearest(np.repeat(target, count, axis=0), drawn)
            seeds.append(q[np.isfinite(q).all(axis=1)])
        self._seeds = seeds
        q = np.concatenate(seeds)
        _, one_per_cell = np.unique(self._key(q, self._size), axis=0, return_index=True)
        return Layer.start(q[one_per_cell], np.zeros(len(one_per_cell), dtype=int))

    def _seed_of(self, q: np.ndarray) -> str:
        """Name the closed form that gave a start posture, (n,); empty if the task gives it."""
        if not self._seeds:
            return ""
        if not self._decompositions:
            return "random"
        distances = [np.abs(self._step(q, seeds)).max(axis=1) for seeds in self._seeds]
        nearest = [distance.min(initial=np.inf) for distance in distances]
        return self._decompositions[int(np.argmin(nearest))].name

    def _choose_start_nodes(self, layer: Layer) -> Layer:
        """Label the start nodes; joint paths with different labels do not displace each other.

        With one redundant joint, each connected component of the self-motion manifold has a label. With several
        redundant joints, a few postures that are far apart have one label each.
        """
        q = layer.q
        if self._r > 1:
            scaled = q / self._size
            first = int(np.argmin(self._lengths_beside(q, 0)))
            others = farthest(scaled, scaled[[first]], 11)
            q = q[np.unique([first, *others])]
            return Layer.start(q, np.arange(len(q)))
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        pairs = self._near(q, q, self._around)
        graph = coo_array((np.ones(len(pairs[0])), pairs), shape=(len(q), len(q)))
        return Layer.start(q, connected_components(graph, directed=False)[1])

    def _key(self, q: np.ndarray, size: np.ndarray | float) -> np.ndarray:
        """Round postures to integer multiples, (K, n), of a spacing, after removal of turns that do not count."""
        return np.rint(self._without_turns(q) / size).astype(int)

    def _without_turns(self, q: np.ndarray) -> np.ndarray:
        """Return postures, (K, n), in which angles whose turns do not count are in [0, 2 pi)."""
        angle = q - TURN * np.floor(q / TURN)
        # Rounding may give a whole turn.
        return np.where(self._modulo, np.where(angle < TURN, angle, 0.0), q)

    def _edges(self, before: Layer, station: int, rng: np.random.Generator) -> Edges:
        """List edges to the postures in the cells around the nodes, along self-motion."""
        values, jacobian = self._newton.task_coordinates(before.q)
        # Null spaces, with the cell sizes as units of the joints.
        null = null_spaces(jacobian * self._size)
        task_step = self.problem.task_map.difference(
            self._targets[station][None], values
        )
        still = np.zeros((len(null), self._r))  # without self-motion
        rows = np.swapaxes(null, 1, 2) / self._size
        square = np.concatenate([jacobian, rows], axis=1)
        needed = solve_each(square, np.concatenate([task_step, still], axis=1))
        if self._r <= 1:
            around = self._at_cells(before.q, jacobian, null, task_step, station)
            parent, which = self._near(before.q, around, LARGEST_STEP)
            q = around[which]
        else:
            parent, q = self._sample(before.q, null, needed, station, rng)
        if self._to_end and station == len(self.s) - 1:
            end = np.array([self.problem.end])
            node, which = self._near(before.q, end, LARGEST_STEP)
            parent = np.append(parent, node)
            q = np.vstack([q, end[which]])
        step = self._step(before.q[parent], q)
        self_motion = (step - needed[parent]) / self._size
        is_small = np.all(np.abs(self_motion) <= 1.0, axis=1)
        # Postures across a fold of the manifold differ in other directions.
        along = np.linalg.norm(
            np.einsum("eir,ei->er", null[parent], self_motion), axis=1
        )
        return Edges(
            parent,
            step,
            np.column_stack([before.branch[parent], self._key(q, _SAME)]),
            allowed=is_small | (along >= 0.7 * np.linalg.norm(self_motion, axis=1)),
        )

    def _near(
        self, first: np.ndarray, second: np.ndarray, reach: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return pairs, (E,) and (E,), of postures between which no joint moves farther than `reach`."""
        from scipy.spatial import KDTree

        box = np.where(self._modulo, TURN, 0.0)
        first_tree, second_tree = (
            KDTree(self._without_turns(q), boxsize=box) for q in (first, second)
        )
        pairs = first_tree.sparse_distance_matrix(
            second_tree, reach, p=np.inf, output_type="ndarray"
        )
        return pairs["i"], pairs["j"]

    def _at_cells(
        self,
        q: np.ndarray,
        jacobian: np.ndarray,
        null: np.ndarray,
        task_step: np.ndarray,
        station: int,
    ) -> np.ndarray:
        """Return postures (C, n) in the cells around nodes with postures (K, n), close to the next station's target."""
        joints = moving_most(null)
        rows = np.eye(self._robot.n)[joints]
        size = self._size[joints]
        at = np.take_along_axis(q, joints, axis=1)
        offsets = np.arange(-2, 3)[:, None] if self._r else np.zeros((1, 0), dtype=int)
        which = np.repeat(np.arange(len(q)), len(offsets))
        cells = np.rint(at / size).astype(int)[which] + np.tile(offsets, (len(q), 1))
        levels = cells * size[which]
        augmented = np.concatenate([jacobian, rows], axis=1)[which]
        right = np.concatenate([task_step[which], levels - at[which]], axis=1)
        begun = q[which] + solve_each(augmented, right)
        regular = np.flatnonzero(np.isfinite(begun).all(axis=1))
        # Each posture is predicted once, from the node whose cell is closest.
        keys = [joints[which], cells, self._key(np.nan_to_num(begun), 0.5)]
        far = np.tile(np.abs(offsets).sum(axis=1), len(q)).astype(float)
        keys_of_regular = np.concatenate(keys, axis=1)[regular]
        chosen = regular[shortest(far[regular], keys_of_regular)]
        postures = self._project(
            begun[chosen], rows[which[chosen]], levels[chosen], station
        )
        postures = postures[np.isfinite(postures).all(axis=1)]
        _, one_per_node = np.unique(
            self._key(postures, _SAME), axis=0, return_index=True
        )
        return postures[one_per_node]

    def _sample(
        self,
        q: np.ndarray,
        null: np.ndarray,
        needed: np.ndarray,
        station: int,
        rng: np.random.Generator,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return nodes, (E,), and postures (E, n) around them, along each self-motion and at random."""
        r = self._r
        single = np.kron(np.eye(r), [[-1.0], [1.0], [-4.0], [4.0]])
        random = rng.normal(0.0, 2.5, (6, r))
        offsets = np.vstack([np.zeros((1, r)), single, random])
        aside = np.einsum("kij,oj->koi", null, offsets) * self._size
        if self._to_end:  # and towards the given end
            step_to_end = (self.problem.end - q) / max(1, len(self.s) - station)
            homing = np.einsum("kir,kjr,kj->ki", null, null, step_to_end / self._size)
            homing = homing * self._size
            aside = np.concatenate([aside, homing[:, None]], axis=1)
        parent = np.repeat(np.arange(len(q)), aside.shape[1])
        begun = ((q + needed)[:, None] + aside).reshape(len(parent), -1)
        rows = (np.swapaxes(null, 1, 2) / self._size)[parent]
        levels = np.einsum("kij,kj->ki", rows, begun)
        postures = self._project(begun, rows, levels, station)
        exists = np.isfinite(postures).all(axis=1)
        return parent[exists], postures[exists]

    def _project(
        self, q: np.ndarray, rows: np.ndarray, levels: np.ndarray, station: int
    ) -> np.ndarray:
        """Return postures (C, n) close to given ones that meet a station's target; see `Newton.solve`."""
        targets = np.repeat(self._targets[station][None], len(q), axis=0)
        return self._newton.solve(targets, q, rows, levels)

    def _thin(self, layer: Layer) -> Layer:
        """Keep a bounded number of nodes of each label; with one redundant joint, keep those that are no detours."""
        if self._r <= 1:
            return layer[self._is_short(layer)]
        labels = np.unique(layer.branch)
        per_label = max(10, self._nodes // len(labels))
        nodes_by_label = (np.flatnonzero(layer.branch == label) for label in labels)
        chosen = [
            nodes[self._choose_some(layer[nodes], per_label)]
            for nodes in nodes_by_label
        ]
        return layer[np.concatenate(chosen)]

    def _is_short(self, layer: Layer) -> np.ndarray:
        """Tell which nodes, (K,) bool, are reached at little more than the least length to the same posture."""
        keys = self._key(layer.q, _SAME)
        postures = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
        least = np.full(len(keys), np.inf)
        np.minimum.at(least, postures, layer.length)
        return layer.length <= _LONGER * least[postures] + _ALWAYS
