"""Starts: joint paths from which plans are begun, each with an estimate of its least time."""

from __future__ import annotations

import itertools

import numpy as np

from brachis.attempt import Start
from brachis.deadline import NEVER, Deadline
from brachis.kinematics import ClosedFormMap
from brachis.nlp.differential_ik import differential_ik_paths
from brachis.problem import Decomposition
from brachis.search.closed_form_lattice import ClosedFormLattice
from brachis.search.joint_path import DeadEnd, JointPath
from brachis.search.levels import SearchLevel
from brachis.search.phase_plane import least_time

PIECES = (3, 8)
"""Pieces of the splines that smooth a joint path; more where it cannot be followed so."""
_START_WEIGHT = 1e3
_FINER, _DENSER = 3, 2.0
_FINEST = 96


def lattice_starts(
    decomposition: Decomposition, level: SearchLevel, seed: int, deadline: Deadline = NEVER
) -> list[Start] | DeadEnd:
    """Take the shortest distinct joint paths from a decomposition's lattice; from a finer one where the first one ends.

    Parameters
    ----------
    decomposition : Decomposition
    level : SearchLevel
    seed : int
        Of what is drawn at random with several redundant joints.
    deadline : Deadline, optional

    Returns
    -------
    list of Start or DeadEnd
        Empty where the time was up.
    """
    cells, nodes, most = (
        level.cells_per_turn,
        level.nodes,
        max(1, level.joint_paths // max(1, len(decomposition.redundant))) * len(decomposition.branches),
    )
    lattice = ClosedFormLattice(decomposition, cells_per_turn=cells, nodes=nodes, seed=seed, deadline=deadline)
    found = lattice.joint_paths(most)
    if isinstance(found, DeadEnd):
        finer = ClosedFormLattice(
            decomposition,
            cells_per_turn=_FINER * cells,
            density=_DENSER,
            nodes=_FINER * nodes,
            seed=seed,
            deadline=deadline,
        )
        found = finer.joint_paths(most)
    if isinstance(found, DeadEnd):
        return found
    return [_start_along(decomposition, joint_path, f"lattice {number}") for number, joint_path in enumerate(found, 1)]


def _start_along(decomposition: Decomposition, joint_path: JointPath, origin: str) -> Start:
    """Smooth a joint path, as far as the closed form can follow, and estimate its time."""
    s, redundant = joint_path.s, joint_path.q[:, list(decomposition.redundant)]
    joint_map = decomposition.joint_map(joint_path.q[0], joint_path.branch)
    places = fine_places(s)
    for pieces in PIECES:
        stations = np.column_stack([places, smoothed(s, redundant, places, pieces)])
        q = joint_map.postures(stations)
        if np.isfinite(q).all() and _clear(joint_map, q):
            break
    else:
        places, stations, q = s, np.column_stack([s, redundant]), joint_path.q
    estimate = least_time(decomposition.problem.limits, places, q)
    return Start(decomposition.problem, joint_map, stations, estimate, origin, decomposition.match.family)


def fine_places(s: np.ndarray) -> np.ndarray:
    """Path coordinates at which a joint path is looked at more finely than at its stations, (S,)."""
    return np.linspace(0.0, 1.0, max(2 * len(s) - 1, _FINEST + 1))


def smoothed(s: np.ndarray, values: np.ndarray, fine: np.ndarray, pieces: int) -> np.ndarray:
    """Least-squares cubic splines through values (S, r), nearly exact at both ends, at the places `fine`."""
    from scipy.interpolate import make_lsq_spline  # noqa: PLC0415  (imports in 0.3 s)

    if not values.shape[1]:
        return np.zeros((len(fine), 0))
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, pieces + 1), np.ones(3)])
    weights = np.ones(len(s))
    weights[[0, -1]] = _START_WEIGHT
    return np.asarray(make_lsq_spline(s, values, knots, k=3, w=weights)(fine))


def _clear(joint_map: ClosedFormMap, q: np.ndarray) -> bool:
    """Tell whether a joint path keeps clear of the branch boundary, (K, n)."""
    margins = joint_map.branch_margins(q)
    return bool(margins.min(initial=np.inf) > 0.5 * min(0.02, float(margins[0].min(initial=np.inf))))


def numeric_starts(decomposition: Decomposition, most: int, deadline: Deadline) -> list[Start]:
    """Carry the given start posture along the path by numeric inverse kinematics, in up to `most` ways.

    Parameters
    ----------
    decomposition : Decomposition
        With a given start posture.
    most : int
    deadline : Deadline

    Returns
    -------
    list of Start
    """
    start = decomposition.problem.start
    if start is None:
        return []
    joint_map = decomposition.joint_map(start, decomposition.branches[0])
    joint_paths = itertools.islice(differential_ik_paths(joint_map, deadline), most)
    return [
        Start(decomposition.problem, joint_map, joint_path, np.inf, f"numeric {number}", decomposition.match.family)
        for number, joint_path in enumerate(joint_paths, 1)
    ]
