"""What a robot's path can prescribe."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from brachis import ik
from brachis.robot import Robot
from brachis.robot.task_map.rows import AXES, POSE_ROWS

_PARALLEL = 1e-9


def natural_space(robot: Robot) -> str | list[str]:
    """Choose what a robot can prescribe at most: a pose, three rows, or those of the plane in which it moves."""
    geometry = ik.ChainGeometry.of(robot)
    along = np.abs(np.where(geometry.revolute[:, None], 1.0 - np.abs(geometry.axes), np.abs(geometry.axes)))
    normals = np.flatnonzero(np.all(along < _PARALLEL, axis=0))
    if len(normals):
        return [row for i, row in enumerate(AXES) if i != normals[0]][: robot.n]
    return "pose" if robot.n >= len(POSE_ROWS) else list(AXES[: robot.n])


def spaces(robot: Robot) -> Iterator[str | list[str]]:
    """Give what a robot might prescribe, the most natural first, then ever fewer rows of its tool's position."""
    yield natural_space(robot)
    for count in range(min(robot.n, len(AXES)), 0, -1):
        yield from (list(rows) for rows in combinations(AXES, count))
