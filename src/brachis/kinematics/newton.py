"""Newton's method for postures that meet a target, with linear conditions on the joints that make them unique.

    f(q) = z,  C q = c:        [J; C] dq = (z - f(q), c - C q)

for a batch of K postures at once. Tool placement and Jacobian come from the screw axes of the chain, which move all
postures of a batch together (`ChainGeometry.posed`).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.ik import ChainGeometry
from brachis.robot import TaskMap

_MET = 1e-10
"""Miss, in m or rad, after which one more step meets the target to rounding: Newton's method squares it."""
_LARGEST_STEP = 0.5
"""rad or m; longer steps are shortened, since the linear model says little about postures so far away."""
_STEPS = 15


class Newton:
    """Newton's method on the task coordinates of a robot.

    Parameters
    ----------
    task_map : TaskMap
    """

    def __init__(self, task_map: TaskMap) -> None:
        self._task_map = task_map
        self._geometry = ChainGeometry.of(task_map.robot)

    def task_coordinates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Task coordinates (K, c) and task Jacobian (K, m, n) in postures (K, n)."""
        posed = self._geometry.posed(q)
        linear, angular = np.split(posed.jacobian_columns(range(self._geometry.n)), 2)
        if self._task_map.frame is pin.ReferenceFrame.LOCAL:
            linear, angular = (
                np.einsum("iak,ink->ank", posed.tool_rotation, part)
                for part in (linear, angular)
            )
        twists = np.swapaxes(np.concatenate([linear, angular]), 1, 2)
        values = self._task_map.of_placements(
            posed.tool_position.T, np.moveaxis(posed.tool_rotation, 2, 0)
        )
        return values, self._task_map.jacobian(twists)

    def solve(
        self, targets: np.ndarray, q: np.ndarray, rows: np.ndarray, levels: np.ndarray
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

        Returns
        -------
        (K, n) ndarray
            Angles in the turns into which the search leads; NaN where it does not converge.
        """
        found, left = (
            np.full(q.shape, np.nan),
            np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(levels).all(1)),
        )
        q = q[left]
        for _ in range(_STEPS):
            if not len(left):
                break
            values, jacobian = self.task_coordinates(q)
            own = rows[left]
            miss = np.concatenate(
                [
                    self._task_map.difference(targets[left], values),
                    levels[left] - np.einsum("kij,kj->ki", own, q),
                ],
                axis=1,
            )
            step = solved_each(np.concatenate([jacobian, own], axis=1), miss)
            size = np.abs(step).max(axis=1, initial=0.0)
            q = (
                q
                + step
                * np.minimum(1.0, _LARGEST_STEP / np.maximum(size, _LARGEST_STEP))[
                    :, None
                ]
            )
            met = np.abs(miss).max(axis=1, initial=0.0) < _MET
            found[left[met]] = q[met]
            kept = ~met & np.isfinite(q).all(axis=1)
            left, q = left[kept], q[kept]
        return found

    def nearest(self, targets: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Find the postures that meet targets, (K, c), without self-motion from given ones; (K, n), NaN where none."""
        rows = np.swapaxes(null_spaces(self.task_coordinates(q)[1]), 1, 2)
        return self.solve(targets, q, rows, np.einsum("kij,kj->ki", rows, q))


def null_spaces(jacobian: np.ndarray) -> np.ndarray:
    """Orthonormal bases (K, n, r) of the null spaces of Jacobians (K, m, n)."""
    m = jacobian.shape[1]
    return np.asarray(np.swapaxes(np.linalg.svd(jacobian)[2][:, m:], 1, 2))


def solved_each(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve K linear systems, (K, n, n) and (K, n); those of singular matrices by NaN."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        regular = np.abs(np.linalg.det(matrices)) > 0.0
        answers = np.full(right.shape, np.nan)
        answers[regular] = np.linalg.solve(
            matrices[regular], right[regular][:, :, None]
        )[:, :, 0]
        return answers
