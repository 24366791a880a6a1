"""What the viewer draws of a motion, evaluated once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.path import path_of
from brachis.robot import task_map_of
from brachis.trajectory import Samples, Trajectory
from brachis.view.placements import Placements, placements

_INSTANTS = 401
_GHOSTS = 6


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory at even times.

    Attributes
    ----------
    trajectory : Trajectory
    samples : Samples
        At K times from start to end.
    frames : Placements
        At the same times.
    path : (K, 3) ndarray
        The prescribed path at the motion's own s, m; what it does not prescribe is the tool's.
    ghosts : Placements
        At a few even times from start to end.
    """

    trajectory: Trajectory
    samples: Samples
    frames: Placements
    path: np.ndarray
    ghosts: Placements

    @classmethod
    def of(cls, trajectory: Trajectory) -> Motion:
        """Evaluate a trajectory."""
        samples = trajectory.at(np.linspace(0.0, trajectory.t_end, _INSTANTS))
        frames = placements(trajectory.robot, samples.q)
        ghosts = placements(trajectory.robot, trajectory.position(np.linspace(0.0, trajectory.t_end, _GHOSTS)))
        return cls(trajectory, samples, frames, _path(trajectory, samples.s, frames.tool), ghosts)


def _path(trajectory: Trajectory, s: np.ndarray, tool: np.ndarray) -> np.ndarray:
    """Positions that the task prescribes, (K, 3), m."""
    task_map = task_map_of(trajectory.robot, trajectory.task.task_space)
    axes = list(task_map.axes)
    points = tool.copy()
    if axes:
        points[:, axes] = path_of(task_map, trajectory.task).sample(np.clip(s, 0.0, 1.0)).target[:, : len(axes)]
    return points
