"""Newton's method for postures that reach a target, with linear conditions on the joints that make the posture unique.

    f(q) = z,  C q = c:        [J; C] dq = (z - f(q), c - C q)

These equations are solved for a batch of K postures at once, in the kernel.

If only a solution next to the given posture is accepted, each step must be at most half the previous one. The method
then converges to such a solution; see P. Deuflhard, Newton methods for nonlinear problems, Springer 2004 (natural
monotonicity test).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.common.arrays import apply_each
from brachis.ik.screws import ChainGeometry
from brachis.kernel import find_postures
from brachis.robot import TaskMap


class Newton:
    """Newton's method on the task coordinates of a robot.

    Parameters
    ----------
    task_map : TaskMap
    geometry : ChainGeometry, optional
        Chain to use instead of that of the task map's robot.

    Attributes
    ----------
    scales : (n,) ndarray
        Scales of the robot's joints, rad or m.
    """

    def __init__(
        self, task_map: TaskMap, geometry: ChainGeometry | None = None
    ) -> None:
        self._task_map = task_map
        self._chain = geometry or task_map.robot.chain
        self.scales = task_map.robot.scales

    def task_coordinates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return task coordinates, (K, c), and task Jacobians, (K, m, n), in postures, (K, n)."""
        *placements, twists = self._task_map.place(self._chain, q)
        values = self._task_map.of_placements(*placements)
        return values, self._task_map.jacobian(twists)

    def solve(
        self,
        targets: np.ndarray,
        q: np.ndarray,
        rows: np.ndarray,
        levels: np.ndarray,
        *,
        beside: bool = False,
    ) -> np.ndarray:
        """Find postures close to given ones.

        Parameters
        ----------
        targets : (K, c) ndarray
            Task coordinates z to reach.
        q : (K, n) ndarray
            Postures from which the search begins.
        rows : (K, r, n) ndarray
            Matrices C of the linear conditions; r = n - m.
        levels : (K, r) ndarray
            Right-hand sides c of the linear conditions.
        beside : bool, optional
            Accept only postures next to the given ones. Steps are then fewer and shorter, and a posture is abandoned as
            soon as a step is too long or is more than half the previous one. If the magnitude of the posture is above
            1, the lengths of steps are relative to it.

        Returns
        -------
        (K, n) ndarray
            Postures found, in which angles may differ by whole turns from those given; NaN if the search does not
            converge.
        """
        return find_postures(
            self._chain,
            self._task_map.prescribed,
            targets,
            q,
            (rows, levels),
            beside=beside,
        )

    def polish(
        self, targets: np.ndarray, q: np.ndarray, held: Sequence[int]
    ) -> np.ndarray:
        """Refine postures that almost reach targets, (K, c), with some joints held; return (K, n), NaN on failure."""
        rows = np.broadcast_to(
            np.eye(q.shape[1])[held], (len(q), len(held), q.shape[1])
        )
        return self.solve(targets, q, rows, q[:, held], beside=True)

    def nearest(self, targets: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Find postures, (K, n), that reach targets, (K, c), from given ones without self-motion; NaN on failure."""
        rows = np.swapaxes(self.self_motions(q), 1, 2) / self.scales
        return self.solve(targets, q, rows, apply_each(rows, q))

    def self_motions(self, q: np.ndarray) -> np.ndarray:
        """Return orthonormal bases of self-motion, (K, n, r), in postures, (K, n), in units of the joints' scales."""
        return null_spaces(self.task_coordinates(q)[1] * self.scales)


def null_spaces(jacobian: np.ndarray) -> np.ndarray:
    """Return orthonormal bases, (K, n, r), of the null spaces of Jacobians, (K, m, n)."""
    m = jacobian.shape[1]
    columns = np.swapaxes(jacobian, 1, 2)
    return np.linalg.qr(columns, mode="complete").Q[:, :, m:]


def solve_each(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve K linear systems, (K, n, n) and (K, n); the results of singular matrices are NaN."""
    try:
        return np.linalg.solve(matrices, right[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        regular = np.abs(np.linalg.det(matrices)) > 0.0
        answers = np.full(right.shape, np.nan)
        answers[regular] = solve_each(matrices[regular], right[regular])
        return answers
