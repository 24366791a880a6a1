"""The smallest distance between solids during the whole motion, found by branch and bound over time.

Between two instants, the distance between two solids cannot shrink faster than the joints between them can bring them
together. Let d_0 and d_1 be the distances at the ends of a step. Let joint i turn by D_i within the step, and let the
points that it moves be at most r_i from its axis. Then

    d >= (d_0 + d_1 - sum_i r_i D_i) / 2        at all instants of the step.

Steps are halved until the bound is tight enough.
"""

from __future__ import annotations

import numpy as np

from brachis.scene import UNIT, Scene, scene_of
from brachis.verify.limits.protocol import Worst
from brachis.verify.mechanics import joint_placements
from brachis.verify.motion import CheckedMotion, MotionStates

_LOOK = 0.05
"""Margin above the clearance up to which distances are computed, m."""
_ROUNDING = 1e-5
"""Allowed gap between the distance found and the proven bound if the distance is close to the clearance, m."""
_FINE = 1e-3
"""Allowed gap between them if the distance is well above the clearance, m."""
_MOST = 300_000
"""Maximum number of steps that are halved."""
_STATES = 2_000
"""Number of states that are evaluated at once."""


def worst_clearance(motion: CheckedMotion) -> Worst | None:
    """Find the smallest distance between solids, as a ratio that is 1 at the clearance and larger below it."""
    clearance = motion.task.collisions.clearance
    scene = scene_of(motion.robot, motion.task)
    if scene is None or not len(scene.pairs):
        return None
    search = _Search(motion, scene, clearance)
    search.run()
    least = search.least
    remark = f"smallest distance {1e3 * least:.2f} mm"
    subject = scene.names(search.pair)
    in_world = scene.joints[scene.pairs] == motion.robot.world[0]
    stands = (scene.pairs >= scene.robot_count) & in_world
    to_bodies = np.where(stands.any(axis=1), search.distances, np.inf)
    nearest = int(to_bodies.argmin())
    if nearest != search.pair and to_bodies[nearest] < clearance + _LOOK:
        remark += f", to a body of the scene {1e3 * to_bodies[nearest]:.2f} mm ({scene.names(nearest)})"
    if least >= clearance + _LOOK:
        remark = f"nothing is closer than {1e3 * least:.0f} mm"
        subject = "scene"
    if search.proven < min(clearance, least) - 2.0 * _ROUNDING:
        least = search.proven
        remark = f"search stopped early: {remark}, the proven lower bound is {1e3 * least:.2f} mm"
    ratio = max(1.0 + (clearance - least) / UNIT, 0.0)
    is_kept = motion.task.collision_mode == "avoid"
    return Worst(ratio, subject, search.time, remark, is_kept)


class _Search:
    """Branch and bound over time.

    Attributes
    ----------
    least, time, pair : float, float, int
        Smallest distance found, m, with the time, s, and the pair at which it occurs.
    distances : (P,) ndarray
        Smallest distance of each pair at the instants that were checked, m.
    proven : float
        Proven bound, m: apart from the allowed gaps, no distance is smaller than both this bound and `least`.
    """

    def __init__(self, motion: CheckedMotion, scene: Scene, clearance: float) -> None:
        self._motion = motion
        self._scene = scene
        self._clearance = clearance
        self._reach = _reaches(motion, scene)
        self._fastest = np.abs(motion.pieces.velocity).max(axis=0)[
            :, : len(self._reach)
        ]
        self.least = clearance + _LOOK
        self.time = motion.states.t[0]
        self.pair = 0
        self.distances = np.full(len(scene.pairs), self.least)
        self.proven = np.inf
        self._halved = 0

    def run(self) -> None:
        """Search the whole motion."""
        states = self._motion.states
        for first in range(0, max(len(states.t) - 1, 1), _STATES):
            self._search(states.only(slice(first, first + _STATES + 1)))

    def _search(self, states: MotionStates) -> None:
        """Search at the given states and between them."""
        placed = joint_placements(self._motion.robot, states.q)
        far = self._clearance + _LOOK
        distance = np.maximum(self._scene.bounds(placed), far)
        close = self._scene.find_close(placed, far)
        distance[close.posture, close.pair] = close.distance
        self._record(close.distance, states.t[close.posture], close.pair)
        # Both sides of a node are the same instant, so nothing moves between them.
        inside = states.index[1:] == states.index[:-1]
        step = np.where(inside, np.diff(states.u), 0.0)
        piece_of_step = states.index[:-1]
        travel = step[:, None] * self._motion.pieces.lengths[piece_of_step, None]
        moved = (travel * self._fastest[piece_of_step]) @ self._reach
        lower = 0.5 * (distance[1:] + distance[:-1] - moved)
        index, pair = np.nonzero(lower < self._goal)
        ends = states.u[index], states.u[index + 1]
        values = distance[index, pair], distance[index + 1, pair]
        self._halve(piece_of_step[index], pair, ends, values)

    def _halve(
        self,
        index: np.ndarray,
        pair: np.ndarray,
        ends: tuple[np.ndarray, np.ndarray],
        values: tuple[np.ndarray, np.ndarray],
    ) -> None:
        """Halve steps of pairs, (M,), until the bound of each is tight enough."""
        pieces = self._motion.pieces
        u = np.array(ends)
        d = np.array(values)
        while len(index):
            travel = ((u[1] - u[0]) * pieces.lengths[index])[:, None]
            moved = travel * self._fastest[index]
            approach = np.einsum("mj,jm->m", moved, self._reach[:, pair])
            lower = 0.5 * (d.sum(axis=0) - approach)
            is_open = lower < self._goal
            self._halved += int(is_open.sum())
            if self._halved > _MOST:
                self.proven = min(self.proven, lower.min())
                return
            index = index[is_open]
            pair = pair[is_open]
            u = u[:, is_open]
            d = d[:, is_open]
            middle = 0.5 * (u[0] + u[1])
            states = pieces.positions(index, middle)
            placed = joint_placements(self._motion.robot, states)
            distance = self._scene.measure(placed, np.arange(len(index)), pair).distance
            self._record(distance, pieces.time(index, middle), pair)
            u = np.hstack([[u[0], middle], [middle, u[1]]])
            d = np.hstack([[d[0], distance], [distance, d[1]]])
            index = np.tile(index, 2)
            pair = np.tile(pair, 2)

    @property
    def _goal(self) -> float:
        """Lower bound on the distance that must be proven for a step, m."""
        near = min(self.least, self._clearance) - _ROUNDING
        return max(near, self.least - _FINE)

    def _record(self, distance: np.ndarray, t: np.ndarray, pair: np.ndarray) -> None:
        """Store the smallest distance over all pairs, and the smallest distance of each pair."""
        np.minimum.at(self.distances, pair, distance)
        if distance.min(initial=np.inf) < self.least:
            best = np.argmin(distance)
            self.least = distance[best]
            self.time = t[best]
            self.pair = int(pair[best])


def _reaches(motion: CheckedMotion, scene: Scene) -> np.ndarray:
    """Return the largest distances, (n, P), m, of points of pairs of solids from the axes of the joints between them.

    The value is 1 for a prismatic joint, and 0 for a joint that moves both solids of a pair or neither of them.
    """
    bodies = motion.robot.urdf_dynamics.bodies
    farthest = np.abs(motion.pieces.nodes + motion.pieces.position).max(axis=(0, 1))
    slides = [farthest[j] if body.sliding else 0.0 for j, body in enumerate(bodies)]
    lengths = [np.linalg.norm(body.placement[:3, 3]) for body in bodies]
    along = np.cumsum(np.array(lengths) + slides)
    starts = np.append(0.0, along)
    centres, radii = scene.balls
    reach = np.zeros((len(bodies), len(scene.pairs)))
    for number, pair in enumerate(scene.pairs):
        inner, outer = sorted(pair, key=lambda solid: scene.joints[solid])
        last = scene.joints[outer]
        size = np.linalg.norm(centres, axis=1) + radii
        for j in range(scene.joints[inner], last):
            far = along[last - 1] - along[j] + size[outer]
            if np.isinf(
                far
            ):  # the outer solid is a half-space: seen from it, the inner one moves
                far = along[j] - starts[scene.joints[inner]] + size[inner]
            reach[j, number] = 1.0 if bodies[j].sliding else far
    return reach
