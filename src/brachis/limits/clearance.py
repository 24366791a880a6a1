"""The distance between each pair of solids must be at least the clearance; the limit has one value for each pair.

The distance of a pair that is far apart counts as `_FAR` above the clearance. With the unit vector u between the
nearest points w_a and w_b,

    dd/dq = u . (J_b(w_b) - J_a(w_a)).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.common.arrays import LastCall, count_each
from brachis.common.labels import Label
from brachis.limits.protocol import Bound, JointStates, Limit, Partials, Role
from brachis.robot import Robot
from brachis.scene import UNIT, ClosePairs, Scene, scene_of
from brachis.scene.chain import Chain
from brachis.task import Task

_FAR = 0.1
"""Distance above the clearance, m. If the solids of a pair are farther apart, their distance is not computed."""
_DEVIATION = 2e-4
"""Distance by which bodies deviate from their places on a joint path when splines follow it, m."""
_NEARBY = 2.0
"""Pairs that stay farther apart than this multiple of `_FAR` in the initial motion are left out."""
_STRIDE = 0.05
"""Maximum distance that solids move between two checks on a step of the lattice, m."""
_MOST_STRIDES = 16
"""Maximum number of intervals between the checks on a step."""


class Clearance(Limit):
    """Limit on the distances between the solids of a scene.

    Parameters
    ----------
    chain : Chain
        Chain of the robot.
    scene : Scene
        Scene whose pairs of solids give the values.
    clearance : float
        Minimum distance, m.
    """

    kind = "clearance"
    role = Role.SCENE
    at_rest = "posture"
    inset = _DEVIATION / UNIT
    refusal = "is not kept"

    def __init__(self, chain: Chain, scene: Scene, clearance: float) -> None:
        count = len(scene.pairs)
        self._chain = chain
        self.scene = scene
        self._clearance = clearance
        self._close_pairs = LastCall(self._find_close_pairs)
        self.labels = tuple(
            Label(scene.names(pair), "clearance", "m", "collisions.clearance")
            for pair in range(count)
        )
        self.lower = np.full(count, clearance / UNIT)
        self.upper = np.full(count, np.inf)
        self.bounds = tuple(
            Bound(pair, self._clearance, self._clearance or UNIT, 1.0 / UNIT, "lower")
            for pair in range(count)
        )

    def restrict_to(self, q: np.ndarray) -> Clearance | None:
        """Return the limit for the pairs that come close in postures, (K, n); None if no pair does."""
        q = q[np.isfinite(q).all(axis=1)]
        within = self._clearance + _NEARBY * _FAR
        close = self.scene.find_close(self._chain.place(q), within)
        pairs = np.unique(close.pair)
        if not len(pairs):
            return None
        return self.with_scene(self.scene.with_pairs(pairs))

    def select_from(self, limit: Limit) -> Limit:
        """Return the limit of a scene with the same solids in other places for the pairs of this limit."""
        assert isinstance(limit, Clearance)
        return limit.with_scene(replace(limit.scene, pairs=self.scene.pairs))

    def with_scene(self, scene: Scene) -> Clearance:
        """Return the limit for another scene."""
        return Clearance(self._chain, scene, self._clearance)

    def holds_at_rest(self, q: np.ndarray, slack: float) -> np.ndarray:
        """Tell in which postures, (K, n), no pair is too close, (K,) bool."""
        within = (self.lower.min(initial=np.inf) - slack) * UNIT
        close = self.scene.find_close(self._chain.place(q), within)
        return np.bincount(close.posture, minlength=len(q)) == 0

    def holds_between(
        self, first: np.ndarray, last: np.ndarray, slack: float
    ) -> np.ndarray:
        """Tell on which straight steps no pair is too close; solids move at most `_STRIDE` between checks."""
        ends = [self.scene.centres(self._chain.place(q)) for q in (first, last)]
        moved = np.linalg.norm(ends[1] - ends[0], axis=2).max(axis=1, initial=0.0)
        count = np.ceil(moved / _STRIDE).clip(1, _MOST_STRIDES).astype(int) - 1
        number = np.repeat(np.arange(len(count)), count)
        fraction = (count_each(count) + 1) / (count[number] + 1)
        q = first[number] + fraction[:, None] * (last - first)[number]
        holds = self.holds_at_rest(q, slack)
        free = np.ones(len(first), dtype=bool)
        free[number[~holds]] = False
        return free

    def _find_close_pairs(self, q: np.ndarray) -> ClosePairs:
        return self.scene.find_close(self._chain.place(q), self._clearance + _FAR)

    def values(self, motion: JointStates) -> np.ndarray:
        """Compute the distances, (K, P), in units of `UNIT`."""
        close = self._close_pairs(motion.q)
        shape = (len(motion.q), len(self.labels))
        distances = np.full(shape, (self._clearance + _FAR) / UNIT)
        distances[close.posture, close.pair] = close.distance / UNIT
        return distances

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate the distances with respect to q, (K, P, n); 0 for pairs that are far apart."""
        close = self._close_pairs(motion.q)
        joints = self.scene.joints[self.scene.pairs[close.pair]]
        placed = self._chain.place(motion.q)
        slopes = np.zeros((len(close.pair), motion.q.shape[1]))
        for side, sign in ((0, -1.0), (1, 1.0)):
            moving = (close.posture, joints[:, side], close.points[:, side])
            slopes += sign * self._chain.slopes(placed, *moving, close.normal)
        by_q = np.zeros((len(motion.q), len(self.labels), motion.q.shape[1]))
        by_q[close.posture, close.pair] = slopes / UNIT
        return Partials(q=by_q)


def build_clearance(robot: Robot, task: Task) -> Clearance | None:
    """Build the clearance limit of a task; None if there are no pairs of solids."""
    if task.collision_mode != "avoid":
        return None
    scene = scene_of(robot, task)
    if scene is None or not len(scene.pairs):
        return None
    return Clearance(Chain.of(robot.model), scene, task.collisions.clearance)
