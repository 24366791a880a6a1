"""Newton's method for postures that reach a pose almost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.ik.geometry import ChainGeometry, PosedScrews
from brachis.ik.vectors import apply, apply_inverse, cross

_EXACT = 1e-11
"""A miss that needs no polishing, m or rad."""


@dataclass(frozen=True)
class Poses:
    """N poses; components along the first axis (see `vectors`).

    Attributes
    ----------
    position : (3, N) ndarray
        m.
    rotation : (3, 3, N) ndarray
    """

    position: np.ndarray
    rotation: np.ndarray

    @classmethod
    def of_targets(cls, targets: np.ndarray) -> Poses:
        """Return the poses that task coordinates, (N, 12), stand for."""
        return cls(targets[:, :3].T, np.moveaxis(targets[:, 3:].reshape(-1, 3, 3), 0, 2))

    @classmethod
    def of_tool(cls, screws: PosedScrews) -> Poses:
        """Return the placements of the tool."""
        return cls(screws.tool_position, screws.tool_rotation)

    def targets(self) -> np.ndarray:
        """Task coordinates, (N, 12)."""
        return np.concatenate([self.position.T, np.moveaxis(self.rotation, 2, 0).reshape(-1, 9)], axis=1)

    def __matmul__(self, other: Poses) -> Poses:
        """Move other poses as these ones move the origin; N or 1 of each."""
        rotation = np.stack([apply(self.rotation, other.rotation[:, column]) for column in range(3)], axis=1)
        return Poses(apply(self.rotation, other.position) + self.position, rotation)

    def inverse(self) -> Poses:
        """Return the motions that undo these."""
        return Poses(-apply_inverse(self.rotation, self.position), np.swapaxes(self.rotation, 0, 1))

    def __getitem__(self, samples: np.ndarray) -> Poses:
        """Return some of the poses."""
        return Poses(self.position[:, samples], self.rotation[:, :, samples])

    def gap(self, other: Poses) -> np.ndarray:
        """Displacement (N, 6) that leads from another pose nearby to this one: linear, then angular, world axes."""
        turn = 0.5 * sum(cross(other.rotation[:, column], self.rotation[:, column]) for column in range(3))
        return np.concatenate([self.position - other.position, turn]).T

    def miss(self, other: Poses) -> np.ndarray:
        """Largest difference (N,) of positions (m) and rotation matrices."""
        shift = np.abs(self.position - other.position).max(axis=0)
        return np.maximum(shift, np.abs(self.rotation - other.rotation).max(axis=(0, 1)))


def polished(
    chain: ChainGeometry, joints: Sequence[int], q: np.ndarray, wanted: Poses, slack: np.ndarray, *, steps: int = 8
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move six joints so that the tool meets poses which it misses by little.

    Parameters
    ----------
    chain : ChainGeometry
    joints : sequence of int
        The six.
    q : (N, n) ndarray
    wanted : Poses
    slack : (N,) ndarray
        Postures that miss by more are left as they are, m or rad.
    steps : int, optional
        How many steps of Newton's method to make at most.

    Returns
    -------
    q : (N, n) ndarray
        Nearer to the wanted poses, or unchanged.
    miss : (N,) ndarray
        Largest difference of position (m) and rotation matrix that is left.
    determinant : (N,) ndarray
        Of the Jacobian of the six joints.
    """
    columns = list(joints)
    posed = chain.posed(q)
    reached = Poses.of_tool(posed)
    jacobian = np.moveaxis(posed.jacobian_columns(columns), 2, 0)
    miss, determinant = reached.miss(wanted), np.linalg.det(jacobian)
    near = np.flatnonzero((miss > _EXACT) & (miss < slack) & (determinant != 0.0))
    if steps == 0 or len(near) == 0:
        return q, miss, determinant
    trial = q[near]
    gap = wanted[near].gap(reached[near])
    trial[:, columns] += np.linalg.solve(jacobian[near], gap[:, :, None])[:, :, 0]
    # A step that does not bring a posture much nearer is its last one: a wrong answer has nowhere to go.
    slack = 0.5 * miss[near]
    trial, trial_miss, trial_determinant = polished(chain, columns, trial, wanted[near], slack, steps=steps - 1)
    better = trial_miss < miss[near]
    q = q.copy()
    for old, new in ((q, trial), (miss, trial_miss), (determinant, trial_determinant)):
        old[near[better]] = new[better]
    return q, miss, determinant
