"""Steps of the arm from one station of a path to the next, along the self-motion.

Around every posture the r joints that move most in the arm's self-motion there are cut into cells; the postures at the
cells around, at the next station, follow by Newton's method. So every posture that a continuous motion reaches is
found, at the spacing of the cells, and no closed form ends it. A motion may step from one posture to another if the
step is along the self-motion: what the next target asks of the joints apart, most of it lies in the null space of the
Jacobian. On a branch of a closed form, which has no folds, it may step anywhere near. Of several redundant joints,
cells are sampled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.ik.newton import null_spaces
from brachis.kinematics import Newton, moving_most, solve_each
from brachis.problem.problem import Problem
from brachis.robot.joints import TURN
from brachis.search.postures import cell_sizes

LARGEST_STEP = 0.8
"""Largest step of a joint between stations, rad or m."""
_CELLS = 2
"""Cells to both sides that a step may lead to, where postures keep no branch."""
SAME = 1e-3
"""Spacing, rad or m, below which postures are the same."""


def shortest(length: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Return where each different row of `keys`, (E, k), has its least `length`, (E,)."""
    order = np.lexsort((length, *keys.T[::-1]))
    rows = keys[order]
    return order[np.append(True, np.any(rows[1:] != rows[:-1], axis=1))]


@dataclass(frozen=True)
class Edges:
    """Pairs of a posture at a station and one at the next station.

    Attributes
    ----------
    parent : (E,) int ndarray
        Number of the posture at the station before.
    step : (E, n) ndarray
        To the posture at the next station.
    key : (E, n) int ndarray
        Equal for edges to the same posture.
    allowed : (E,) bool ndarray
        Whether a motion may make the step.
    """

    parent: np.ndarray
    step: np.ndarray
    key: np.ndarray
    allowed: np.ndarray


class SelfMotion:
    """Postures around others along the self-motion, at the stations of a path.

    Parameters
    ----------
    problem : Problem
    targets : (S + 1, m) ndarray
        At the stations.
    end : (n,) ndarray or None
        Posture at the last station, where that is given and the stations lead to it.
    is_turning : (n,) bool ndarray
        Joints whose turns by 2 pi do not tell postures apart.
    cells_per_turn : int
    keeps_branch : bool
        Whether all postures are on a branch of a closed form.

    Attributes
    ----------
    newton : Newton
    size : (n,) ndarray
        Of the cells, rad or m.
    """

    def __init__(
        self,
        problem: Problem,
        targets: np.ndarray,
        end: np.ndarray | None,
        is_turning: np.ndarray,
        cells_per_turn: int,
        *,
        keeps_branch: bool,
    ) -> None:
        self.newton = Newton(problem.task_map)
        self.size = cell_sizes(problem.robot, cells_per_turn)
        self._task_map = problem.task_map
        self._targets = targets
        self._end = end
        self._is_turning = is_turning
        self._r = problem.r
        self._keeps_branch = keeps_branch
        cells = cells_per_turn // 8 if keeps_branch else _CELLS
        every = np.arange(-cells, cells + 1)[:, None]
        self._offsets = every if self._r else np.zeros((1, 0), dtype=int)

    def step(self, before: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return the steps, (E, n), from postures to others, without turns that do not count."""
        step = q - before
        return np.where(self._is_turning, step - TURN * np.round(step / TURN), step)

    def key(self, q: np.ndarray, size: np.ndarray | float = SAME) -> np.ndarray:
        """Round postures to whole numbers of a spacing, (K, n), without turns that do not count."""
        return np.rint(self._without_turns(q) / size).astype(int)

    def _without_turns(self, q: np.ndarray) -> np.ndarray:
        """Postures, (K, n), with angles whose turns do not count in [0, 2 pi)."""
        angle = q - TURN * np.floor(q / TURN)
        # Rounding may make it a whole turn.
        angle = np.where(angle < TURN, angle, 0.0)
        return np.where(self._is_turning, angle, q)

    def near(
        self, first: np.ndarray, second: np.ndarray, reach: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs, (E,) and (E,), of postures between which no joint moves farther than `reach`."""
        from scipy.spatial import KDTree

        box = np.where(self._is_turning, TURN, 0.0)
        first_tree, second_tree = (
            KDTree(self._without_turns(q), boxsize=box) for q in (first, second)
        )
        pairs = first_tree.sparse_distance_matrix(
            second_tree, reach, p=np.inf, output_type="ndarray"
        )
        return pairs["i"], pairs["j"]

    def edges(self, q: np.ndarray, station: int, rng: np.random.Generator) -> Edges:
        """List edges from postures, (K, n), to those around them at the next station."""
        values, jacobian = self.newton.task_coordinates(q)
        # Of self-motion, where joints have their cells as units.
        null = null_spaces(jacobian * self.size)
        task_step = self._task_map.difference(self._targets[station][None], values)
        still = np.zeros((len(null), self._r))  # without self-motion
        rows = np.swapaxes(null, 1, 2) / self.size
        square = np.concatenate([jacobian, rows], axis=1)
        needed = solve_each(square, np.concatenate([task_step, still], axis=1))
        if self._r <= 1:
            around = self._at_cells(q, jacobian, null, task_step, station)
            parent, which = self.near(q, around, LARGEST_STEP)
            postures = around[which]
        else:
            parent, postures = self._sample(q, null, needed, station, rng)
        if self._end is not None and station == len(self._targets) - 1:
            end = self._end[None]
            node, which = self.near(q, end, LARGEST_STEP)
            parent = np.append(parent, node)
            postures = np.vstack([postures, end[which]])
        step = self.step(q[parent], postures)
        self_motion = (step - needed[parent]) / self.size
        is_small = np.all(np.abs(self_motion) <= 1.0, axis=1)
        # Postures across a fold of the manifold differ in other directions.
        along = np.linalg.norm(
            np.einsum("eir,ei->er", null[parent], self_motion), axis=1
        )
        is_along = along >= 0.7 * np.linalg.norm(self_motion, axis=1)
        is_near = np.all(np.abs(step) <= LARGEST_STEP, axis=1)
        allowed = is_near & (is_small | is_along | self._keeps_branch)
        return Edges(parent, step, self.key(postures), allowed)

    def _at_cells(
        self,
        q: np.ndarray,
        jacobian: np.ndarray,
        null: np.ndarray,
        task_step: np.ndarray,
        station: int,
    ) -> np.ndarray:
        """Postures (C, n) at the cells around nodes with postures (K, n), on the way to the next station's target."""
        joints = moving_most(null)
        rows = np.eye(q.shape[1])[joints]
        size = self.size[joints]
        at = np.take_along_axis(q, joints, axis=1)
        offsets = self._offsets
        which = np.repeat(np.arange(len(q)), len(offsets))
        cells = np.rint(at / size).astype(int)[which] + np.tile(offsets, (len(q), 1))
        levels = cells * size[which]
        augmented = np.concatenate([jacobian, rows], axis=1)[which]
        right = np.concatenate([task_step[which], levels - at[which]], axis=1)
        begun = q[which] + solve_each(augmented, right)
        regular = np.flatnonzero(np.isfinite(begun).all(axis=1))
        # One prediction for each posture: from the node whose cell is nearest.
        keys = [joints[which], cells, self.key(np.nan_to_num(begun), 0.5)]
        far = np.tile(np.abs(offsets).sum(axis=1), len(q)).astype(float)
        keys_of_regular = np.concatenate(keys, axis=1)[regular]
        chosen = regular[shortest(far[regular], keys_of_regular)]
        postures = self._project(
            begun[chosen], rows[which[chosen]], levels[chosen], station
        )
        postures = postures[np.isfinite(postures).all(axis=1)]
        _, one_per_node = np.unique(self.key(postures), axis=0, return_index=True)
        return postures[one_per_node]

    def _sample(
        self,
        q: np.ndarray,
        null: np.ndarray,
        needed: np.ndarray,
        station: int,
        rng: np.random.Generator,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nodes, (E,), and postures (E, n) around them: along each direction of self-motion, and at random."""
        r = self._r
        single = np.kron(np.eye(r), [[-1.0], [1.0], [-4.0], [4.0]])
        random = rng.normal(0.0, 2.5, (6, r))
        offsets = np.vstack([np.zeros((1, r)), single, random])
        aside = np.einsum("kij,oj->koi", null, offsets) * self.size
        if self._end is not None:  # and towards the given end
            step_to_end = (self._end - q) / max(1, len(self._targets) - station)
            homing = np.einsum("kir,kjr,kj->ki", null, null, step_to_end / self.size)
            homing = homing * self.size
            aside = np.concatenate([aside, homing[:, None]], axis=1)
        parent = np.repeat(np.arange(len(q)), aside.shape[1])
        begun = ((q + needed)[:, None] + aside).reshape(len(parent), -1)
        rows = (np.swapaxes(null, 1, 2) / self.size)[parent]
        levels = np.einsum("kij,kj->ki", rows, begun)
        postures = self._project(begun, rows, levels, station)
        exists = np.isfinite(postures).all(axis=1)
        return parent[exists], postures[exists]

    def _project(
        self, q: np.ndarray, rows: np.ndarray, levels: np.ndarray, station: int
    ) -> np.ndarray:
        """Postures (C, n) near given ones that meet a station's target, as of `Newton.solve`."""
        targets = np.repeat(self._targets[station][None], len(q), axis=0)
        return self.newton.solve(targets, q, rows, levels)
