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
    """A path or a move with which positions are compared at times.

    Attributes
    ----------
    motion : Trajectory
        The motion along it.
    rows : (k,) ndarray
        Indices of the times among those of the whole motion.
    t, s : (k,) ndarray
        Times from the beginning of the motion, s, and its path coordinates.
    task_map : TaskMap
    path : Path
    """

    motion: Trajectory
    rows: np.ndarray
    t: np.ndarray
    s: np.ndarray
    task_map: TaskMap
    path: Path

    @classmethod
    def of(cls, motion: Trajectory, rows: np.ndarray, t: np.ndarray) -> Way:
        """Return the path or the move of a motion."""
        task = motion.task
        _, task_map = bind(motion.robot, task.task_space, task.tolerances)
        s = motion.path_coordinate(t)
        return cls(motion, rows, t, s, task_map, path_of(task_map, task))

    def deviate(
        self,
        values: np.ndarray,
        delays: np.ndarray,
        chosen: np.ndarray,
        *,
        is_linear: bool,
    ) -> tuple[float, float]:
        """Return the largest deviations from the path, m or rad, and in time, s.

        Parameters
        ----------
        values : (l, c) ndarray
            Positions of the joints or, if `is_linear`, task coordinates.
        delays : (l,) ndarray
            Times by which they come later than the chosen times, s.
        chosen : (k,) bool ndarray
            Which of the times are compared.
        is_linear : bool
        """
        planned = self.t[chosen]
        if not is_linear:
            virtual = self.motion.position(planned)[:, values.shape[1] :]
            values = np.hstack([values, virtual])
        if not self.task_map.m:
            return self._deviate_from_joints(values, planned, planned + delays)
        if not is_linear:
            values = self.task_map.values(values)
        t = planned + delays
        s = nearest_on_path(self.path, self.task_map, values, self.s[chosen])
        miss = self.task_map.difference(values, self.path.sample(s).target)
        # A point where the motion dwells is passed from the first to the last of its times.
        moves = np.diff(self.s) > 0.0
        first = np.append(True, moves)
        last = np.append(moves, True)
        early = np.interp(s, self.s[first], self.t[first]) - t
        late = t - np.interp(s, self.s[last], self.t[last])
        fast = self.motion.path_spline(planned, nu=1) > _SLOW / self.motion.t_end
        time = np.maximum(early, late)[fast].max(initial=0.0)
        return float(np.max(self.task_map.norms(miss))), float(time)

    def _deviate_from_joints(
        self, q: np.ndarray, planned: np.ndarray, t: np.ndarray
    ) -> tuple[float, float]:
        """Return the largest deviations of joints at times t, (l,), from those of a move, and in time."""
        motion = self.motion
        qdot = motion.velocity(planned)
        square = np.sum(qdot**2, axis=1)
        fast = square > (_SLOW * np.abs(motion.qdot).max()) ** 2
        along = np.sum((q - motion.position(planned)) * qdot, axis=1)
        shift = np.divide(along, square, where=fast, out=np.zeros_like(t))
        nearest = np.clip(planned + shift, 0.0, motion.t_end)
        miss = np.abs(q - motion.position(nearest)).max()
        return float(miss), float(np.abs(nearest - t)[fast].max(initial=0.0))
