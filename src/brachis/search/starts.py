"""Starts: joint paths from which plans are begun, each with an estimate of its least time."""

from __future__ import annotations

import itertools

import numpy as np

from brachis.attempt import Start
from brachis.deadline import NEVER, Deadline
from brachis.errors import PathError
from brachis.kinematics import Decomposition
from brachis.nlp.numeric_course import numeric_courses
from brachis.search.course import Course, DeadEnd
from brachis.search.efforts import EFFORTS, Effort
from brachis.search.lattice import Lattice
from brachis.search.phase_plane import least_time
from brachis.setting import Choice

_PIECES = (3, 8)
_START_WEIGHT = 1e3
_FINER, _DENSER = 3, 2.0
_FINEST = 96


def lattice_starts(choice: Choice, effort: Effort, seed: int, deadline: Deadline = NEVER) -> list[Start] | DeadEnd:
    """Take the shortest distinct courses from the lattice of a choice; from a finer one where the first one ends.

    Parameters
    ----------
    choice : Choice
    effort : Effort
    seed : int
        Of what is drawn at random with several redundant joints.
    deadline : Deadline, optional

    Returns
    -------
    list of Start or DeadEnd
        Empty where the time was up.
    """
    cells, nodes, most = (
        effort.cells_per_turn,
        effort.nodes,
        max(1, effort.seeds // max(1, len(choice.redundant))) * len(choice.branches),
    )
    found = Lattice(choice, cells_per_turn=cells, nodes=nodes, seed=seed, deadline=deadline).courses(most)
    if isinstance(found, DeadEnd):
        finer = Lattice(
            choice,
            cells_per_turn=_FINER * cells,
            density=_DENSER,
            nodes=_FINER * nodes,
            seed=seed,
            deadline=deadline,
        )
        found = finer.courses(most)
    if isinstance(found, DeadEnd):
        return found
    return [_start_along(course, f"lattice {number}") for number, course in enumerate(found, 1)]


def _start_along(course: Course, origin: str) -> Start:
    """Smooth a course, as far as the closed form can follow, and estimate its time."""
    choice, s = course.choice, course.s
    decomposition = choice.decomposition(course.q[0], course.branch)
    fine = np.linspace(0.0, 1.0, max(2 * len(s) - 1, _FINEST + 1))
    for pieces in _PIECES:
        stations = np.column_stack([fine, _smoothed(s, course.stations[:, 1:], fine, pieces)])
        q = decomposition.postures(stations)
        if np.isfinite(q).all() and _clear(decomposition, q):
            return Start(
                choice, course.branch, course.q[0], stations, least_time(choice.setting.limits, fine, q), origin
            )
    estimate = least_time(choice.setting.limits, s, course.q)
    return Start(choice, course.branch, course.q[0], course.stations, estimate, origin)


def _smoothed(s: np.ndarray, values: np.ndarray, fine: np.ndarray, pieces: int) -> np.ndarray:
    """Least-squares cubic splines through values (S, r), nearly exact at both ends, at the places `fine`."""
    from scipy.interpolate import make_lsq_spline  # noqa: PLC0415  (imports in 0.3 s)

    if not values.shape[1]:
        return np.zeros((len(fine), 0))
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, pieces + 1), np.ones(3)])
    weights = np.ones(len(s))
    weights[[0, -1]] = _START_WEIGHT
    return np.asarray(make_lsq_spline(s, values, knots, k=3, w=weights)(fine))


def _clear(decomposition: Decomposition, q: np.ndarray) -> bool:
    """Tell whether a course keeps clear of the branch boundary, (K, n)."""
    margins = decomposition.branch_margins(q)
    return bool(margins.min(initial=np.inf) > 0.5 * min(0.02, float(margins[0].min(initial=np.inf))))


def numeric_starts(choice: Choice, most: int, deadline: Deadline) -> list[Start]:
    """Carry the given start posture along the path by numeric inverse kinematics, in up to `most` ways.

    Parameters
    ----------
    choice : Choice
        With a given start posture.
    most : int
    deadline : Deadline

    Returns
    -------
    list of Start
    """
    start = choice.setting.start
    if start is None:
        return []
    decomposition = choice.decomposition(start, choice.branches[0])
    courses = itertools.islice(numeric_courses(decomposition, deadline), most)
    return [
        Start(choice, choice.branches[0], start, course, np.inf, f"numeric {number}")
        for number, course in enumerate(courses, 1)
    ]


def first_start(choice: Choice) -> tuple[np.ndarray, int]:
    """Return the given start posture, (n,), or that of the lattice's shortest course where it is free, and its branch.

    Raises
    ------
    PathError
        The start posture is free, and the lattice has no course.
    """
    if choice.setting.start is not None:
        return choice.setting.start, choice.branches[0]
    found = lattice_starts(choice, EFFORTS["fast"][0], choice.setting.task.search.seed)
    if isinstance(found, DeadEnd):
        raise PathError(f"no course along the path was found: {found}", s_interval=found.interval)
    return found[0].posture, found[0].branch
