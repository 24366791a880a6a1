"""The lattice of all postures of the arm, whatever branch or choice of redundant joints they belong to.

At every node the r joints that move most in the arm's self-motion there are cut into cells; the postures at the cells
around, at the next station, follow by Newton's method. So every posture that a continuous motion reaches from the
nodes before is found, at the spacing of the cells, and no closed form ends it. Where neither end is given, the first
layer comes from all closed forms there are, which see the whole self-motion manifold, or, for arms without one, from
random postures. Two postures are joined if no joint moves far and the step is along the self-motion: what the next
target asks of the joints apart, most of it lies in the null space of the Jacobian. Of several redundant joints, cells
are sampled, and a layer keeps a bounded number of nodes.

Postures at the beginning of a path whose start is free.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.kinematics import Newton, moving_most, null_spaces, solved_each
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.joints import TURN, complement
from brachis.search.closed_form_lattice import Cells, cell_sizes
from brachis.search.joint_path import (
    NO_ANSWER,
    JointPath,
    beyond_ranges,
    causes_of,
    distinct,
)
from brachis.search.lattice import LARGEST_STEP, Lattice, Layer, farthest, shortest

_REACH = 10.0
"""Half of what is drawn of a slide without a range, m."""


def beginnings(
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
        drawn = _drawn(problem, count, rng)
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


def _drawn(problem: Problem, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw postures, (count, n), from the ranges; of joints without one from a turn or from twice the reach."""
    limits, reach = (
        problem.robot.limits,
        np.where(problem.robot.revolute, np.pi, _REACH),
    )
    lower, upper = limits.position_lower, limits.position_upper
    low = np.where(
        np.isfinite(lower),
        lower,
        np.where(np.isfinite(upper), upper, reach) - 2.0 * reach,
    )
    high = np.where(np.isfinite(upper), upper, low + 2.0 * reach)
    return rng.uniform(low, high, (count, problem.robot.n))


_NEIGHBOURS = (-2, -1, 0, 1, 2)
_STEPS, _RANDOM, _SPREAD = (1.0, 4.0), 6, 2.5  # cells
_COARSE, _SAME = 0.5, 1e-3  # rad or m
_ALONG = 0.7
"""Least part of a step that is self-motion; postures across a fold of the manifold differ in other directions."""
_AROUND = 3.0  # cells
_BEGINNINGS, _LEAST_NODES = 12, 10
"""Free starts of several redundant joints, and nodes that the joint paths from each keep at least."""
_STARTS = 4  # times the nodes of a layer


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
        self._decompositions, self._cells_per_turn = decompositions, cells_per_turn
        revolute = problem.robot.revolute
        self._r = problem.robot.n - problem.task_map.m
        self._size = cell_sizes(revolute, cells_per_turn)
        self._newton = Newton(problem.task_map)
        self._modulo = revolute & ~self._telling
        self._begun: tuple[np.ndarray, np.ndarray] | None = None

    def _at_end(self, last: Layer) -> np.ndarray:
        """See `Lattice`."""
        assert self.problem.end is not None
        return np.asarray(np.abs(last.q - self.problem.end).max(axis=1) < _SAME)

    def _chosen(
        self, found: list[JointPath], ends: Layer, most: int
    ) -> list[JointPath]:
        """See `Lattice`: those that are no longer than any to a node around theirs, then others that differ.

        Of several redundant joints the nodes are samples, among which there are no such minima.
        """
        return [
            dataclasses.replace(each, seed=self._begun_by(each.q[0]))
            for each in self._distinct(found, ends, most)
        ]

    def _distinct(
        self, found: list[JointPath], ends: Layer, most: int
    ) -> list[JointPath]:
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

    def _first_layer(self, rng: np.random.Generator) -> Layer | dict[str, int]:
        """See `Lattice`."""
        if self._origin is not None:
            return _layer(self._origin[None].astype(float), np.zeros(1, dtype=int))
        count = _STARTS * self._nodes
        self._begun = beginnings(
            self.problem,
            self._decompositions,
            self._newton,
            self._cells_per_turn,
            count,
            rng,
        )
        q, _ = self._begun
        if not len(q):
            return {NO_ANSWER: 1}
        _, kept = np.unique(self._key(q, self._size), axis=0, return_index=True)
        q = q[kept]
        within = self._inside(q, q)
        if not within.all(axis=1).any():
            return beyond_ranges(self._robot, within)
        q = q[within.all(axis=1)]
        held, refused = self._held(q)
        return _layer(*self._told_apart(q[held])) if held.any() else refused

    def _begun_by(self, q: np.ndarray) -> str:
        """Tell whose closed form gave a posture, (n,), of the first layer; empty where it was given."""
        if self._begun is None:
            return ""
        postures, seeds = self._begun
        nearest = int(np.abs(self._step(q, postures)).max(axis=1).argmin())
        return (
            "random"
            if seeds[nearest] < 0
            else self._decompositions[seeds[nearest]].name
        )

    def _told_apart(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return starts, (K, n), and labels, (K,): joint paths of different labels do not displace each other.

        Of one redundant joint the parts of the self-motion manifold, which hang together; of several, a few postures
        far from each other, each for itself.
        """
        if self._r > 1:
            scaled = q / self._size
            chosen = np.unique([0, *farthest(scaled, scaled[:1], _BEGINNINGS - 1)])
            return q[chosen], np.arange(len(chosen))
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        first, second = self._near(q, q, _AROUND * float(self._size.max()))
        graph = coo_array(
            (np.ones(len(first)), (first, second)), shape=(len(q), len(q))
        )
        return q, connected_components(graph, directed=False)[1]

    def _key(self, q: np.ndarray, size: np.ndarray | float) -> np.ndarray:
        """Whole numbers, (K, n), by which postures are told apart at a spacing; turns that nobody asks for left out."""
        return np.rint(np.where(self._modulo, np.remainder(q, TURN), q) / size).astype(
            int
        )

    def _next(
        self, before: Layer, station: int, rng: np.random.Generator
    ) -> Layer | dict[str, int]:
        """See `Lattice`."""
        values, jacobian = self._newton.placed(before.q)
        null = null_spaces(jacobian)
        wanted = self.problem.task_map.difference(self._targets[station][None], values)
        still = np.zeros((len(null), self._r))  # without self-motion
        square = np.concatenate([jacobian, np.swapaxes(null, 1, 2)], axis=1)
        needed = solved_each(square, np.concatenate([wanted, still], axis=1))
        if self._r <= 1:
            parent, q = self._pairs(
                before.q, self._at_cells(before.q, jacobian, null, wanted, station)
            )
        else:
            parent, q = self._sampled(before.q, null, needed, station, rng)
        if self._to_end and station == len(self.s) - 1:
            own, end = self._pairs(before.q, np.array([self.problem.end]))
            parent, q = np.append(parent, own), np.vstack([q, end])
        if not len(q):
            return {NO_ANSWER: len(before.q)}
        step = self._step(before.q[parent], q)
        near = np.all(np.abs(step) <= LARGEST_STEP, axis=1)
        own = step - needed[parent]
        near &= np.all(np.abs(own) <= self._size, axis=1) | (
            np.linalg.norm(np.einsum("eir,ei->er", null[parent], own), axis=1)
            >= _ALONG * np.linalg.norm(own, axis=1)
        )
        low, high = (
            bound(part[parent], before.q[parent] + step)
            for bound, part in ((np.minimum, before.low), (np.maximum, before.high))
        )
        inside = self._inside(low, high)
        good = near & inside.all(axis=1)
        if not good.any():
            every = np.ones(len(q), dtype=bool)
            return causes_of(self._robot, every, every, inside, near)
        parent, step, q = parent[good], step[good], q[good]
        length = before.length[parent] + self._lengths(before.q, step, parent)
        branch = before.branch[parent]
        layer = Layer(
            _no_cells(branch),
            branch,
            before.q[parent] + step,
            low[good],
            high[good],
            length,
            parent,
        )
        return self._kept(
            layer[shortest(length, np.column_stack([branch, self._key(q, _SAME)]))]
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

    def _step(self, before: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return the steps, (E, n), from postures to others; modulo 2 pi where nobody asks for turns."""
        step = q - before
        return np.where(self._modulo, step - TURN * np.round(step / TURN), step)

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
        rows, size = np.eye(self._robot.n)[joints], self._size[joints]
        at = np.take_along_axis(q, joints, axis=1)
        offsets = (
            np.array(_NEIGHBOURS)[:, None] if self._r else np.zeros((1, 0), dtype=int)
        )
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
        begun = q[which] + solved_each(augmented[which], right)
        regular = np.isfinite(begun).all(axis=1)
        which, begun, cells, levels = (
            part[regular] for part in (which, begun, cells, levels)
        )
        keys = np.concatenate([joints[which], cells, self._key(begun, _COARSE)], axis=1)
        far = np.tile(np.abs(offsets).sum(axis=1), len(q))[regular]
        chosen = shortest(far.astype(float), keys)
        found = self._met(begun[chosen], rows[which[chosen]], levels[chosen], station)
        found = found[np.isfinite(found).all(axis=1)]
        return np.asarray(
            found[np.unique(self._key(found, _SAME), axis=0, return_index=True)[1]]
        )

    def _sampled(
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
            for step in _STEPS
            for sign in (-1.0, 1.0)
        ]
        offsets = np.vstack(
            [
                np.zeros((1, self._r)),
                single,
                rng.normal(0.0, _SPREAD, (_RANDOM, self._r)),
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
        found = self._met(begun, rows, _product(rows, begun), station)
        exists = np.isfinite(found).all(axis=1)
        return parent[exists], found[exists]

    def _met(
        self, q: np.ndarray, rows: np.ndarray, levels: np.ndarray, station: int
    ) -> np.ndarray:
        """Postures (C, n) near given ones that meet a station's target; see `Newton.solve`."""
        return self._newton.solve(
            np.repeat(self._targets[station][None], len(q), axis=0), q, rows, levels
        )

    def _kept(self, layer: Layer) -> Layer | dict[str, int]:
        """Keep nodes that can be held against gravity, not too many of them."""
        held, refused = self._held(layer.q)
        if not held.any():
            return refused
        kept = layer[held]
        if self._r <= 1:
            return kept
        cost = kept.length
        if self._to_end:
            cost = cost + self._lengths(
                kept.q, self.problem.end - kept.q, np.arange(len(kept.q))
            )
        own = [
            np.flatnonzero(kept.branch == branch) for branch in np.unique(kept.branch)
        ]
        most = max(_LEAST_NODES, self._nodes // len(own))
        parts = [
            kept[nodes].bounded(most, cost[nodes], self._robot, self.problem.limits)
            for nodes in own
        ]
        return Layer(
            *(
                np.concatenate([getattr(part, each.name) for part in parts])
                for each in fields(Layer)
            )
        )


def _layer(q: np.ndarray, branch: np.ndarray) -> Layer:
    """Nodes, (K, n), with which joint paths begin, and what tells these apart, (K,)."""
    return Layer(
        _no_cells(branch),
        branch,
        q,
        q,
        q,
        np.zeros(len(q)),
        np.zeros(len(q), dtype=int),
    )


def _no_cells(branch: np.ndarray) -> np.ndarray:
    """Cells of nodes that have none, (K, 0)."""
    return np.zeros((len(branch), 0), dtype=int)


def _product(rows: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("kij,kj->ki", rows, q))
