"""Paths of poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.pose import POSITIONS, PosePath, rotations
from brachis.path.pose_blend import blend_poses
from brachis.path.pose_joins import pose_corner
from brachis.path.pose_segment import pose_curve
from brachis.path.rotations import matrices, quaternions_of, rotation_of
from brachis.robot.task_map.rows import AXES, POSE_COORDINATES

if TYPE_CHECKING:
    from brachis.path.protocol import Array

_ROTATION_TOLERANCE = 1e-6


@dataclass(frozen=True)
class PoseCoordinates:
    """The twelve coordinates of poses; see `Coordinates`."""

    rows: tuple[str, ...] = AXES
    curve = staticmethod(pose_curve)
    corner = staticmethod(pose_corner)
    blend = staticmethod(blend_poses)
    path = staticmethod(PosePath)

    def checked(self, start: Array) -> Array:
        """See `Coordinates.checked`."""
        allowed = "the position (3), then a rotation matrix row by row (9)"
        if start.shape != (POSE_COORDINATES,) or not np.all(np.isfinite(start)):
            problem = "the start of a path of poses needs 12 finite coordinates"
            raise PathError(problem, found=start.tolist(), allowed=allowed, where="start")
        rotation = rotations(start)
        stretch = np.abs(rotation @ rotation.T - np.eye(3)).max()
        if stretch > 2.0 * _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0.0:
            problem = "the start of the path has no rotation matrix"
            raise PathError(problem, found=rotation.tolist(), allowed=allowed, where="start")
        nearest = matrices(quaternions_of(rotation_of(rotation))[None])[0]
        return np.concatenate([start[:POSITIONS], nearest.ravel()])
