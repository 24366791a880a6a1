"""The most that a robot can prescribe for its tool."""

from __future__ import annotations

import numpy as np

from brachis.ik.geometry import ChainGeometry
from brachis.robot import Robot
from brachis.robot.task_map.rows import AXES, POSE_ROWS

_PARALLEL = 1e-9


def natural_space(robot: Robot) -> str | list[str]:
    """Return the task space of a whole pose, of three rows, or of those of the plane in which a robot moves."""
    geometry = ChainGeometry.of(robot)
    along = np.abs(np.where(geometry.revolute[:, None], 1.0 - np.abs(geometry.axes), np.abs(geometry.axes)))
    normals = np.flatnonzero(np.all(along < _PARALLEL, axis=0))
    if len(normals):
        return [row for i, row in enumerate(AXES) if i != normals[0]][: robot.n]
    return "pose" if robot.n >= len(POSE_ROWS) else list(AXES[: robot.n])
