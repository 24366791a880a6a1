"""Stations along a path, which are closer together where the path bends or the tool turns."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import spread
from brachis.path import Path
from brachis.problem.problem import Problem
from brachis.robot import TaskMap
from brachis.robot.plausibility import link_lengths

_STATIONS = 401
"""Number of stations along the joint path of a guess."""
_LEAST_STATIONS = 41
"""Minimum number of stations along a leg."""
_FEWEST_STEPS = 24.0
"""Minimum number of steps of a lattice."""
_MOST_STEPS = 600
"""Maximum number of steps of a lattice."""
_LONGEST_STEP = 0.05
"""Maximum step of a lattice, m, for arms up to 3.3 m long."""
_LONGEST_SHARE = 0.015
"""Maximum step for longer arms, as a fraction of the arm's length."""
_LARGEST_TURN = 0.25
"""Maximum turn of the direction of motion, or of the tool, in a step of a lattice, rad."""
_PLACES = 2000
"""Approximate number of points at which a path is measured."""


@lru_cache(maxsize=4)
def measure(path: Path, task_map: TaskMap) -> tuple[np.ndarray, np.ndarray]:
    """Return path coordinates, (K,), and the number of steps that a lattice needs up to each of them, (K,)."""
    knots = path.knots
    s = spread(knots, max(2, _PLACES // (len(knots) - 1)))
    targets = path.sample(s).target
    moves = np.diff(targets[:, : len(task_map.axes)], axis=0)
    sizes = np.linalg.norm(moves, axis=1)
    along = moves / np.maximum(sizes, tolerances.LENGTH)[:, None]
    bends = np.linalg.norm(np.diff(along, axis=0, prepend=along[:1]), axis=1)
    change = task_map.difference(targets[1:], targets[:-1])
    turns = np.maximum(task_map.norms(change)[1], bends) / _LARGEST_TURN
    arm = sum(link_lengths(task_map.robot))
    longest = max(_LONGEST_STEP, _LONGEST_SHARE * arm)
    steps = np.max([_FEWEST_STEPS * np.diff(s), sizes / longest, turns], axis=0)
    return s, np.append(0.0, np.cumsum(steps))


def stations(path: Path, task_map: TaskMap, density: float = 1.0) -> np.ndarray:
    """Spread the stations of a lattice; their number follows from the path's length and its turns.

    Parameters
    ----------
    path : Path
    task_map : TaskMap
    density : float, optional
        Factor on the number of stations.

    Returns
    -------
    (S + 1,) ndarray
        Path coordinates, from 0 to 1.
    """
    s, steps = measure(path, task_map)
    # Rounding of the sum must not add a step.
    count = int(min(np.ceil(density * steps[-1] - 1e-6), _MOST_STEPS))
    return np.interp(np.linspace(0.0, steps[-1], count + 1), steps, s)


def spread_stations(problem: Problem, count: int = _STATIONS) -> np.ndarray:
    """Spread about `count` path coordinates, (S,), over the legs, including the ends of the legs."""
    s, steps = measure(problem.path, problem.task_map)
    s_by_leg = [np.zeros(1)]
    for leg in problem.legs:
        first, last = np.interp([leg.begin, leg.end], s, steps)
        least = min(count, _LEAST_STATIONS)
        share = (last - first) / steps[-1]
        on_leg = max(least, math.ceil((count - 1) * share - 1e-6) + 1)
        inner = np.interp(np.linspace(first, last, on_leg)[1:-1], steps, s)
        s_by_leg.append(np.append(inner, leg.end))
    return np.concatenate(s_by_leg)
