"""The start for a path of all joints: the phase plane's own timing along it."""

from __future__ import annotations

import numpy as np

from brachis.attempt import Start
from brachis.errors import PathError
from brachis.kinematics import JointSpaceMap
from brachis.limits import Limit, Moments
from brachis.nlp.guess import rest_to_rest
from brachis.problem import Problem
from brachis.search.phase_plane import least_times

FAMILY = "path of joints"
_STATIONS = 401
_SLACK = 1e-9


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
        A limit that holds at rest is exceeded along the path.
    """
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = problem.path.sample(s).target
    for limit in problem.limits:
        if limit.static:
            _refuse_beyond(limit, s, q)
    times = least_times(problem.limits, s, q)
    estimate, joint_path = np.inf, s
    if times is not None:
        estimate = float(times[-1])
        when = np.interp(s, rest_to_rest(s), s)  # normalised times at which a first guess is at even places
        joint_path = np.interp(when * estimate, times, s)
    joint_map = JointSpaceMap(problem.robot, problem.path)
    return Start(problem, joint_map, joint_path[:, None], estimate, FAMILY, FAMILY)


def _refuse_beyond(limit: Limit, s: np.ndarray, q: np.ndarray) -> None:
    """Refuse a path along which the arm at rest is beyond a limit."""
    violation = limit.violation(limit.values(Moments.at_rest(q)))
    beyond = violation - _SLACK * np.maximum(limit.violation_scale, 1.0)
    if (beyond <= 0.0).all():
        return
    column = int(np.argmax(beyond.max(axis=0)))
    where = s[beyond[:, column] > 0.0]
    label = limit.labels[column]
    raise PathError(
        f"the {label.kind} limit of {label.subject!r} {limit.refusal} along the path",
        s_interval=(float(where[0]), float(where[-1])),
        where="path",
        hint=f"Lead the path elsewhere{f', or raise {label.key}' if label.key else ''}",
    )
