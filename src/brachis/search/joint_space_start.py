"""The start for a path of all joints: the phase plane's own timing along it."""

from __future__ import annotations

import numpy as np

from brachis.attempt import Start
from brachis.errors import PathError
from brachis.feasibility import beyond_at_rest, in_figures
from brachis.kinematics import JointSpaceMap
from brachis.limits import Limit
from brachis.nlp.guess import guessed_progress
from brachis.path import path_speed
from brachis.problem import Problem
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
    boundary = problem.task.boundary
    ends = (boundary.start_speed, 0.0), (boundary.end_speed, 1.0)
    rates = [speed / path_speed(problem.task_map, problem.path, place) for speed, place in ends]
    times = least_times(problem.limits, s, q, (rates[0], rates[1]))
    for limit in problem.limits:
        # In motion an arm may pass postures that it cannot hold.
        if limit.static and (times is None or not limit.time_scaling):
            _refuse_beyond(limit, s, q)
    estimate, joint_path = np.inf, s
    if times is not None:
        estimate = float(times[-1])
        when = np.interp(s, guessed_progress(s, *rates), s)  # normalised times at which a first guess is at even places
        joint_path = np.interp(when * estimate, times, s)
    joint_map = JointSpaceMap(problem.robot, problem.path)
    return Start(problem, joint_map, joint_path[:, None], estimate, FAMILY, FAMILY)


def _refuse_beyond(limit: Limit, s: np.ndarray, q: np.ndarray) -> None:
    """Refuse a path along which the arm at rest is beyond a limit."""
    values, beyond = beyond_at_rest(limit, q)
    station, column = (int(place) for place in np.unravel_index(np.argmax(beyond), beyond.shape))
    if beyond[station, column] <= 0.0:
        return
    where, label = s[beyond[:, column] > 0.0], limit.labels[column]
    found, allowed = in_figures(limit, column, float(values[station, column]))
    raise PathError(
        f"the {label.kind} limit of {label.subject!r} {limit.refusal}",
        s_interval=(float(where[0]), float(where[-1])),
        where="path",
        found=f"{found} {label.unit} at s = {s[station]:.3g}",
        allowed=f"{allowed} {label.unit}",
        hint=f"Lead the path elsewhere{f', or raise {label.key}' if label.key else ''}",
    )
