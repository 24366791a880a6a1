"""Newton's method for postures that meet a target, with linear conditions on the joints that make them unique.

    f(q) = z,  C q = c:        [J; C] dq = (z - f(q), c - C q)

for a batch of K postures at once, in the kernel.

Where only an answer beside the given posture will do, steps have to shrink by half: then the method converges there.
P. Deuflhard, Newton methods for nonlinear problems, Springer 2004 (natural monotonicity test).
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
        Of another chain than the task map's robot.

    Attributes
    ----------
    scales : (n,) ndarray
        Of the robot's joints, rad or m.
    """

    def __init__(
        self, task_map: TaskMap, geometry: ChainGeometry | None = None
    ) -> None:
        self._task_map = task_map
        self._chain = geometry or task_map.robot.chain
        self.scales = task_map.robot.scales

    def task_coordinates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Task coordinates (K, c) and task Jacobian (K, m, n) in postures (K, n)."""
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
        """Find postures near given ones.

        Parameters
        ----------
        targets : (K, c) ndarray
            Task coordinates z.
        q : (K, n) ndarray
            Postures from which the search begins.
        rows : (K, r, n) ndarray
            C; with r = n - m.
        levels : (K, r) ndarray
            c.
        beside : bool, optional
            Take only postures beside the given ones: fewer and shorter steps, and a posture is given up as soon as a
            step is too long, or does not halve. Lengths are then in proportion to the posture's size where that is
            above 1.

        Returns
        -------
        (K, n) ndarray
            Angles in the turns into which the search leads; NaN where it does not converge.
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
        """Make postures exact that almost meet targets, (K, c), with joints held; (K, n), NaN where none is near."""
        rows = np.broadcast_to(
            np.eye(q.shape[1])[held], (len(q), len(held), q.shape[1])
        )
        return self.solve(targets, q, rows, q[:, held], beside=True)

    def nearest(self, targets: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Find the postures that meet targets, (K, c), without self-motion from given ones; (K, n), NaN where none."""
        rows = np.swapaxes(self.self_motions(q), 1, 2) / self.scales
        return self.solve(targets, q, rows, apply_each(rows, q))

    def self_motions(self, q: np.ndarray) -> np.ndarray:
        """Orthonormal bases, (K, n, r), of self-motion in postures (K, n); units of the joints are their scales."""
        return null_spaces(self.task_coordinates(q)[1] * self.scales)


def null_spaces(jacobian: np.ndarray) -> np.ndarray:
    """Orthonormal bases (K, n, r) of the null spaces of Jacobians (K, m, n)."""
    m = jacobian.shape[1]
    columns = np.swapaxes(jacobian, 1, 2)
    return np.linalg.qr(columns, mode="complete").Q[:, :, m:]


def solve_each(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve K linear systems, (K, n, n) and (K, n); those of singular matrices by NaN."""
    try:
        return np.linalg.solve(matrices, right[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        regular = np.abs(np.linalg.det(matrices)) > 0.0
        answers = np.full(right.shape, np.nan)
        answers[regular] = solve_each(matrices[regular], right[regular])
        return answers
