"""Placements of a robot's joints in many postures at once, and the motion of points fixed to the joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

Placed = tuple[np.ndarray, np.ndarray]
"""Rotations, (K, n + 1, 3, 3), and origins, (K, n + 1, 3), m, of the world and all joints in K postures."""


@dataclass(frozen=True, eq=False)
class Chain:
    """A serial chain of one-coordinate joints.

    Attributes
    ----------
    placements : (n, 4, 4) ndarray
        Placement of every joint, at position zero, in the frame of the previous joint.
    axes : (n, 3) ndarray
        Unit vectors in the joints' own frames.
    revolute : (n,) bool ndarray
    """

    placements: np.ndarray
    axes: np.ndarray
    revolute: np.ndarray

    @classmethod
    def of(cls, model: pin.Model) -> Chain:
        """Return the chain of a Pinocchio model."""
        joints = range(1, model.njoints)
        placements = [model.jointPlacements[i].homogeneous for i in joints]
        twists = [model.joints[i].createData().S for i in joints]
        sliding, turning = np.hsplit(np.reshape(twists, (-1, 6)), 2)
        axes = sliding + turning  # one of them is zero
        return cls(np.array(placements), axes, np.any(turning, axis=1))

    @cached_property
    def _skews(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The matrix of the cross product with each axis, and its square."""
        skews = [pin.skew(axis) for axis in self.axes]
        return [(skew, skew @ skew) for skew in skews]

    def place(self, q: np.ndarray) -> Placed:
        """Compute the placements of the joints in postures, (K, n)."""
        count, n = q.shape
        rotations = np.empty((count, n + 1, 3, 3))
        origins = np.empty((count, n + 1, 3))
        rotations[:, 0] = np.eye(3)
        origins[:, 0] = 0.0
        sines = np.sin(q)
        versines = 1.0 - np.cos(q)
        for j in range(n):
            placement = self.placements[j]
            before = rotations[:, j]
            turned = before @ placement[:3, :3]
            origin = origins[:, j] + before @ placement[:3, 3]
            if self.revolute[j]:
                first, second = self._skews[j]
                sine = sines[:, j, None, None]
                versine = versines[:, j, None, None]
                turned = turned @ (np.eye(3) + sine * first + versine * second)
            else:
                origin = origin + (turned @ self.axes[j]) * q[:, j, None]
            rotations[:, j + 1] = turned
            origins[:, j + 1] = origin
        return rotations, origins

    def slopes(
        self,
        placed: Placed,
        posture: np.ndarray,
        joint: np.ndarray,
        points: np.ndarray,
        directions: np.ndarray,
    ) -> np.ndarray:
        """Differentiate the positions of points on joints, along given directions, with respect to q; return (M, n).

        Parameters
        ----------
        placed : Placed
            Placements of the joints in K postures.
        posture, joint : (M,) int ndarray
            Index of the posture, and number of the joint that carries the point; 0 if no joint carries it.
        points, directions : (M, 3) ndarray
            Points, m, and directions, both in the world frame.
        """
        rotations, origins = placed
        axes = np.einsum("kjab,jb->kja", rotations[:, 1:], self.axes)[posture]
        turning = np.cross(axes, points[:, None] - origins[posture, 1:])
        moved = np.where(self.revolute[:, None], turning, axes)
        along = np.einsum("mja,ma->mj", moved, directions)
        carries = np.arange(len(self.axes)) < joint[:, None]
        return np.where(carries, along, 0.0)
