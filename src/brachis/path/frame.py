"""The frame in which a path is given, such as that of a workpiece, and the way from its coordinates to the world's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.robot.task_map.protocol import AXES, POSE_ROWS, YAW, position_rows
from brachis.task.points.units import rotation_by

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.protocol import Array
    from brachis.task import Placement

_ROUNDED = 1e-9
"""By how much the rows of a rotation may miss to be a rotation of their own."""


@dataclass(frozen=True, eq=False)
class PathFrame:
    """Task coordinates in a frame, (..., c), as those in the world: ``turn @ coordinates + origin``.

    Attributes
    ----------
    turn : (c, c) ndarray
        An orthogonal matrix.
    origin : (c,) ndarray
        m, rad.
    """

    turn: Array
    origin: Array

    @classmethod
    def of(cls, placement: Placement, rows: Sequence[str]) -> PathFrame:
        """Return the frame with a placement in the world, for a task space with these rows.

        Raises
        ------
        PathError
            The frame turns the rows out of their line or plane.
        """
        rotation = rotation_by("rpy", np.radians(placement.rpy_deg)).as_matrix()
        if tuple(rows) == POSE_ROWS:
            coordinates = np.zeros((12, 12))
            coordinates[:3, :3] = rotation
            coordinates[3:, 3:] = np.kron(rotation, np.eye(3))  # of a matrix row by row
            return cls(coordinates, np.concatenate([placement.xyz, np.zeros(9)]))
        axes = [AXES.index(row) for row in position_rows(rows)]
        block = rotation[np.ix_(axes, axes)]
        if (
            np.abs(block @ block.T - np.eye(len(axes))).max() > _ROUNDED
            or np.linalg.det(block) < 0.0
        ):
            raise PathError(
                "the frame of the path turns it out of the rows of the task space",
                where="path_frame",
                found=f"rpy_deg {list(placement.rpy_deg)} with task_space [{', '.join(rows)}]",
                allowed="a turn within these rows",
                hint="Set task_space: position, or turn the frame about the axis that is not among them",
            )
        turn = np.eye(len(rows))
        turn[: len(axes), : len(axes)] = block
        origin = np.array(placement.xyz)[axes]
        if YAW in rows:
            origin = np.append(origin, np.arctan2(block[1, 0], block[0, 0]))
        return cls(turn, origin)

    def to_world(self, coordinates: Array) -> Array:
        """Return coordinates in the world, (c,)."""
        return np.asarray(self.turn @ coordinates + self.origin)

    def to_frame(self, coordinates: Array) -> Array:
        """Return coordinates in the frame, (c,), of coordinates in the world."""
        return np.asarray(self.turn.T @ (coordinates - self.origin))
