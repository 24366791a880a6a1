"""Courses of the redundant joints along the path, from a lattice of closed-form postures.

The path is cut into stations, the redundant joints into cells. Layer by layer from the start, every node (a cell, a
branch and the posture that the closed form gives there) is joined to the cells around it at the next station, where
the posture exists, is within the joint ranges, clear of the branch boundary and can be held against gravity, and no
joint jumps. Of all edges into a node the one with the least total length stays (dynamic programming); lifts of angles
by 2 pi follow the course. The length of an edge,

    max_j |M(q) dq|_j / tau_max_j  +  T max_j |dq_j| / v_max_j ,

does not depend on how fast the course is followed: with the first term alone the time of a straight course is
2 sqrt(length). One redundant joint is searched completely at the lattice's spacing. Of several, all neighbours along
one joint at a time and random ones, and a layer keeps a bounded number of nodes, half of them the nearest and half far
from each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.robot import dynamics
from brachis.search.course import (
    JUMPS,
    NO_ANSWER,
    OTHER_BRANCH,
    TOO_HEAVY,
    Course,
    DeadEnd,
    causes_of,
    distinct,
    weights_near,
)
from brachis.setting import Choice

_TURN = 2.0 * np.pi
_STEP_LENGTH = 0.05  # m of path a station
_FEWEST_STATIONS, _MOST_STATIONS = 24, 200
_WINDOW = 1.0 / 8.0  # of a turn
_LARGEST_STEP = 0.8  # rad or m between stations
_TYPICAL_TIME = 0.5  # s
_CLEAR = 0.02
_SLACK = 1e-9
_RANDOM_OFFSETS = 24
_LONGEST = 4.0
_AT_END = 1.0  # cells


@dataclass(frozen=True)
class _Layer:
    """Nodes at a station: cells (K, r), slots (K,), postures (K, n), lengths (K,), parents (K,) in the layer before."""

    cell: np.ndarray
    slot: np.ndarray
    q: np.ndarray
    length: np.ndarray
    parent: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> _Layer:
        return _Layer(*(getattr(self, name)[chosen] for name in ("cell", "slot", "q", "length", "parent")))


class Lattice:
    """Lattice of a choice of redundant joints.

    Parameters
    ----------
    choice : Choice
    cells_per_turn : int, optional
        Cells of a turn of a revolute joint; a metre of a prismatic joint has a third as many.
    nodes : int, optional
        Nodes that a layer keeps where there are several redundant joints.
    seed : int, optional
        Of the random neighbours and nodes with several redundant joints.
    """

    def __init__(self, choice: Choice, *, cells_per_turn: int = 72, nodes: int = 120, seed: int = 0) -> None:
        given = choice.setting
        self.choice = choice
        self._robot, self._solver = given.robot, choice.match.solver
        self._redundant = list(choice.redundant)
        self._rest = [i for i in range(given.robot.n) if i not in choice.redundant]
        turning = np.array([unit == "rad" for unit in given.robot.position_units])
        self._turning = turning
        self._cell = np.where(turning[self._redundant], _TURN / cells_per_turn, 3.0 / cells_per_turn)
        self._window = round(_WINDOW * cells_per_turn)
        self._nodes = nodes
        self._rng = np.random.default_rng(seed)
        labels = self._solver.branches
        self._slots = [[b for b, label in enumerate(labels) if label == labels[first]] for first in choice.branches]
        self._first = {slot: slots[0] for slots in self._slots for slot in slots}
        steps = int(np.clip(np.ceil(given.path.length / _STEP_LENGTH), _FEWEST_STATIONS, _MOST_STATIONS))
        self.s = np.linspace(0.0, 1.0, steps + 1)
        self._targets = given.path.sample(self.s).target
        limits = given.robot.limits
        self._lower, self._upper = limits.position_lower - _SLACK, limits.position_upper + _SLACK
        self._clear = _CLEAR
        if given.start is None:
            self._origin = self._middle()
        else:
            self._origin = given.start[self._redundant]
            at_start = self._solver.branch_margins(given.start[None], choice.branches[0])[0]
            self._clear = float(np.minimum(_CLEAR, 0.5 * at_start.min(initial=np.inf)))

    def _middle(self) -> np.ndarray:
        """Middle of the redundant joints' ranges, zero where they are open."""
        low, high = self._lower[self._redundant], self._upper[self._redundant]
        closed = np.isfinite(low) & np.isfinite(high)
        return np.where(closed, 0.5 * (np.where(closed, low, 0.0) + np.where(closed, high, 0.0)), 0.0)

    def courses(self, most: int) -> list[Course] | DeadEnd:
        """Find up to `most` distinct courses, the shortest first, or where the lattice ends."""
        layers = [self._first_layer()]
        for station in range(1, len(self.s)):
            layer = self._next(layers[-1], station) if len(layers[-1].slot) else None
            if not isinstance(layer, _Layer):
                return DeadEnd(float(self.s[station if layer else 0]), layer or {NO_ANSWER: 1})
            layers.append(layer)
        ends = np.argsort(layers[-1].length, kind="stable")
        if self.choice.setting.end is not None:
            gap = np.abs(layers[-1].q - self.choice.setting.end)
            ends = ends[np.all(gap[ends] < np.maximum(_AT_END * self._cell.max(initial=0.0), _SLACK), axis=1)]
            if not len(ends):
                return DeadEnd(1.0, {JUMPS: 1})
        lengths = layers[-1].length[ends]
        ends = ends[lengths <= _LONGEST * lengths[0] + _SLACK]
        q, slots = self._traced(layers, ends)
        branches = [self._first[int(slot)] for slot in slots]
        found = zip(branches, q, layers[-1].length[ends], strict=True)
        return distinct(
            [Course(self.choice, branch, self.s, each, float(length)) for branch, each, length in found], most
        )

    def _traced(self, layers: list[_Layer], ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Trace courses back from their ends, (E,): postures (E, S + 1, n) and first slots (E,)."""
        nodes, q = ends, []
        for layer in reversed(layers):
            q.append(layer.q[nodes])
            slots, nodes = layer.slot[nodes], layer.parent[nodes]
        return np.array(q[::-1]).swapaxes(0, 1), slots

    def _first_layer(self) -> _Layer:
        """Make the node of the start posture, or nodes all over the ranges where it is free."""
        given, r = self.choice.setting, len(self._redundant)
        if given.start is not None:
            q, none = given.start[None], np.zeros(1, dtype=int)
            return _Layer(np.zeros((1, r), dtype=int), none + self.choice.branches[0], q, np.zeros(1), none)
        cells = self._all_cells()
        answers = self._answers(cells, 0)
        slots = np.array(sorted(self._first))
        cell = np.repeat(cells, len(slots), axis=0)
        slot = np.tile(slots, len(cells))
        q = np.empty((len(cell), self._robot.n))
        q[:, self._redundant] = self._positions(cell)
        q[:, self._rest] = answers[:, slots].reshape(len(cell), -1)
        q = self._lifted_to_middle(q)
        good = np.isfinite(q).all(axis=1) & self._in_range(q)
        layer = _Layer(cell, slot, q, np.zeros(len(cell)), np.zeros(len(cell), dtype=int))[good]
        clear, held = self._usable(layer)
        return self._bounded(layer[clear & held])

    def _all_cells(self) -> np.ndarray:
        """List the cells within the ranges, (C, r); of several redundant joints a random sample."""
        low, high = self._lower[self._redundant], self._upper[self._redundant]
        reach = np.where(self._turning[self._redundant], 0.5 * _TURN, 2.0 + self.choice.setting.path.length)
        first = np.ceil((np.maximum(low, self._origin - reach) - self._origin) / self._cell).astype(int)
        last = np.floor((np.minimum(high, self._origin + reach) - self._origin) / self._cell).astype(int)
        if len(self._cell) <= 1:
            axes = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
            return np.array(axes, dtype=int).T.reshape(-1, len(self._cell)) if axes else np.zeros((1, 0), dtype=int)
        return self._rng.integers(first, last + 1, (4 * self._nodes, len(self._cell)))

    def _lifted_to_middle(self, q: np.ndarray) -> np.ndarray:
        """Lift angles to the turn nearest to the middle of their ranges."""
        closed = np.isfinite(self._lower) & np.isfinite(self._upper)
        middle = np.where(closed, 0.5 * (np.where(closed, self._lower, 0.0) + np.where(closed, self._upper, 0.0)), 0.0)
        return np.where(self._turning, q - _TURN * np.round((q - middle) / _TURN), q)

    def _positions(self, cell: np.ndarray) -> np.ndarray:
        """Redundant joints, (K, r), of cells."""
        return np.asarray(self._origin + cell * self._cell)

    def _answers(self, cells: np.ndarray, station: int) -> np.ndarray:
        """Non-redundant joints of all branches, (C, B, m)."""
        target = np.repeat(self._targets[station][None], len(cells), axis=0)
        return self._solver.solve(target, self._positions(cells))

    def _in_range(self, q: np.ndarray) -> np.ndarray:
        return np.all((q >= self._lower) & (q <= self._upper), axis=-1)

    def _offsets(self) -> np.ndarray:
        """Neighbouring cells, (O, r)."""
        r = len(self._cell)
        if r <= 1:
            return np.arange(-self._window, self._window + 1)[:, None] if r else np.zeros((1, 0), dtype=int)
        single = [sign * size * row for row in np.eye(r, dtype=int) for size in (1, 2, 4, 8) for sign in (-1, 1)]
        random = np.rint(self._rng.normal(0.0, 2.5, (_RANDOM_OFFSETS, r))).astype(int)
        return np.unique(np.vstack([np.zeros((1, r), dtype=int), single, random]), axis=0)

    def _next(self, before: _Layer, station: int) -> _Layer | dict[str, int]:
        """Join the nodes of a layer to the next station, or say why none can be."""
        offsets = self._offsets()
        count = len(before.slot) * len(offsets)
        edges = (before.cell[:, None] + offsets[None]).reshape(count, offsets.shape[1])
        parent = np.repeat(np.arange(len(before.slot)), len(offsets))
        cells, where = _unique(edges)
        answers = self._answers(cells, station)
        exists = np.isfinite(answers).all(axis=2)
        tried = []
        for slots in self._slots:
            own = np.isin(before.slot[parent], slots)
            tried += [(parent[own], where[own], slot) for slot in slots]
        parent = np.concatenate([p for p, _, _ in tried])
        slot = np.concatenate([np.full(len(p), b) for p, _, b in tried])
        where = np.concatenate([w for _, w, _ in tried])
        q = np.empty((len(parent), self._robot.n))
        q[:, self._redundant] = self._positions(cells)[where]
        q[:, self._rest] = answers[where, slot]
        step = q - before.q[parent]
        turns = np.array(self._rest)[self._turning[self._rest]]
        step[:, turns] -= _TURN * np.round(step[:, turns] / _TURN)
        q = before.q[parent] + step
        found = exists[where, slot]
        with np.errstate(invalid="ignore"):
            in_range = self._in_range(q)
            near = np.all(np.abs(step[:, self._rest]) <= _LARGEST_STEP, axis=1)
        good = found & in_range & near
        if not good.any():
            return causes_of(exists, where, found, in_range, near)
        parent, slot, where, q, step = parent[good], slot[good], where[good], q[good], step[good]
        length = before.length[parent] + self._lengths(before.q, step, parent)
        order = np.lexsort((length, slot, where))
        key = where[order] * len(self._solver.branches) + slot[order]
        best = order[np.append(True, key[1:] != key[:-1])]
        layer = _Layer(cells[where[best]], slot[best], q[best], length[best], parent[best])
        clear, held = self._usable(layer)
        if not (clear & held).any():
            return {
                cause: int(n) for cause, n in ((TOO_HEAVY, (clear & ~held).sum()), (OTHER_BRANCH, (~clear).sum())) if n
            }
        return self._bounded(layer[clear & held])

    def _lengths(self, q: np.ndarray, step: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """Lengths of steps, (E, n), from the postures q[origin]; see the module."""
        limits = self._robot.limits
        masses = dynamics.mass_matrices(self._robot, q) / limits.torque[:, None]
        effort = np.abs(np.einsum("eij,ej->ei", masses[origin], step)).max(axis=1)
        return np.asarray(effort + _TYPICAL_TIME * (np.abs(step) / limits.velocity).max(axis=1))

    def _usable(self, layer: _Layer) -> tuple[np.ndarray, np.ndarray]:
        """Tell which nodes are clear of the branch boundary, and which can be held against gravity."""
        clear = np.ones(len(layer.slot), dtype=bool)
        for slot in np.unique(layer.slot):
            own = layer.slot == slot
            margins = self._solver.branch_margins(layer.q[own], self._first[int(slot)])
            clear[own] = margins.min(axis=1, initial=np.inf) >= self._clear
        still = np.zeros_like(layer.q)
        tau = np.abs(dynamics.torque(self._robot, layer.q, still, still))
        return clear, np.all(tau <= self._robot.limits.torque, axis=1)

    def _bounded(self, layer: _Layer) -> _Layer:
        """Keep a bounded number of nodes where there are several redundant joints."""
        if len(self._cell) <= 1 or len(layer.slot) <= self._nodes:
            return layer
        order = np.argsort(layer.length, kind="stable")
        half = self._nodes // 2
        nearest, others = layer[order[:half]], layer[order[half:]]
        # Farthest points: each further node is the one that is farthest from all that are kept.
        weights = weights_near(self._robot, layer.q[order[0]])
        places, kept = others.q * weights, nearest.q * weights
        distance = np.abs(places[:, None] - kept[None]).max(axis=2).min(axis=1)
        chosen: list[int] = []
        for _ in range(self._nodes - half):
            chosen.append(int(np.argmax(distance)))
            distance = np.minimum(distance, np.abs(places - places[chosen[-1]]).max(axis=1))
        return layer[np.sort(np.concatenate([order[:half], order[half:][np.unique(chosen)]]))]


def _unique(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different cells, (C, r), and where each given one, (K, r), is among them, (K,)."""
    span = np.ptp(cells, axis=0) + 1
    weights = np.append(np.cumprod(span[:0:-1])[::-1], 1)[: len(span)]
    keys = (cells - cells.min(axis=0)) @ weights.astype(int)
    _, first, where = np.unique(keys, return_index=True, return_inverse=True)
    return cells[first], where.ravel()
