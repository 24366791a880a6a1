"""The lattice: joint paths along the path, by dynamic programming over postures.

The path is cut into stations. Layer by layer from the given start, the nodes of a layer
(postures that meet the target at its station) are joined to postures at the next station
that are within the joint ranges, near, and allowed at rest (the torque limits hold the
arm against gravity). Of all edges into a node the one with the least total length stays.
If the end posture is given and the start is not, the layers run backwards from the
end. Nodes are all postures that a continuous motion reaches (see `self_motion`), whatever
branch or choice of joints they are of; or, where the task names its redundant joints or
its branch, those on a branch of that closed form, and clear of its boundary.

If neither end is given, the first layer comes from all closed forms there are, which see
the whole self-motion manifold, or, for arms without one, from random postures. Of several
redundant joints a layer keeps a bounded number of nodes, half of them the nearest and half
far apart.

Turns of angles by 2 pi follow the joint path. From a given posture, nodes in different
turns are different nodes. If neither end is given, all turns of a joint path are
equivalent: a node keeps how far its joints have gone, and is within the ranges as long as
some multiple of 2 pi brings the whole joint path there. The length of an edge,

    max |A(q) dq|  +  T max |B(q) dq|

with the rows A (M / tau_max, 1 / a_max) and B (1 / v_max) of `HasLatticeWeights`, does not
depend on how fast the joint path is followed: with the first term alone the time of a
straight one is 2 sqrt(length).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.kernel import largest_parts
from brachis.limits import HasLatticeWeights
from brachis.optimise.retiming import ROUGH_MARGIN
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.joints import TURN
from brachis.search.joint_path import (
    JUMPS,
    NO_ANSWER,
    NO_TIME,
    OTHER_BRANCH,
    DeadEnd,
    JointPath,
    distinct,
    least_excess,
    leaving_range,
    weights_near,
)
from brachis.search.postures import reaches, sampling_box, solve_all, spread_redundant
from brachis.search.self_motion import LARGEST_STEP, SAME, SelfMotion, shortest
from brachis.search.stations import stations

_HOMEWARD = 0.6
"""Part of the largest step that joints may need at every station before a given end."""
_LOOKS = 9
"""Postures on a step that are looked at, to name what is in the way."""
_OTHER_WAYS = 3
"""Ways to a node, after the shortest one, that are tried where something is in the way."""
_SLACK = 1e-9
"""Rounding of joint positions, rad or m, and of ratios to limits."""
_LONGER = 1.5
"""Factor on the least length to a posture above which a joint path to it comes a long way round."""
_ALWAYS = 1e-3
"""Length, s^2, up to which no way counts as long."""


@dataclass(frozen=True)
class Layer:
    """Nodes at a station.

    Attributes
    ----------
    branch : (K,) int ndarray
        What joint paths keep: index into the closed form's branches, or which postures they began with.
    q : (K, n) ndarray
        Postures, rad or m, continuous along the joint paths there.
    low, high : (K, n) ndarray
        Least and largest positions along the joint path to the node.
    length : (K,) ndarray
        Of the shortest joint path to the node.
    parent : (K,) int ndarray
        Its last node in the layer before.
    """

    branch: np.ndarray
    q: np.ndarray
    low: np.ndarray
    high: np.ndarray
    length: np.ndarray
    parent: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> Layer:
        """Return some of the nodes, by index or mask."""
        return Layer(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @classmethod
    def start(cls, q: np.ndarray, branch: np.ndarray) -> Layer:
        """Make nodes, (K, n), with which joint paths begin, and their branches, (K,)."""
        return cls(branch, q, q, q, np.zeros(len(q)), np.zeros(len(q), dtype=int))


def farthest(points: np.ndarray, references: np.ndarray, count: int) -> list[int]:
    """Choose points, (K, n), each the farthest from all references, (H, n), and all chosen before."""
    distance = np.abs(points[:, None] - references[None]).max(axis=2).min(axis=1)
    chosen = []
    for _ in range(count):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.abs(points - points[chosen[-1]]).max(axis=1))
    return chosen


class Lattice:
    """Lattice of postures along a path.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        Their closed forms give the first layer if neither end is given.
    keeps_branch : bool, optional
        Whether joint paths stay on a branch of the only decomposition.
    only_minima : bool, optional
        Whether of one redundant joint only joint paths of locally least length are taken.
    cells_per_turn : int, optional
        Cells of a turn of a revolute joint; a metre of a prismatic joint has a third as many.
    density : float, optional
        Factor on the number of stations.
    nodes : int, optional
        Nodes that a layer keeps with several redundant joints.
    deadline : Deadline, optional
        No layer is begun after it.
    """

    def __init__(
        self,
        problem: Problem,
        decompositions: Sequence[Decomposition],
        *,
        keeps_branch: bool = False,
        only_minima: bool = True,
        cells_per_turn: int = 72,
        density: float = 1.0,
        nodes: int = 120,
        deadline: Deadline = NEVER,
    ) -> None:
        self.problem = problem
        self.s = stations(problem.path, problem.task_map, density)
        self._robot = problem.robot
        self._decompositions = decompositions
        self._keeps_branch = keeps_branch
        self._only_minima = only_minima
        self._cells_per_turn = cells_per_turn
        self._nodes = nodes
        self._deadline = deadline
        self._backwards = problem.start is None and problem.end is not None
        self._origin = problem.end if self._backwards else problem.start
        self._targets = problem.path.sample(self.s).target
        limits = problem.robot.limits
        self._lower = limits.position_lower - _SLACK
        self._upper = limits.position_upper + _SLACK
        # With a free start all turns are equivalent, and stay open until the joint path is known; a joint without a
        # range needs no turn, unless a given end has to be met.
        turning = problem.robot.revolute
        self._open_turns = turning & (self._origin is None)
        self._to_end = problem.end is not None and not self._backwards
        ranged = np.isfinite(self._lower) | np.isfinite(self._upper) | self._to_end
        counts_turns = turning & ranged & ~self._open_turns
        self._self_motion = SelfMotion(
            problem,
            self._targets,
            problem.end if self._to_end else None,
            turning & ~counts_turns,
            cells_per_turn,
            keeps_branch=keeps_branch,
        )
        # Distance within which nodes are neighbours on the self-motion manifold.
        self._around = 3.0 * self._self_motion.size.max()
        # Postures at a free start, (K, n), that each of the decompositions gave; or random ones.
        self._seeds: list[np.ndarray] = []
        # Branch margin that nodes on a branch keep.
        self._clear = ROUGH_MARGIN
        if keeps_branch:
            (self._decomposition,) = decompositions
            if self._origin is not None:
                self._clear = min(ROUGH_MARGIN, 0.5 * self._decomposition.clearance)

    def joint_paths(self, count: int) -> list[JointPath] | DeadEnd:
        """Find joint paths along the path.

        Parameters
        ----------
        count : int
            How many, no more.

        Returns
        -------
        list of JointPath or DeadEnd
            Distinct ones, the shortest first, or where the lattice ends.
        """
        rng = np.random.default_rng(self.problem.task.search.seed)
        layers: list[Layer] = []
        numbers = range(len(self.s))
        for station in numbers[:: -1 if self._backwards else 1]:
            layer: Layer | str
            if self._deadline.passed:
                layer = NO_TIME
            elif layers:
                layer = self._next(layers[-1], station, rng)
            else:
                layer = self._first_layer(rng)
            if isinstance(layer, str):
                s = float(self.s[station])
                if layer == NO_ANSWER and reaches(self.problem, s):
                    layer = JUMPS
                return DeadEnd(s, layer, backwards=self._backwards)
            layers.append(layer)
        length = layers[-1].length
        ends = np.argsort(length, kind="stable")
        if self._to_end:
            ends = ends[self._at_end(layers[-1])[ends]]
        ends = ends[length[ends] <= 4.0 * length[ends[:1]] + _SLACK]
        if not len(ends):
            return DeadEnd(1.0, JUMPS)
        last = layers[-1][ends]
        traced = []
        for layer in reversed(layers):
            traced.append(layer.q[ends])
            ends = layer.parent[ends]
        in_order = np.array(traced if self._backwards else traced[::-1])
        q = in_order.swapaxes(0, 1) + TURN * self._turn_of(last)[:, None]
        joint_paths = [
            JointPath(self.problem, self.s, postures, float(length), int(branch))
            for postures, length, branch in zip(
                q, last.length, last.branch, strict=True
            )
        ]
        return self._choose(joint_paths, last, count)

    def _first_layer(self, rng: np.random.Generator) -> Layer | str:
        """Make the nodes with which joint paths begin, or tell what refuses them."""
        if self._origin is not None:
            branch = self._decomposition.branches[0] if self._keeps_branch else 0
            return Layer.start(self._origin[None].astype(float), np.array([branch]))
        layer = self._start_nodes(rng)
        if not len(layer.q):
            return NO_ANSWER
        inside = self._inside(layer.q, layer.q)
        within = np.flatnonzero(inside.all(axis=1))
        if not len(within):
            return leaving_range(self._robot, inside)
        return self._keep(layer[within], self._choose_start_nodes)

    def _next(
        self, before: Layer, station: int, rng: np.random.Generator
    ) -> Layer | str:
        """Join the nodes of a layer to the next station, or tell why none can be."""
        edges = self._self_motion.edges(before.q, station, rng)
        parent = edges.parent
        q = before.q[parent] + edges.step
        low = np.minimum(before.low[parent], q)
        high = np.maximum(before.high[parent], q)
        inside = self._inside(low, high)
        good = edges.allowed & inside.all(axis=1)
        if not good.any():
            # The cause of those that came nearest to being possible.
            if edges.allowed.any():
                return leaving_range(self._robot, inside[edges.allowed])
            return JUMPS if len(q) else NO_ANSWER
        parent = parent[good]
        steps = self._lengths(before.q, edges.step[good], parent)
        length = before.length[parent] + steps
        branch = before.branch[parent]
        layer = Layer(branch, q[good], low[good], high[good], length, parent)
        keys = np.column_stack([branch, edges.key[good]])
        chosen = self._shortest_free(before, layer, keys)
        if not len(chosen):
            blocked = shortest(length, keys)
            ends = before.q[parent[blocked]], layer.q[blocked]
            return self._blame(np.linspace(*ends, _LOOKS, axis=1)) or JUMPS
        return self._keep(self._in_reach(layer[chosen], station), self._thin)

    def _in_reach(self, layer: Layer, station: int) -> Layer:
        """Leave out nodes from which a given end is too far for the stations before it, unless all are."""
        if not self._to_end:
            return layer
        stations_to_end = len(self.s) - 1 - station
        far = np.abs(layer.q - self.problem.end).max(axis=1)
        reach = _HOMEWARD * LARGEST_STEP * stations_to_end
        is_near = far <= reach if stations_to_end else self._at_end(layer)
        return layer[is_near] if is_near.any() else layer

    def _shortest_free(
        self, before: Layer, layer: Layer, keys: np.ndarray
    ) -> np.ndarray:
        """Choose the shortest edge to each node, by keys (E, k), of those along which nothing is in the way."""
        chosen = shortest(layer.length, keys)
        free = self._are_free(before, layer, chosen)
        if free.all():
            return chosen
        free_edges = [chosen[free]]
        numbers = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
        edges = np.arange(len(keys))
        for _ in range(_OTHER_WAYS):
            is_lost = np.isin(numbers[edges], numbers[chosen[~free]])
            edges = np.setdiff1d(edges[is_lost], chosen)
            if not len(edges):
                break
            chosen = edges[shortest(layer.length[edges], numbers[edges, None])]
            free = self._are_free(before, layer, chosen)
            free_edges.append(chosen[free])
        return np.sort(np.concatenate(free_edges))

    def _are_free(self, before: Layer, layer: Layer, chosen: np.ndarray) -> np.ndarray:
        """Tell on which of the chosen steps to a layer nothing is in the way, (C,)."""
        first = before.q[layer.parent[chosen]]
        free = np.ones(len(chosen), dtype=bool)
        for limit in self.problem.limits:
            free &= limit.holds_between(first, layer.q[chosen], _SLACK)
        return free

    def _keep(self, layer: Layer, choose: Callable[[Layer], Layer]) -> Layer | str:
        """Choose among the nodes in which the arm may rest, on their branches, or tell what refuses them."""
        if self._keeps_branch:
            layer = layer[self._are_clear(layer)]
            if not len(layer.q):
                return OTHER_BRANCH
        held = np.ones(len(layer.q), dtype=bool)
        for limit in self.problem.limits:
            if limit.at_rest == "posture":
                held &= limit.holds_at_rest(layer.q, _SLACK)
        return choose(layer[held]) if held.any() else self._blame(layer.q[:, None])

    def _are_clear(self, layer: Layer) -> np.ndarray:
        """Tell which nodes, (K,) bool, are on their branch and clear of its boundary."""
        solver = self._decomposition.match.solver
        margins = np.empty(len(layer.q))
        for branch in np.unique(layer.branch):
            on_branch = layer.branch == branch
            values = solver.branch_margins(layer.q[on_branch], int(branch))
            margins[on_branch] = values.min(axis=1, initial=np.inf)
        return margins >= self._clear

    def _blame(self, q: np.ndarray) -> str:
        """Say which limit is exceeded most in the best posture, or on the best way, (K, L, n), and by how much."""
        if not len(q):
            return ""
        worst = _SLACK
        cause = ""
        for limit in self.problem.limits:
            if limit.at_rest != "posture":
                continue
            beyond, column, text = least_excess(limit, q)
            if beyond > worst:
                worst = beyond
                subject = limit.labels[column].subject
                cause = f"the {limit.name} limit of {subject} {limit.refusal} ({text})"
        return cause

    def _choose_some(self, layer: Layer, count: int) -> np.ndarray:
        """Choose `count` nodes: half of least length, with the step to a given end, half far apart."""
        if len(layer.q) <= count:
            return np.arange(len(layer.q))
        cost = layer.length
        if self._to_end:
            steps_to_end = self.problem.end - layer.q
            cost = cost + self._lengths(
                layer.q, steps_to_end, np.arange(len(steps_to_end))
            )
        order = np.argsort(cost, kind="stable")
        half = count // 2
        nearest = layer.q[order[0]]
        weights = weights_near(self._robot, self.problem.limits, nearest)
        scaled = layer.q[order] * weights
        far = half + np.unique(farthest(scaled[half:], scaled[:half], count - half))
        return np.sort(np.concatenate([order[:half], order[far]]))

    def _choose(
        self, joint_paths: list[JointPath], ends: Layer, count: int
    ) -> list[JointPath]:
        """Choose joint paths no longer than those to nodes around, then some that differ, and name their seeds.

        Of several redundant joints the nodes are samples, which have no such minima.
        """
        chosen = []
        is_single = self.problem.r <= 1
        if is_single:
            first, second = self._self_motion.near(ends.q, ends.q, self._around)
            same_label = ends.branch[first] == ends.branch[second]
            around = np.full(len(ends.q), np.inf)
            np.minimum.at(around, first[same_label], ends.length[second[same_label]])
            chosen = np.flatnonzero(around >= ends.length)[:count].tolist()
        if not (is_single and self._only_minima):
            indices = distinct(joint_paths, count)
            chosen += [i for i in indices if i not in chosen][: count - len(chosen)]
        return [
            replace(joint_paths[i], seed=self._seed_of(joint_paths[i].q[0]))
            for i in chosen
        ]

    def _start_nodes(self, rng: np.random.Generator) -> Layer:
        """Make nodes all over the self-motion manifold at the path's beginning, one in a cell, whatever the ranges."""
        target = self._targets[:1]
        count = 4 * self._nodes
        branches = []
        for decomposition in self._decompositions:
            q_r = spread_redundant(decomposition, self._cells_per_turn, count, rng)
            q = solve_all(decomposition, np.repeat(target, len(q_r), axis=0), q_r)
            q = q[:, list(decomposition.branches)]
            exists = np.isfinite(q).all(axis=3)
            self._seeds.append(q[exists])
            branches.append(np.array(decomposition.branches)[np.nonzero(exists)[1]])
        if not self._seeds:
            low, high = sampling_box(self._robot)
            drawn = rng.uniform(low, high, (count, len(low)))
            newton = self._self_motion.newton
            q = newton.nearest(np.repeat(target, count, axis=0), drawn)
            self._seeds.append(q[np.isfinite(q).all(axis=1)])
        q = np.concatenate(self._seeds)
        branch = np.zeros(len(q), dtype=int)
        if self._keeps_branch:
            (branch,) = branches
        cells = self._self_motion.key(q, self._self_motion.size)
        keys = np.column_stack([branch, cells])
        _, one_per_cell = np.unique(keys, axis=0, return_index=True)
        return Layer.start(q[one_per_cell], branch[one_per_cell])

    def _seed_of(self, q: np.ndarray) -> str:
        """Name the closed form that gave a start posture, (n,); empty if the task gives it."""
        if not self._seeds:
            return ""
        if not self._decompositions:
            return "random"
        steps = [self._self_motion.step(q, seeds) for seeds in self._seeds]
        distances = [np.abs(step).max(axis=1).min(initial=np.inf) for step in steps]
        return self._decompositions[int(np.argmin(distances))].name

    def _choose_start_nodes(self, layer: Layer) -> Layer:
        """Label the start nodes: joint paths of different labels do not displace each other.

        A label is a branch that joint paths keep. Otherwise it is, of one redundant joint, a connected component of the
        self-motion manifold; of several, a few postures far from each other have one each.
        """
        if self._keeps_branch:
            return self._thin(layer)
        q = layer.q
        if self.problem.r > 1:
            scaled = q / self._self_motion.size
            q = q[np.unique([0, *farthest(scaled, scaled[:1], 11)])]
            return Layer.start(q, np.arange(len(q)))
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        pairs = self._self_motion.near(q, q, self._around)
        graph = coo_array((np.ones(len(pairs[0])), pairs), shape=(len(q), len(q)))
        return Layer.start(q, connected_components(graph, directed=False)[1])

    def _at_end(self, last: Layer) -> np.ndarray:
        """Tell which nodes of the last layer, (K,) bool, meet the given end posture."""
        return np.abs(last.q - self.problem.end).max(axis=1) < SAME

    def _thin(self, layer: Layer) -> Layer:
        """Keep a bounded number of nodes of each label; of one redundant joint, those that come no long way round."""
        if self.problem.r <= 1:
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
        """Tell which nodes, (K,) bool, are not much longer than those of other labels in the same posture."""
        keys = self._self_motion.key(layer.q)
        postures = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
        least = np.full(len(keys), np.inf)
        np.minimum.at(least, postures, layer.length)
        return layer.length <= _LONGER * least[postures] + _ALWAYS

    def _turn_of(self, nodes: Layer) -> np.ndarray:
        """Multiples of 2 pi, (E, n), that bring the joint paths to nodes into the ranges, in the middle if closed."""
        first, last = self._turns_within(nodes.low, nodes.high)
        with np.errstate(invalid="ignore"):  # inf - inf
            middle = 0.5 * (self._lower + self._upper - nodes.low - nodes.high) / TURN
        central_turns = np.where(
            self._open_turns & np.isfinite(middle), np.round(middle), 0.0
        )
        return np.clip(central_turns, first, last)

    def _turns_within(
        self, low: np.ndarray, high: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest multiples of 2 pi, (E, n), that bring joint paths within low and high into the ranges.

        Joints that are in a turn already have the multiple 0 or, if that is not within the range, none at all: the
        least is then above the largest.
        """
        lowest = np.ceil((self._lower - low) / TURN)
        highest = np.floor((self._upper - high) / TURN)
        first = np.where(self._open_turns, lowest, low < self._lower)
        last = np.where(self._open_turns, highest, -1.0 * (high > self._upper))
        return first, last

    def _inside(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Which joints of joint paths, (E, n), can be brought into their ranges."""
        first, last = self._turns_within(low, high)
        return first <= last

    def _lengths(
        self, q: np.ndarray, step: np.ndarray, origin: np.ndarray
    ) -> np.ndarray:
        """Lengths of steps, (E, n), from the postures q[origin], as the module defines them."""
        lengths = np.zeros((2, len(step)))
        for limit in self.problem.limits:
            if not isinstance(limit, HasLatticeWeights):
                continue
            for length, rows in zip(lengths, limit.lattice_weights(q), strict=True):
                if rows is not None:
                    np.maximum(length, largest_parts(rows, step, origin), out=length)
        return lengths[0] + 0.5 * lengths[1]  # T = 0.5 s
