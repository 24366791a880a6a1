"""Initial guesses: joint paths from lattices, each smoothed, with coordinates and an estimate of its least time.

If several joints are redundant, the lattice's sample of postures may contain only one class of joint paths, especially
between two given ends. A solve from such a joint path ends at the closest optimum, whereas solves from random joint
paths end at other optima.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.common.deadline import NEVER, Deadline
from brachis.common.progress import Listener, ignore
from brachis.errors import PathError, UnreachableError
from brachis.kernel import Spline, collocation
from brachis.kinematics import CHART, JointSpaceMap, Newton, chart_around
from brachis.limits import Role
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.task_map import JointSpace
from brachis.search.closed_form_lattice import ClosedFormLattice
from brachis.search.differential_ik import differential_ik_paths
from brachis.search.holding import explain_beyond
from brachis.search.hopeless import refuse_hopeless
from brachis.search.joint_path import (
    NO_CHART,
    NO_TIME,
    DeadEnd,
    PosturePath,
)
from brachis.search.lattice import LARGEST_STEP
from brachis.search.phase_plane import fastest_times, least_time
from brachis.search.posture_lattice import PostureLattice
from brachis.search.random_paths import NEARLY, random_joint_paths
from brachis.search.screening import screen
from brachis.search.stages import InitialGuess
from brachis.search.stations import spread_stations

SCREENED = 4
"""Number of joint paths that are examined for each joint path that a level plans."""
FAMILY = "path of joints"
"""Family and origin of the guess for a prescribed joint path."""


@dataclass(frozen=True)
class SearchLevel:
    """One level of the search.

    Attributes
    ----------
    decompositions : int
        Number of decompositions that are searched; those farthest from a singularity at the start come first.
    joint_paths : int
        Number of joint paths taken from the lattice of a decomposition, for each branch on which the motion may begin.
    numeric : int
        Number of further joint paths by numeric inverse kinematics, if the start posture is given.
    in_charts : int
        Number of guesses in charts that are ranked; four times as many joint paths are examined.
    in_closed_forms : int
        Number of guesses in closed forms that are ranked; those with the least estimated time come first.
    refined : int
        Maximum number of candidates that are refined and verified, as long as they may beat the best one.
    cells_per_turn, nodes : int
        Options of the lattice.
    only_minima : bool
        Whether only joint paths of locally least length are taken from the lattice of all postures.
    fallback : bool
        Whether the level is tried only while no motion is verified.
    """

    decompositions: int
    joint_paths: int
    numeric: int
    in_charts: int
    in_closed_forms: int
    refined: int
    cells_per_turn: int = 72
    nodes: int = 120
    only_minima: bool = True
    fallback: bool = False


_LATTICE_SHARE = 0.5
"""Fraction of the remaining time after which the lattice is abandoned, and only random joint paths are tried."""
_RANDOM = 4
"""Number of random joint paths for each joint path that a level plans."""
_LOOKED_AT = 4
"""Number of joint paths that are examined for each joint path that is chosen, if several joints are redundant."""
_SINGLE = SearchLevel(1, 1, 0, in_charts=1, in_closed_forms=1, refined=1)
_FAST = SearchLevel(6, 4, 0, in_charts=4, in_closed_forms=24, refined=4)
_THOROUGH = SearchLevel(
    20, 8, 8, 8, 100, 12, cells_per_turn=96, nodes=300, only_minima=False
)
_EXHAUSTIVE = SearchLevel(
    10_000, 30, 8, 12, 10_000, 40, cells_per_turn=144, nodes=600, only_minima=False
)

SEARCH_LEVELS = {
    "single": (_SINGLE, replace(_FAST, fallback=True)),
    "fast": (_FAST,),
    "thorough": (_FAST, _THOROUGH),
    "exhaustive": (_FAST, _THOROUGH, _EXHAUSTIVE),
}
"""Levels for each ``search.effort`` of a task, tried one after the other, so that a good motion is found soon."""


def lattice_guesses(
    decomposition: Decomposition,
    level: SearchLevel,
    deadline: Deadline = NEVER,
    listener: Listener = ignore,
) -> list[InitialGuess] | DeadEnd:
    """Take the shortest distinct joint paths from a decomposition's lattice; if it has none, from a finer lattice.

    If several joints are redundant, more joint paths are examined, and the most promising ones are chosen.

    Parameters
    ----------
    decomposition : Decomposition
    level : SearchLevel
    deadline : Deadline, optional
    listener : callable, optional

    Returns
    -------
    list of InitialGuess or DeadEnd
    """
    r = len(decomposition.redundant)
    per_branch = max(1, level.joint_paths // max(1, r))
    looked_at = _LOOKED_AT * per_branch if r > 1 and per_branch > 1 else per_branch
    guesses = _take_guesses(decomposition, level, looked_at, deadline)
    count = per_branch * len(decomposition.branches)
    if isinstance(guesses, DeadEnd):
        return guesses
    return screen(guesses, count, deadline, listener)


def _take_guesses(
    decomposition: Decomposition, level: SearchLevel, count: int, deadline: Deadline
) -> list[InitialGuess] | DeadEnd:
    """Take guesses from a decomposition's lattice, from up to `count` joint paths for every branch."""
    for finer, density in ((1, 1.0), (3, 2.0)):
        lattice = ClosedFormLattice(
            decomposition,
            cells_per_turn=finer * level.cells_per_turn,
            density=density,
            nodes=finer * level.nodes,
            deadline=deadline,
        )
        joint_paths = lattice.joint_paths(count * len(decomposition.branches))
        if not isinstance(joint_paths, DeadEnd):
            return [
                _guess_on_branch(decomposition, joint_path, f"lattice {number}")
                for number, joint_path in enumerate(joint_paths, 1)
            ]
        dead_end = joint_paths
    return dead_end


def _smooth(joint_path: PosturePath) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield path coordinates (S,) and postures (S, n) of ever less smooth joint paths; the last is piecewise linear."""
    s = joint_path.s
    # The samples are closer together than the lattice's stations.
    fine = spread_stations(joint_path.problem, max(2 * len(s) - 1, 97))
    weights = np.ones((len(s), 1))
    weights[[0, -1]] = 1e3  # nearly exact at both ends
    for pieces in (3, 8):
        knots = np.r_[np.zeros(3), np.linspace(0.0, 1.0, pieces + 1), np.ones(3)]
        matrix = weights * collocation(knots, 3, s)
        points = np.linalg.lstsq(matrix, weights * joint_path.q, rcond=None)[0]
        yield fine, Spline(knots, points, 3)(fine)
    yield fine, interpolate_columns(fine, s, joint_path.q)


def _guess_on_branch(
    decomposition: Decomposition, joint_path: PosturePath, origin: str
) -> InitialGuess:
    """Smooth a joint path as far as the closed form can follow it, and estimate its time."""
    joint_map = decomposition.joint_map(joint_path.q[0], joint_path.branch)
    for s, smoothed in itertools.islice(_smooth(joint_path), 2):
        curves = np.column_stack([s, smoothed[:, joint_map.redundant]])
        q = joint_map.postures(curves)
        if np.isfinite(q).all():
            # The joint path has to keep clear of the branch boundary if the start posture does.
            margins = joint_map.branch_margins(q)
            least = min(0.02, margins[0].min(initial=np.inf))
            if margins.min(initial=np.inf) > 0.5 * least:
                break
    else:
        s = joint_path.s
        q = joint_path.q
        curves = np.column_stack([s, q[:, joint_map.redundant]])
    problem = decomposition.problem
    estimate = least_time(problem, s, q)
    family = decomposition.match.family
    return InitialGuess(problem, joint_map, curves, estimate, origin, family)


def numeric_guesses(
    decomposition: Decomposition, count: int, deadline: Deadline
) -> list[InitialGuess]:
    """Carry the given start posture along the path by numeric inverse kinematics, in up to `count` ways.

    Joint paths that collide with the scene are left out.

    Parameters
    ----------
    decomposition : Decomposition
        A decomposition with a given start posture; without a start posture, the list is empty.
    count : int
    deadline : Deadline

    Returns
    -------
    list of InitialGuess
    """
    problem = decomposition.problem
    if problem.start is None:
        return []
    joint_map = decomposition.joint_map(problem.start, decomposition.branches[0])
    joint_paths = itertools.islice(differential_ik_paths(joint_map, deadline), count)
    family = decomposition.match.family
    scene = [limit for limit in problem.limits if limit.role is Role.SCENE]
    guesses = []
    for number, joint_path in enumerate(joint_paths, 1):
        q = joint_map.postures(joint_path)
        q = q[np.isfinite(q).all(axis=1)]
        if all(limit.holds_at_rest(q, NEARLY).all() for limit in scene):
            origin = f"numeric {number}"
            guesses.append(
                InitialGuess(problem, joint_map, joint_path, np.inf, origin, family)
            )
    return guesses


def chart_guesses(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    level: SearchLevel,
    deadline: Deadline = NEVER,
    listener: Listener = ignore,
) -> list[InitialGuess] | DeadEnd:
    """Take the most promising of the joint paths that `joint_paths_in_charts` finds; see there.

    Returns
    -------
    list of InitialGuess or DeadEnd
        Improved guesses. Those with the least estimated times come first.
    """
    guesses = joint_paths_in_charts(problem, decompositions, level, deadline)
    if isinstance(guesses, DeadEnd):
        return guesses
    return screen(guesses, level.in_charts, deadline, listener)


def joint_paths_in_charts(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    level: SearchLevel,
    deadline: Deadline = NEVER,
) -> list[InitialGuess] | DeadEnd:
    """Take the shortest distinct joint paths from the lattice of all postures, each with a chart around it.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        Their closed forms give the postures at the start if neither end is given.
    level : SearchLevel
    deadline : Deadline, optional

    Returns
    -------
    list of InitialGuess or DeadEnd
        The guesses with the least estimated times come first.

    Raises
    ------
    PlanningError
        No motion along any joint path can reach a given speed, or meet a limit on the mean of a load.
    """
    for finer in (1, 2):
        lattice = PostureLattice(
            problem,
            decompositions,
            cells_per_turn=finer * level.cells_per_turn,
            density=float(finer),
            nodes=finer * level.nodes // 2,
            only_minima=level.only_minima,
            deadline=deadline.part(_LATTICE_SHARE),
        )
        joint_paths = lattice.joint_paths(SCREENED * level.in_charts)
        is_late = isinstance(joint_paths, DeadEnd) and joint_paths.cause == NO_TIME
        if is_late or not isinstance(joint_paths, DeadEnd):
            break
    if isinstance(joint_paths, DeadEnd):
        if not (is_late and problem.r):
            return joint_paths
        joint_paths = []
    named = [
        (
            f"lattice {number}"
            + (f", from {joint_path.seed}" if joint_path.seed else ""),
            joint_path,
        )
        for number, joint_path in enumerate(joint_paths, 1)
    ]
    # The lattice of one redundant joint has a single joint path if it runs backwards from a given end.
    is_backwards = problem.start is None and problem.end is not None
    is_sampled = problem.r > 1 or is_backwards
    if is_late or (is_sampled and level.in_charts > 1):
        drawn = random_joint_paths(problem, _RANDOM * level.in_charts, deadline)
        named += [
            (f"random {number}", joint_path)
            for number, joint_path in enumerate(drawn, 1)
        ]
    newton = Newton(problem.task_map)
    guesses: list[InitialGuess] = []
    for origin, joint_path in named:
        if guesses and deadline.passed:
            break
        guess = guess_in_chart(newton, joint_path, origin)
        if guess is not None:
            guesses.append(guess)
    if not guesses:
        return DeadEnd(0.0, NO_TIME if deadline.passed else NO_CHART)
    guesses.sort(key=lambda guess: guess.estimate)
    refuse_hopeless(guesses)
    # Joint paths whose estimated time is more than three times the least estimate are hopeless.
    longest = 3.0 * guesses[0].estimate
    return [guess for guess in guesses if guess.estimate <= longest]


def guess_in_chart(
    newton: Newton, joint_path: PosturePath, origin: str
) -> InitialGuess | None:
    """Smooth a joint path, lay a chart around it, and estimate its time; None if no chart can follow it."""
    problem = joint_path.problem
    for s, smoothed in _smooth(joint_path):
        try:
            q = bring_onto_path(problem, newton, s, smoothed)
            chart = chart_around(problem.task_map, problem.path, s, q)
        except UnreachableError:
            continue
        if problem.task.boundary.periodic and not chart.rows.is_constant:
            continue
        estimate = least_time(problem, s, q)
        curves = chart.curves(s, q)
        return InitialGuess(problem, chart, curves, estimate, origin, CHART)
    return None


def bring_onto_path(
    problem: Problem, newton: Newton | None, s: np.ndarray, q: np.ndarray
) -> np.ndarray:
    """Find the postures (S, n) on the path closest to given ones; at the ends, use the postures that the task gives.

    Raises
    ------
    UnreachableError
        Such postures do not exist, or they jump along the path.
    """
    if newton is not None:
        q = newton.nearest(problem.path.sample(s).target, q)
    for place, posture in ((0, problem.start), (-1, problem.end)):
        if posture is not None:
            q[place] = posture
    steps = np.abs(np.diff(q, axis=0))
    if not (np.isfinite(q).all() and steps.max(initial=0.0) <= LARGEST_STEP):
        raise UnreachableError("its postures cannot be brought onto the path")
    return q


def joint_space_guess(problem: Problem) -> InitialGuess:
    """Return the guess for a prescribed joint path, timed in the phase plane.

    Parameters
    ----------
    problem : Problem
        A problem with a prescribed joint path.

    Returns
    -------
    InitialGuess

    Raises
    ------
    PathError
        The path leaves the joint ranges, or no motion along it was found and the arm cannot hold a posture on it.
    """
    s = spread_stations(problem)
    q = problem.path.sample(s).target
    timings = [timing for timing in fastest_times(problem, s, q) if timing is not None]
    is_passed = len(timings) == len(problem.legs)
    for limit in problem.limits:
        # In motion an arm may pass postures that it cannot hold.
        is_needed = not is_passed or limit.longer_time != "relieves"
        if limit.at_rest != "nothing" and is_needed:
            beyond = explain_beyond(problem, limit, s, q)
            if beyond is not None:
                raise beyond[1]
    joint_map = JointSpaceMap(problem.robot, problem.path)
    if not is_passed:
        return InitialGuess(problem, joint_map, s[:, None], np.inf, FAMILY, FAMILY)
    durations = tuple(float(times[-1]) for _, times in timings)
    even = np.linspace(0.0, 1.0, 401)
    timed = [
        np.interp(even * times[-1], times, stations) for stations, times in timings
    ]
    estimate = sum(durations) + problem.dwell_time
    motion = np.concatenate(timed)[:, None]
    return InitialGuess(
        problem, joint_map, motion, estimate, FAMILY, FAMILY, durations=durations
    )


def first_guess(
    problem: Problem, decompositions: Sequence[Decomposition]
) -> InitialGuess:
    """Return a guess for the first joint path found on a lattice, in a closed form if there is one.

    Raises
    ------
    PathError
        The lattices have no joint path.
    """
    if isinstance(problem.task_map, JointSpace):
        return joint_space_guess(problem)
    level = SEARCH_LEVELS["fast"][0]
    if not decompositions:
        guesses = chart_guesses(problem, decompositions, level)
    for decomposition in decompositions:
        guesses = _take_guesses(decomposition, level, 1, NEVER)
        if not isinstance(guesses, DeadEnd):
            break
    if isinstance(guesses, DeadEnd):
        raise PathError(
            f"no joint path was found: {guesses}", s_interval=guesses.interval
        )
    return guesses[0]
