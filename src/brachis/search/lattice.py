"""The lattice: joint paths along the path, by dynamic programming over postures.

The path is cut into stations. The nodes of a layer are postures that meet the target at its station. Layer by layer
from the given start, nodes are joined to postures at the next station that are close, within the joint ranges, and
allowed at rest (within the torque limits, the arm can be held against gravity). Of all edges into a node, the one with
the least total length is kept. If the end posture is given and the start is not, the layers run backwards from the end.
`ClosedFormLattice` takes its nodes from the closed form of one choice of redundant joints, `PostureLattice` from
Newton's method.

Angles are continuous along a joint path, also across whole turns. From a given posture, postures in different turns are
different nodes. If neither end is given, all turns of a joint path are equivalent: a node stores the least and largest
positions of its joints so far, and is within the ranges as long as some multiple of 2 pi brings the whole joint path
there. The length of an edge,

    max |A(q) dq|  +  T max |B(q) dq|

with the rows A (M / tau_max, 1 / a_max) and B (1 / v_max) of `HasLatticeWeights`, does not depend on how fast the joint
path is followed. With the first term alone, the time along a straight joint path is 2 sqrt(length).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypedDict

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.kernel import find_largest_products
from brachis.limits import HasLatticeWeights, Limit
from brachis.problem.problem import Problem
from brachis.robot.joints import TURN
from brachis.search.joint_path import (
    JUMPS,
    NO_ANSWER,
    NO_TIME,
    OTHER_BRANCH,
    DeadEnd,
    PosturePath,
    distinct,
    least_excess,
    leaving_range,
    reaches,
    weights_near,
)
from brachis.search.stations import stations

LARGEST_STEP = 0.8
"""Maximum step of a joint between stations, rad or m."""
_HOMEWARD = 0.6
"""Fraction of the maximum step that joints may need per station to reach a given end."""
_LOOKS = 9
"""Number of postures examined along a step to name what is in the way."""
_OTHER_WAYS = 3
"""Number of further ways to a node that are tried if something is in the way of the shortest one."""
_SLACK = 1e-9
"""Allowance for the rounding of joint positions, rad or m, and of ratios to limits."""


@dataclass(frozen=True)
class Layer:
    """The nodes at a station.

    Attributes
    ----------
    branch : (K,) int ndarray
        Label that is the same all along a joint path: an index into the closed form's branches, or the label of its
        start node.
    q : (K, n) ndarray
        Postures, rad or m, continuous along the joint paths to the nodes.
    low, high : (K, n) ndarray
        Least and largest positions along the joint path to the node.
    length : (K,) ndarray
        Length of the shortest joint path to the node.
    parent : (K,) int ndarray
        The node in the previous layer from which this joint path comes.
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
        """Create the first layer from postures, (K, n), and their branches, (K,)."""
        return cls(branch, q, q, q, np.zeros(len(q)), np.zeros(len(q), dtype=int))


def farthest(points: np.ndarray, references: np.ndarray, count: int) -> list[int]:
    """Choose `count` of the points, (K, n), each farthest from all references, (H, n), and those already chosen."""
    distance = np.abs(points[:, None] - references[None]).max(axis=2).min(axis=1)
    chosen = []
    for _ in range(count):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.abs(points - points[chosen[-1]]).max(axis=1))
    return chosen


def shortest(length: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Return the index at which each distinct row of `keys`, (E, k), has its least `length`, (E,)."""
    order = np.lexsort((length, *keys.T[::-1]))
    rows = keys[order]
    return order[np.append(True, np.any(rows[1:] != rows[:-1], axis=1))]


@dataclass(frozen=True)
class Edges:
    """Pairs of a node and a posture at the next station.

    Attributes
    ----------
    parent : (E,) int ndarray
        Node in the previous layer.
    step : (E, n) ndarray
        Step from the node to the posture; NaN if the posture does not exist.
    key : (E, k) int ndarray
        Key that identifies the node to which an edge leads.
    elsewhere : (E,) bool ndarray, optional
        Whether there is a posture on any branch; by default there is.
    allowed : (E,) bool ndarray, optional
        Whether a motion may make the step; by default it may.
    """

    parent: np.ndarray
    step: np.ndarray
    key: np.ndarray
    elsewhere: np.ndarray | bool = True
    allowed: np.ndarray | bool = True


class Options(TypedDict, total=False):
    """Options of a lattice; see `Lattice`."""

    cells_per_turn: int
    density: float
    nodes: int
    deadline: Deadline


class Lattice(ABC):
    """Lattice of postures along a path.

    Parameters
    ----------
    problem : Problem
    turning : (n,) bool ndarray
        Joints whose number of turns is open if neither end is given.
    cells_per_turn : int, optional
        Number of cells in a turn of a revolute joint; a metre of a prismatic joint has a third as many.
    density : float, optional
        Factor on the number of stations.
    nodes : int, optional
        Number of nodes that a layer keeps if several joints are redundant.
    deadline : Deadline, optional
        No layer is begun after this time.
    """

    def __init__(
        self,
        problem: Problem,
        turning: np.ndarray,
        *,
        cells_per_turn: int = 72,
        density: float = 1.0,
        nodes: int = 120,
        deadline: Deadline = NEVER,
    ) -> None:
        self.problem = problem
        self.s = stations(problem.path, problem.task_map, density)
        self._robot = problem.robot
        self._cells_per_turn = cells_per_turn
        self._nodes = nodes
        self._deadline = deadline
        self._backwards = problem.start is None and problem.end is not None
        self._origin = problem.end if self._backwards else problem.start
        self._targets = problem.path.sample(self.s).target
        limits = problem.robot.limits
        self._lower = limits.position_lower - _SLACK
        self._upper = limits.position_upper + _SLACK
        # With a free start all turns are equivalent, and stay open until the joint path is known. The turn of a joint
        # without a range does not matter, unless a given end has to be met.
        self._open_turns = turning & (self._origin is None)
        self._to_end = problem.end is not None and not self._backwards
        ranged = np.isfinite(self._lower) | np.isfinite(self._upper) | self._to_end
        self._counts_turns = turning & ranged & ~self._open_turns

    _given_branch: int = 0
    """Branch of the given start or end posture."""
    _modulo: np.ndarray
    """Joints, (n,) bool, whose steps are computed modulo 2 pi."""

    @abstractmethod
    def _start_nodes(self, rng: np.random.Generator) -> Layer:
        """Create nodes at a free start, regardless of the joint ranges."""

    @abstractmethod
    def _edges(self, before: Layer, station: int, rng: np.random.Generator) -> Edges:
        """List edges from the nodes of a layer to postures at the next station."""

    @abstractmethod
    def _thin(self, layer: Layer) -> Layer:
        """Reduce a layer to the number of nodes that it may have."""

    def _choose_start_nodes(self, layer: Layer) -> Layer:
        """Choose among the nodes of a free start."""
        return self._thin(layer)

    @abstractmethod
    def _at_end(self, last: Layer) -> np.ndarray:
        """Tell which nodes of the last layer, (K,) bool, meet the given end posture."""

    def joint_paths(self, count: int) -> list[PosturePath] | DeadEnd:
        """Find joint paths along the path.

        Parameters
        ----------
        count : int
            Maximum number of joint paths.

        Returns
        -------
        list of PosturePath or DeadEnd
            Distinct joint paths, the shortest first, or the place where the lattice ends.
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
        length = layers[-1].length + self._lengths_beside(layers[-1].q, -1)
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
            PosturePath(self.problem, self.s, postures, float(length), int(branch))
            for postures, length, branch in zip(
                q, last.length, last.branch, strict=True
            )
        ]
        return self._choose(joint_paths, last, count)

    def _first_layer(self, rng: np.random.Generator) -> Layer | str:
        """Create the nodes with which joint paths begin, or tell why none is allowed."""
        if self._origin is not None:
            branch = np.array([self._given_branch])
            return Layer.start(self._origin[None].astype(float), branch)
        layer = self._start_nodes(rng)
        if not len(layer.q):
            return NO_ANSWER
        inside = self._inside(layer.q, layer.q)
        within = np.flatnonzero(inside.all(axis=1))
        if not len(within):
            return leaving_range(self._robot, inside)
        begun = self._keep(layer[within], self._choose_start_nodes)
        if isinstance(begun, Layer):
            begun = replace(begun, length=self._lengths_beside(begun.q, 0))
        return begun

    def _next(
        self, before: Layer, station: int, rng: np.random.Generator
    ) -> Layer | str:
        """Join the nodes of a layer to the next station, or tell why that is impossible."""
        edges = self._edges(before, station, rng)
        parent = edges.parent
        q = before.q[parent] + edges.step
        low = np.minimum(before.low[parent], q)
        high = np.maximum(before.high[parent], q)
        exists = np.isfinite(q).all(axis=1)
        with np.errstate(invalid="ignore"):
            inside = self._inside(low, high)
            near = edges.allowed & np.all(np.abs(edges.step) <= LARGEST_STEP, axis=1)
        good = exists & inside.all(axis=1) & near
        if not good.any():
            # The cause for the edges that came closest to being possible.
            if (exists & near).any():
                return leaving_range(self._robot, inside[exists & near])
            if (edges.elsewhere & ~exists).any():
                return OTHER_BRANCH
            return JUMPS if exists.any() else NO_ANSWER
        parent = parent[good]
        steps = self._lengths(before.q, edges.step[good], parent)
        length = before.length[parent] + steps
        branch = before.branch[parent]
        layer = Layer(branch, q[good], low[good], high[good], length, parent)
        chosen = self._shortest_free(before, layer, edges.key[good])
        if not len(chosen):
            blocked = shortest(length, edges.key[good])
            ends = before.q[parent[blocked]], layer.q[blocked]
            return self._blame(np.linspace(*ends, _LOOKS, axis=1)) or JUMPS
        return self._keep(self._in_reach(layer[chosen], station), self._thin)

    def _in_reach(self, layer: Layer, station: int) -> Layer:
        """Leave out nodes that are too far from a given end for the remaining stations, unless all of them are."""
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
        """Choose the shortest unobstructed edge to each node, which its key in `keys`, (E, k), identifies."""
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
        """Tell which of the chosen steps to a layer, (C,), are unobstructed."""
        first = before.q[layer.parent[chosen]]
        free = np.ones(len(chosen), dtype=bool)
        for limit in self.problem.limits:
            free &= limit.holds_between(first, layer.q[chosen], _SLACK)
        return free

    def _keep(self, layer: Layer, choose: Callable[[Layer], Layer]) -> Layer | str:
        """Choose among the nodes at which the arm may rest, or tell which limit forbids this at all of them."""
        held = np.ones(len(layer.q), dtype=bool)
        for limit in self.problem.limits:
            if limit.at_rest == "posture":
                held &= limit.holds_at_rest(layer.q, _SLACK)
        return choose(layer[held]) if held.any() else self._blame(layer.q[:, None])

    def _blame(self, q: np.ndarray) -> str:
        """Say which limit is exceeded most on the best of K ways through L postures, (K, L, n), and by how much."""
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
        """Choose `count` nodes: half with the least length, including the step to a given end, and half far apart."""
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

    def _step(self, before: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return the steps, (E, n), between pairs of postures, modulo 2 pi."""
        step = q - before
        return np.where(self._modulo, step - TURN * np.round(step / TURN), step)

    def _choose(
        self, joint_paths: list[PosturePath], _ends: Layer, count: int
    ) -> list[PosturePath]:
        """Choose up to `count` distinct joint paths; they end at the nodes `_ends`."""
        return [joint_paths[i] for i in distinct(joint_paths, count)]

    def _turn_of(self, nodes: Layer) -> np.ndarray:
        """Return multiples of 2 pi, (E, n), that bring joint paths into the ranges, near the middle of closed ones."""
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
        """Return the least and largest multiples of 2 pi, (E, n), that bring joint paths into the ranges.

        `low` and `high` are the extreme positions along the joint paths. Joints whose turn is fixed have the multiple 0
        or, if they are out of their range, none: the least multiple is then above the largest.
        """
        lowest = np.ceil((self._lower - low) / TURN)
        highest = np.floor((self._upper - high) / TURN)
        first = np.where(self._open_turns, lowest, low < self._lower)
        last = np.where(self._open_turns, highest, -1.0 * (high > self._upper))
        return first, last

    def _inside(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Tell which joints of joint paths, (E, n), can be brought into their ranges."""
        first, last = self._turns_within(low, high)
        return first <= last

    def _lengths(
        self, q: np.ndarray, step: np.ndarray, origin: np.ndarray
    ) -> np.ndarray:
        """Return the lengths, (E,), of steps, (E, n), from the postures q[origin], as the module defines them."""
        by_acceleration, by_velocity = step_lengths(
            self.problem.limits, q, step, origin
        )
        return by_acceleration + 0.5 * by_velocity  # T = 0.5 s

    def _lengths_beside(self, q: np.ndarray, end: int) -> np.ndarray:
        """Return the lengths, (K,), of the steps between postures and the closest posture beside the path, or zero."""
        others = self.problem.beside[end]
        if others is None:
            return np.zeros(len(q))
        count = len(others)
        origin = np.repeat(np.arange(len(q)), count)
        # Virtual joints are not in postures beside the path.
        joints = others.shape[1]
        there = q[origin]
        there[:, :joints] = np.tile(others, (len(q), 1))
        step = self._step(q[origin], there)
        lengths = self._lengths(q, step, origin).reshape(len(q), count)
        return np.asarray(lengths.min(axis=1))


def step_lengths(
    limits: Sequence[Limit], q: np.ndarray, step: np.ndarray, origin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return max |A dq| and max |B dq|, (E,) each, of steps, (E, n), from the postures q[origin]; see the module."""
    lengths = np.zeros((2, len(step)))
    for limit in limits:
        if not isinstance(limit, HasLatticeWeights):
            continue
        for length, rows in zip(lengths, limit.lattice_weights(q), strict=True):
            if rows is not None:
                products = find_largest_products(rows, step, origin)
                np.maximum(length, products, out=length)
    return lengths[0], lengths[1]
