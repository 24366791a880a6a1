"""Stations along the path at which the lattice has its layers."""

from __future__ import annotations

import numpy as np

from brachis.path import Path
from brachis.robot import TaskMap

_STEP_LENGTH, _STEP_ANGLE = 0.05, 0.25  # m, rad
_FEWEST, _MOST = 24, 600
_DENSE = 2000


def stations(path: Path, task_map: TaskMap, density: float = 1.0) -> np.ndarray:
    """Spread stations evenly over the path coordinate, as many as its length and its turns ask for.

    Parameters
    ----------
    path : Path
    task_map : TaskMap
    density : float, optional
        Factor on their number.

    Returns
    -------
    (S + 1,) ndarray
        From 0 to 1.
    """
    targets = path.sample(np.linspace(0.0, 1.0, _DENSE + 1)).target
    moves = np.diff(targets[:, : len(task_map.axes)], axis=0)
    sizes = np.linalg.norm(moves, axis=1)
    along = moves[sizes > 0.0] / sizes[sizes > 0.0, None]
    bends = np.arccos(np.clip(np.sum(along[1:] * along[:-1], axis=1), -1.0, 1.0)).sum()
    turns = task_map.norms(task_map.difference(targets[1:], targets[:-1]))[1].sum()
    steps = max(path.length / _STEP_LENGTH, max(bends, turns) / _STEP_ANGLE, _FEWEST)
    return np.linspace(0.0, 1.0, int(min(np.ceil(density * steps), _MOST)) + 1)
