"""Random joint paths: random postures, or a given one, carried along the path with random drifts."""

from __future__ import annotations

import itertools

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.kinematics import Newton
from brachis.problem.problem import Problem
from brachis.search.joint_path import PosturePath, sampling_box
from brachis.search.stations import spread_stations

_RANDOM_STATIONS = 97
"""Approximate number of stations along a random joint path. In 14 tasks, 81 % of the drawn postures reach the end, the
same as with 385 stations; with 13 stations 78 % do."""
_DRAWN = 8
"""Number of postures drawn for each random joint path: on average over 14 tasks 81 % reach the end, and 14 % in the
worst task."""
_DRIFT = 2.0
"""Maximum standard deviation of a drift, rad or m, in the scales of the joints; it displaces the end by half as much.

On average over 14 tasks, the best of 16 joint paths is 0.5 % slower than with the best of the drifts 1, 2, 4 and 8 for
the same task. With other drifts, it is 0.8 to 1.1 % slower, although larger drifts lead to more distinct joint paths.
"""
NEARLY = 0.2
"""Maximum violation of a limit at rest with which a joint path still counts as a guess."""


def random_joint_paths(
    problem: Problem, count: int, deadline: Deadline = NEVER
) -> list[PosturePath]:
    """Carry random postures, or a given one, along the path, each with a random drift.

    Parameters
    ----------
    problem : Problem
    count : int
        Maximum number of joint paths to find.
    deadline : Deadline, optional
        The list is empty if this time passes.

    Returns
    -------
    list of PosturePath
        Joint paths between the given ends, within the joint ranges. Limits at rest may be exceeded by 20 %.
    """
    rng = np.random.default_rng(problem.task.search.seed)
    newton = Newton(problem.task_map)
    limits = problem.robot.limits
    s = spread_stations(problem, _RANDOM_STATIONS)
    is_backwards = problem.start is None and problem.end is not None
    step = -1 if is_backwards else 1
    ends = [problem.start, problem.end][::step]
    targets = problem.path.sample(s).target[::step]
    draws = _DRAWN * count
    q = rng.uniform(*sampling_box(problem.robot), (draws, problem.robot.n))
    if ends[0] is not None:
        q[:] = ends[0]
    drift = rng.normal(0.0, 1.0, q.shape) * rng.uniform(0.0, _DRIFT, (draws, 1))
    drift *= newton.scales
    paths = np.empty((draws, 0, problem.robot.n))
    remaining = 1.0
    lengths = np.append(0.0, np.abs(np.diff(s[::step])))
    for target, length in zip(targets, lengths, strict=True):
        if deadline.passed or not len(q):
            return []
        moved = q + length * remaining * drift
        if ends[1] is not None:
            moved += length / remaining * (ends[1] - q)
        moved = np.clip(moved, limits.position_lower, limits.position_upper)
        q = newton.nearest(np.repeat(target[None], len(q), axis=0), moved)
        is_inside = (q >= limits.position_lower) & (q <= limits.position_upper)
        inside = is_inside.all(axis=1)
        q = q[inside]
        drift = drift[inside]
        paths = np.concatenate([paths[inside], q[:, None]], axis=1)
        remaining -= length
    posture_limits = [limit for limit in problem.limits if limit.at_rest == "posture"]
    allowed = (
        PosturePath(problem, s, postures[::step], np.inf)
        for postures in paths
        if all(limit.holds_at_rest(postures, NEARLY).all() for limit in posture_limits)
    )
    return list(itertools.islice(allowed, count))
