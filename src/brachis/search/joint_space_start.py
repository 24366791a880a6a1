"""The start for a path of all joints: the phase plane's own timing along it."""

from __future__ import annotations

import numpy as np

from brachis.attempt import Start
from brachis.errors import PathError
from brachis.feasibility import beyond_at_rest, in_figures, load_remedies
from brachis.kinematics import JointSpaceMap
from brachis.limits import Limit
from brachis.problem import Problem
from brachis.robot import Robot
from brachis.search.phase_plane import least_times

FAMILY = "path of joints"
_STATIONS = 401


def joint_space_start(problem: Problem) -> Start:
    """Time the path in the phase plane, and start from there.

    Parameters
    ----------
    problem : Problem
        In a space of joints.

    Returns
    -------
    Start

    Raises
    ------
    PathError
        The path leaves the joint ranges, or no motion along it was found and the arm cannot hold a posture on it.
    """
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = problem.path.sample(s).target
    times = least_times(problem.limits, s, q, problem.end_rates)
    for limit in problem.limits:
        # In motion an arm may pass postures that it cannot hold.
        if limit.static and (times is None or not limit.time_scaling):
            _refuse_beyond(problem.robot, limit, s, q, problem.task.refinement.tolerance)
    joint_map = JointSpaceMap(problem.robot, problem.path)
    if times is None:
        return Start(problem, joint_map, s[:, None], np.inf, FAMILY, FAMILY)
    estimate = float(times[-1])
    timed = np.interp(s * estimate, times, s)[:, None]
    return Start(problem, joint_map, timed, estimate, FAMILY, FAMILY, timed=True)


def _refuse_beyond(robot: Robot, limit: Limit, s: np.ndarray, q: np.ndarray, tolerance: float) -> None:
    """Refuse a path along which the arm at rest is beyond a limit."""
    values, beyond = beyond_at_rest(limit, q, tolerance)
    station, column = (int(place) for place in np.unravel_index(np.argmax(beyond), beyond.shape))
    if beyond[station, column] <= 0.0:
        return
    where, label = s[beyond[:, column] > 0.0], limit.labels[column]
    found, allowed = in_figures(limit, column, float(values[station, column]))
    error = PathError(
        f"the {label.kind} limit of {label.subject!r} {limit.refusal}",
        s_interval=(float(where[0]), float(where[-1])),
        where="path",
        found=f"{found} {label.unit} at s = {s[station]:.3g}",
        allowed=f"{allowed} {label.unit}",
        hint="Lead the path elsewhere",
    )
    raise error.with_remedies(*load_remedies(robot, limit, column, 1.0 + float(beyond[station, column])))
