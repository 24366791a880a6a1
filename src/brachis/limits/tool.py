"""How fast the tool moves, turns and accelerates, as functions of the joint motion, with their derivatives.

With J the Jacobian of a velocity of the tool, v = J(q) qdot and its direction e = v / |v|,

    d|v|/dqdot = e . J,        d|v|/dq = e . dv/dq,

and likewise for the size of the acceleration a = J qddot + Jdot qdot. What is zero has no direction; far from its limit
there, it is given none.
"""

from __future__ import annotations

import numpy as np

from brachis.limits.protocol import JointMotion
from brachis.robot import Robot, task_map_of


def direction(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sizes, (K,), of vectors (K, 3), and their directions, (K, 3); zero where there is none."""
    size = np.linalg.norm(vectors, axis=1)
    return size, np.divide(vectors, size[:, None], out=np.zeros_like(vectors), where=size[:, None] > 0.0)


class ToolSpeed:
    """Speed of the tool frame's origin, m/s.

    Parameters
    ----------
    robot : Robot
    """

    def __init__(self, robot: Robot) -> None:
        self._tool = task_map_of(robot, "position")

    def speed(self, motion: JointMotion) -> np.ndarray:
        """Speeds at K moments, (K,)."""
        return self.slope(motion.q, motion.qdot)

    def slope(self, q: np.ndarray, q_ds: np.ndarray) -> np.ndarray:
        """Size of the origin's displacement per unit of the path, (S,), from postures and their derivatives."""
        jacobian = self._tool.jacobian(self._tool.twists(q))
        return np.asarray(np.linalg.norm(np.einsum("kij,kj->ki", jacobian, q_ds), axis=1))

    def derivatives(self, motion: JointMotion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Speeds, (K,), and their derivatives by q and by qdot, (K, n)."""
        twists = self._tool.twists(motion.q)
        jacobian = self._tool.jacobian(twists)
        speed, along = direction(np.einsum("kij,kj->ki", jacobian, motion.qdot))
        by_q = self._tool.velocity_slopes(twists, motion.qdot)
        return speed, *(np.einsum("ki,kij->kj", along, part) for part in (by_q, jacobian))
