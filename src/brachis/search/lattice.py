"""Joint paths along the path, from a lattice of closed-form postures.

The path is cut into stations, the redundant joints into cells. Layer by layer from the given start, every node (a cell,
a branch and the posture that the closed form gives there) is joined to the cells around it at the next station, where
the posture exists, is within the joint ranges, clear of the branch boundary and allowed at rest (the torque limits hold
the arm against gravity), and no joint jumps. Of all edges into a node the one with the least total length stays
(dynamic programming). Where the end posture is given and the start is not, the layers run backwards from the end.

Turns of angles by 2 pi follow the joint path. From a given posture, nodes of one cell in different turns are different
nodes. Where neither end is given, all turns of a joint path exist at once: a node keeps how far its joints have gone,
and is within the ranges as long as some multiple of 2 pi brings the whole joint path there. The length of an edge,

    max |A(q) dq|  +  T max |B(q) dq|

with the rows A (M / tau_max, 1 / a_max) and B (1 / v_max) of `Limit.step_rows`, does not depend on how fast the joint
path is followed: with the first term alone the time of a straight one is 2 sqrt(length). One redundant joint is
searched completely at the lattice's spacing. Of several, all neighbours along one joint at a time and random ones, and
a layer keeps a bounded number of nodes, half of them the nearest and half far from each other.
"""

from __future__ import annotations

import numpy as np

from brachis.deadline import NEVER, Deadline
from brachis.limits import Moments
from brachis.problem import Decomposition
from brachis.robot.joint_space import TURN, complement
from brachis.search.cells import Cells, unique
from brachis.search.joint_path import (
    JUMPS,
    NO_ANSWER,
    OTHER_BRANCH,
    DeadEnd,
    JointPath,
    beyond_ranges,
    causes_of,
    distinct,
)
from brachis.search.layer import Layer
from brachis.search.stations import stations

_LARGEST_STEP = 0.8  # rad or m between stations
_TYPICAL_TIME = 0.5  # s
_CLEAR = 0.02
_SLACK = 1e-9
_LONGEST = 4.0
_STARTS = 4  # times the nodes of a layer


class Lattice:
    """Lattice of a choice of redundant joints.

    Parameters
    ----------
    decomposition : Decomposition
    cells_per_turn : int, optional
        Cells of a turn of a revolute joint; a metre of a prismatic joint has a third as many.
    density : float, optional
        Factor on the number of stations.
    nodes : int, optional
        Nodes that a layer keeps where there are several redundant joints.
    seed : int, optional
        Of the random neighbours and starts with several redundant joints.
    deadline : Deadline, optional
        No layer is begun after it.
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
        self.decomposition = decomposition
        self.s = stations(given.path, given.task_map, density)
        self._robot, self._solver = given.robot, decomposition.match.solver
        self._redundant = list(decomposition.redundant)
        self._rest = np.array(complement(given.robot.n, decomposition.redundant), dtype=int)
        self._turning = given.robot.revolute
        self._nodes, self._seed, self._deadline = nodes, seed, deadline
        self._turns = self._rest[self._turning[self._rest]]
        self._backwards = given.start is None and given.end is not None
        self._origin = given.end if self._backwards else given.start
        self._cells = Cells.of(decomposition, cells_per_turn, self._origin)
        self._targets = given.path.sample(self.s).target
        self._limits = given.limits
        # In which turn the angles of a free origin are is open until the joint path is known.
        self._static = [limit for limit in given.limits if limit.static and not limit.whole_turns]
        limits = given.robot.limits
        self._lower, self._upper = limits.position_lower - _SLACK, limits.position_upper + _SLACK
        self._loose = np.zeros(given.robot.n, dtype=bool)  # which joints may begin in any turn
        self._loose[self._turns] = self._origin is None
        # Turns of a free origin exist all at once, and nobody asks which turn an angle without a range is in, unless a
        # given end has to be met.
        ranged = np.isfinite(self._lower) | np.isfinite(self._upper) | (given.end is not None and not self._backwards)
        self._telling = (ranged & ~self._loose)[self._turns]
        self._clear = _CLEAR
        if self._origin is not None:
            at_origin = self._solver.branch_margins(self._origin[None], decomposition.branches[0])[0]
            self._clear = float(np.minimum(_CLEAR, 0.5 * at_origin.min(initial=np.inf)))

    def joint_paths(self, most: int) -> list[JointPath] | DeadEnd:
        """Find joint paths along the path.

        Parameters
        ----------
        most : int
            How many at most.

        Returns
        -------
        list of JointPath or DeadEnd
            Distinct ones, the shortest first; none where the time was up; where the lattice ends, if there is none.
        """
        rng = np.random.default_rng(self._seed)
        layers: list[Layer] = []
        stations = range(len(self.s))
        for station in reversed(stations) if self._backwards else stations:
            if self._deadline.passed:
                return []
            layer = self._next(layers[-1], station, rng) if layers else self._first_layer(rng)
            if not isinstance(layer, Layer):
                return DeadEnd(float(self.s[station]), layer, backwards=self._backwards)
            layers.append(layer)
        ends = self._ends(layers[-1])
        if not len(ends):
            return DeadEnd(1.0, {JUMPS: 1})
        q, branches = self._traced(layers, ends)
        lengths = layers[-1].length[ends]
        found = [
            JointPath(self.decomposition, int(branch), self.s, joint_path, float(length))
            for branch, joint_path, length in zip(branches, q, lengths, strict=True)
        ]
        return distinct(found, most)

    def _ends(self, last: Layer) -> np.ndarray:
        """Nodes at which joint paths may end, (E,), the nearest first."""
        order = np.argsort(last.length, kind="stable")
        given = self.decomposition.problem
        if given.end is not None and not self._backwards:
            allowed = np.full(self._robot.n, _LARGEST_STEP)
            allowed[self._redundant] = self._cells.size
            order = order[np.all(np.abs(last.q - given.end)[order] <= allowed, axis=1)]
        return order[last.length[order] <= _LONGEST * last.length[order[:1]] + _SLACK]

    def _traced(self, layers: list[Layer], ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Trace joint paths back from their ends, (E,): postures (E, S + 1, n), in their turns, and branches (E,)."""
        nodes, q = ends, []
        for layer in reversed(layers):
            q.append(layer.q[nodes])
            nodes = layer.parent[nodes]
        joint_paths = np.array(q if self._backwards else q[::-1]).swapaxes(0, 1)
        return joint_paths + TURN * self._turn_of(layers[-1][ends])[:, None], layers[-1].branch[ends]

    def _turn_of(self, nodes: Layer) -> np.ndarray:
        """Multiples of 2 pi, (E, n), that bring the joint paths to nodes into the ranges, in the middle if closed."""
        first, last = self._turns_within(nodes.low, nodes.high)
        with np.errstate(invalid="ignore"):  # inf - inf
            middle = 0.5 * (self._lower + self._upper - nodes.low - nodes.high) / TURN
        wanted = np.where(self._loose & np.isfinite(middle), np.round(middle), 0.0)
        return np.clip(wanted, first, last)

    def _turns_within(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest multiples of 2 pi, (E, n), that bring joint paths within low and high into the ranges.

        Joints that are in a turn already have the multiple 0 or, where it is not within the range, none at all: the
        least is then above the largest.
        """
        first = np.where(self._loose, np.ceil((self._lower - low) / TURN), low < self._lower)
        last = np.where(self._loose, np.floor((self._upper - high) / TURN), -1.0 * (high > self._upper))
        return first, last

    def _inside(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Which joints of joint paths, (E, n), can be brought into their ranges; see `_turns_within`."""
        first, last = self._turns_within(low, high)
        return np.asarray(first <= last)

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
        end = self.decomposition.problem.end
        if end is not None and not self._backwards and station == len(self.s) - 1:
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
            near = np.all(np.abs(step) <= _LARGEST_STEP, axis=1)
        good = found & inside.all(axis=1) & near
        if not good.any():
            return causes_of(self._robot, exists.any(axis=(1, 2))[where], found, inside, near)
        parent, where, step = parent[good], where[good], step[good]
        length = before.length[parent] + self._lengths(before.q, step, parent)
        layer = Layer(cells[where], branch[good], q[good], low[good], high[good], length, parent)
        turn = np.where(self._telling, turn[good], 0.0)
        return self._kept(layer[_shortest(length, np.column_stack([where, layer.branch, alternative[good], turn]))])

    def _lengths(self, q: np.ndarray, step: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """Lengths of steps, (E, n), from the postures q[origin]; see the module."""
        by_acceleration, by_velocity = np.zeros(len(step)), np.zeros(len(step))
        for limit in self._limits:
            for length, rows in zip((by_acceleration, by_velocity), limit.step_rows(q), strict=True):
                if rows is not None:
                    parts = np.abs(np.einsum("eij,ej->ei", rows[origin], step))
                    np.maximum(length, parts.max(axis=1), out=length)
        return by_acceleration + _TYPICAL_TIME * by_velocity

    def _kept(self, layer: Layer) -> Layer | dict[str, int]:
        """Keep nodes clear of the branch boundary that can be held against gravity, not too many of them."""
        clear = np.ones(len(layer.branch), dtype=bool)
        for branch in np.unique(layer.branch):
            own = layer.branch == branch
            margins = self._solver.branch_margins(layer.q[own], int(branch))
            clear[own] = margins.min(axis=1, initial=np.inf) >= self._clear
        still, held = Moments.at_rest(layer.q), np.ones(len(layer.branch), dtype=bool)
        refused: dict[str, int] = {}
        for limit in self._static:
            allowed = np.all(limit.violation(limit.values(still)) <= _SLACK, axis=1)
            refused[f"the {limit.name} limit {limit.refusal}"] = int((clear & ~allowed).sum())
            held &= allowed
        if not (clear & held).any():
            refused[OTHER_BRANCH] = int((~clear).sum())
            return {cause: count for cause, count in refused.items() if count}
        kept = layer[clear & held]
        return kept if self._cells.r <= 1 else kept.bounded(self._nodes, self._robot, self._limits)


def _shortest(length: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Return where each different row of `keys`, (E, k), has its least `length`, (E,)."""
    order = np.lexsort((length, *keys.T[::-1]))
    rows = keys[order]
    return order[np.append(True, np.any(rows[1:] != rows[:-1], axis=1))]
