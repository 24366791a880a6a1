"""Starts: joint paths from which plans are begun, each with an estimate of its least time.

Joint paths around others, for arms with several redundant joints.

The lattice's sample of such an arm's postures may hold a single class of joint paths, above all where both ends are
given, and a solve from it ends at the optimum next to it. Solves from joint paths around it, displaced by waves over s,
end at others.

The start for a path of all joints: the phase plane's own timing along it.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.errors import PathError
from brachis.kinematics import ClosedFormMap, JointSpaceMap
from brachis.limits import Limit
from brachis.optimise.candidate import InitialGuess
from brachis.problem.feasibility import beyond_at_rest, in_figures, load_remedies
from brachis.problem.problem import Decomposition, Problem
from brachis.robot import Robot
from brachis.search.closed_form_lattice import ClosedFormLattice, cell_sizes
from brachis.search.differential_ik import differential_ik_paths
from brachis.search.joint_path import DeadEnd, JointPath
from brachis.search.levels import SearchLevel
from brachis.search.phase_plane import least_time, least_times

PIECES = (3, 8)
"""Pieces of the splines that smooth a joint path; more where it cannot be followed so."""
_START_WEIGHT = 1e3
_FINER = 3
_DENSER = 2.0
_FINEST = 96


def lattice_starts(
    decomposition: Decomposition,
    level: SearchLevel,
    seed: int,
    deadline: Deadline = NEVER,
) -> list[InitialGuess] | DeadEnd:
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
    list of InitialGuess or DeadEnd
        Empty where the time was up.
    """
    cells = level.cells_per_turn
    nodes = level.nodes
    most = max(1, level.joint_paths // max(1, len(decomposition.redundant))) * len(
        decomposition.branches
    )
    lattice = ClosedFormLattice(
        decomposition, cells_per_turn=cells, nodes=nodes, seed=seed, deadline=deadline
    )
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
    return [
        _start_along(decomposition, joint_path, f"lattice {number}")
        for number, joint_path in enumerate(found, 1)
    ]


def _start_along(
    decomposition: Decomposition, joint_path: JointPath, origin: str
) -> InitialGuess:
    """Smooth a joint path, as far as the closed form can follow, and estimate its time."""
    s = joint_path.s
    redundant = joint_path.q[:, list(decomposition.redundant)]
    joint_map = decomposition.joint_map(joint_path.q[0], joint_path.branch)
    places = fine_places(s)
    for pieces in PIECES:
        stations = np.column_stack([places, smooth(s, redundant, places, pieces)])
        q = joint_map.postures(stations)
        if np.isfinite(q).all() and _clear(joint_map, q):
            break
    else:
        places = s
        stations = np.column_stack([s, redundant])
        q = joint_path.q
    estimate = least_time(decomposition.problem.limits, places, q)
    return InitialGuess(
        decomposition.problem,
        joint_map,
        stations,
        estimate,
        origin,
        decomposition.match.family,
    )


def fine_places(s: np.ndarray) -> np.ndarray:
    """Path coordinates at which a joint path is looked at more finely than at its stations, (S,)."""
    return np.linspace(0.0, 1.0, max(2 * len(s) - 1, _FINEST + 1))


def smooth(
    s: np.ndarray, values: np.ndarray, fine: np.ndarray, pieces: int
) -> np.ndarray:
    """Least-squares cubic splines through values (S, r), nearly exact at both ends, at the places `fine`."""
    from scipy.interpolate import make_lsq_spline

    if not values.shape[1]:
        return np.zeros((len(fine), 0))
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, pieces + 1), np.ones(3)])
    weights = np.ones(len(s))
    weights[[0, -1]] = _START_WEIGHT
    return np.asarray(make_lsq_spline(s, values, knots, k=3, w=weights)(fine))


def _clear(joint_map: ClosedFormMap, q: np.ndarray) -> bool:
    """Tell whether a joint path keeps clear of the branch boundary, (K, n)."""
    margins = joint_map.branch_margins(q)
    return bool(
        margins.min(initial=np.inf)
        > 0.5 * min(0.02, float(margins[0].min(initial=np.inf)))
    )


def numeric_starts(
    decomposition: Decomposition, most: int, deadline: Deadline
) -> list[InitialGuess]:
    """Carry the given start posture along the path by numeric inverse kinematics, in up to `most` ways.

    Parameters
    ----------
    decomposition : Decomposition
        With a given start posture.
    most : int
    deadline : Deadline

    Returns
    -------
    list of InitialGuess
    """
    start = decomposition.problem.start
    if start is None:
        return []
    joint_map = decomposition.joint_map(start, decomposition.branches[0])
    joint_paths = itertools.islice(differential_ik_paths(joint_map, deadline), most)
    return [
        InitialGuess(
            decomposition.problem,
            joint_map,
            joint_path,
            np.inf,
            f"numeric {number}",
            decomposition.match.family,
        )
        for number, joint_path in enumerate(joint_paths, 1)
    ]


_LARGEST = 1.0 / 16.0
_SIZES = 4
"""Standard deviation of the largest waves, in turns, and how many sizes there are, each half the one before."""


def perturb(joint_paths: Sequence[JointPath], most: int, seed: int) -> list[JointPath]:
    """Displace joint paths, one after the other and over again, by waves at random.

    Parameters
    ----------
    joint_paths : sequence of JointPath
        At least one.
    most : int
        How many to make.
    seed : int

    Returns
    -------
    list of JointPath
        Within the joints' ranges and from the given ends, but beside the prescribed path: the nearest postures on it
        are meant.
    """
    rng = np.random.default_rng(seed)
    robot = joint_paths[0].problem.robot
    limits = joint_paths[0].problem.robot.limits
    size = _LARGEST * cell_sizes(robot.revolute, 1)
    found = []
    for number in range(most):
        given = joint_paths[number % len(joint_paths)]
        waves = _waves(given)
        heights = rng.normal(
            0.0,
            size / 2.0 ** (number // len(joint_paths) % _SIZES),
            (len(waves), robot.n),
        )
        q = np.clip(
            given.q + waves.T @ heights, limits.position_lower, limits.position_upper
        )
        found.append(dataclasses.replace(given, q=q))
    return found


def _waves(joint_path: JointPath) -> np.ndarray:
    """Displacements over s, (W, S + 1): zero at the ends that are given."""
    s = joint_path.s
    problem = joint_path.problem
    waves = [np.sin(np.pi * s), 0.5 * np.sin(2.0 * np.pi * s)]
    if problem.start is None:
        waves.append(1.0 - s)
    if problem.end is None:
        waves.append(s)
    return np.array(waves)


FAMILY = "path of joints"
_STATIONS = 401


def joint_space_start(problem: Problem) -> InitialGuess:
    """Time the path in the phase plane, and start from there.

    Parameters
    ----------
    problem : Problem
        In a space of joints.

    Returns
    -------
    InitialGuess

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
        if limit.at_rest != "nothing" and (
            times is None or limit.longer_time != "relieves"
        ):
            _refuse_beyond(
                problem.robot, limit, s, q, problem.task.refinement.tolerance
            )
    joint_map = JointSpaceMap(problem.robot, problem.path)
    if times is None:
        return InitialGuess(problem, joint_map, s[:, None], np.inf, FAMILY, FAMILY)
    estimate = float(times[-1])
    timed = np.interp(s * estimate, times, s)[:, None]
    return InitialGuess(problem, joint_map, timed, estimate, FAMILY, FAMILY, timed=True)


def _refuse_beyond(
    robot: Robot, limit: Limit, s: np.ndarray, q: np.ndarray, tolerance: float
) -> None:
    """Refuse a path along which the arm at rest is beyond a limit."""
    values, beyond = beyond_at_rest(limit, q, tolerance)
    station, column = (
        int(place) for place in np.unravel_index(np.argmax(beyond), beyond.shape)
    )
    if beyond[station, column] <= 0.0:
        return
    where = s[beyond[:, column] > 0.0]
    label = limit.labels[column]
    found, allowed = in_figures(limit, column, float(values[station, column]))
    error = PathError(
        f"the {label.kind} limit of {label.subject!r} {limit.refusal}",
        s_interval=(float(where[0]), float(where[-1])),
        where="path",
        found=f"{found} {label.unit} at s = {s[station]:.3g}",
        allowed=f"{allowed} {label.unit}",
        hint="Lead the path elsewhere",
    )
    raise error.with_remedies(
        *load_remedies(robot, limit, column, 1.0 + float(beyond[station, column]))
    )
