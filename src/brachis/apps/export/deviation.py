"""Deviations of positions from a path, or from a move without a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.apps.controller import nearest_on_path
from brachis.path import Path, path_of
from brachis.robot import TaskMap, bind
from brachis.trajectory import Trajectory

_SLOW = 1e-3
"""Path velocity, as a fraction of the mean path velocity, below which times are not compared."""


@dataclass(frozen=True, eq=False)
class Way:
    """A path or a move with which positions are compared.

    Attributes
    ----------
    motion : Trajectory
        The motion along it.
    task_map : TaskMap
    path : Path
    t, s : (K,) ndarray
        Times, s, and path coordinates of the motion.
    """

    motion: Trajectory
    task_map: TaskMap
    path: Path
    t: np.ndarray
    s: np.ndarray

    @classmethod
    def of(cls, motion: Trajectory, t: np.ndarray) -> Way:
        """Return the path or the move of a motion, whose times are t, (K,)."""
        task = motion.task
        _, task_map = bind(motion.robot, task.task_space, task.tolerances)
        return cls(
            motion, task_map, path_of(task_map, task), t, motion.path_coordinate(t)
        )

    def deviate(self, values: np.ndarray, t: np.ndarray) -> tuple[float, float]:
        """Return the largest deviations of task coordinates, (k, c), from the path, m or rad, and in time, s."""
        planned = self.motion.path_coordinate(t)
        s = nearest_on_path(self.path, self.task_map, values, planned)
        miss = self.task_map.difference(values, self.path.sample(s).target)
        moves = np.append(True, np.diff(self.s) > 0.0)
        late = np.abs(np.interp(s, self.s[moves], self.t[moves]) - t)
        fast = self.motion.path_spline(t, nu=1) > _SLOW / self.motion.t_end
        return float(np.max(self.task_map.norms(miss))), late[fast].max(initial=0.0)

    def deviate_from_joints(self, q: np.ndarray, t: np.ndarray) -> tuple[float, float]:
        """Return the largest deviations of joints, (k, n), from those of a move, m or rad, and in time, s."""
        motion = self.motion
        qdot = motion.velocity(t)
        square = np.sum(qdot**2, axis=1)
        fast = square > (_SLOW * np.abs(motion.qdot).max()) ** 2
        along = np.sum((q - motion.position(t)) * qdot, axis=1)
        shift = np.divide(along, square, where=fast, out=np.zeros_like(t))
        nearest = np.clip(t + shift, 0.0, motion.t_end)
        miss = np.abs(q - motion.position(nearest)).max()
        return float(miss), np.abs(nearest - t)[fast].max(initial=0.0)
