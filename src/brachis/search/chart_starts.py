"""Starts in charts: joint paths from the lattice of all postures, each with a chart around it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.common.progress import Listener
from brachis.errors import PathError, UnreachableError
from brachis.kinematics import CHART, Newton, chart_around
from brachis.optimise.candidate import InitialGuess, PathMap
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.task_map import JointSpace
from brachis.search.holding import check_holding
from brachis.search.joint_path import NO_CHART, DeadEnd, JointPath
from brachis.search.lattice import LARGEST_STEP
from brachis.search.levels import SEARCH_LEVELS, SearchLevel
from brachis.search.phase_plane import least_time
from brachis.search.posture_lattice import PostureLattice
from brachis.search.screening import screened
from brachis.search.starts import (
    PIECES,
    fine_places,
    joint_space_start,
    lattice_starts,
    perturb,
    smooth,
)
from brachis.search.too_fast import refuse_hopeless_speeds

_FINER = 2
SCREENED = 4
"""So many times the joint paths that a level plans are looked at."""
_AT_LEAST = 2
"""With several redundant joints, where the lattice has fewer, others around these make up so many times as many."""
_HOPELESS = 3.0
"""Joint paths whose estimated time is so many times the least one are left out."""


def chart_starts(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    level: SearchLevel,
    deadline: Deadline = NEVER,
    listener: Listener = lambda _text: None,
) -> list[InitialGuess] | DeadEnd:
    """Take the shortest distinct joint paths from the lattice of all postures; from a finer one where it ends.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        Whose closed forms give postures to begin with where neither end is given.
    level : SearchLevel
    deadline : Deadline, optional
    listener : callable, optional

    Returns
    -------
    list of InitialGuess or DeadEnd
        Those with the least estimated times first; empty where the time was up.
    """
    for finer in (1, _FINER):
        lattice = PostureLattice(
            problem,
            decompositions,
            cells_per_turn=finer * level.cells_per_turn,
            density=float(finer),
            nodes=finer * level.nodes // 2,
            only_minima=level.only_minima,
            seed=problem.task.search.seed,
            deadline=deadline,
        )
        found = lattice.joint_paths(SCREENED * level.in_charts)
        if not isinstance(found, DeadEnd):
            break
    if isinstance(found, DeadEnd):
        return found
    if not found:
        return []
    newton = Newton(problem.task_map)
    named = [
        (_origin(number, joint_path), joint_path)
        for number, joint_path in enumerate(found, 1)
    ]
    if problem.robot.n - problem.task_map.m > 1 and level.in_charts > 1:
        more = perturb(
            found, _AT_LEAST * level.in_charts - len(found), problem.task.search.seed
        )
        named += [
            (f"varied {number}", joint_path)
            for number, joint_path in enumerate(more, 1)
        ]
    starts = (
        None if number and deadline.passed else _start_along(newton, joint_path, origin)
        for number, (origin, joint_path) in enumerate(named)
    )
    ranked = sorted(
        (start for start in starts if start is not None),
        key=lambda start: start.estimate,
    )
    if not ranked and not deadline.passed:
        return DeadEnd(0.0, {NO_CHART: len(named)})
    check_holding(ranked)
    refuse_hopeless_speeds(ranked)
    hopeful = [
        start
        for start in ranked
        if start.estimate <= _HOPELESS * ranked[0].estimate or start is ranked[0]
    ]
    return screened(hopeful, level.in_charts, deadline, listener) if hopeful else []


def _origin(number: int, joint_path: JointPath) -> str:
    return f"lattice {number}" + (
        f", from {joint_path.seed}" if joint_path.seed else ""
    )


def _start_along(
    newton: Newton, joint_path: JointPath, origin: str
) -> InitialGuess | None:
    """Smooth a joint path, lay a chart around it, and estimate its time; None where no chart can follow it."""
    problem = joint_path.problem
    places = fine_places(joint_path.s)
    for pieces in (*PIECES, None):
        q = _followed(newton, joint_path, places, pieces)
        if q is None:
            continue
        try:
            chart = chart_around(problem.task_map, problem.path, places, q)
        except UnreachableError:
            continue
        if problem.task.boundary.periodic and not chart.rows.closes:
            continue
        estimate = least_time(problem.limits, places, q)
        return InitialGuess(
            problem, chart, chart.curves(places, q), estimate, origin, CHART
        )
    return None


def _followed(
    newton: Newton, joint_path: JointPath, places: np.ndarray, pieces: int | None
) -> np.ndarray | None:
    """Postures (S, n) on the path nearest to a smoothed joint path; `pieces` None: to the joint path as it is."""
    if pieces is None:
        q = np.column_stack(
            [np.interp(places, joint_path.s, joint) for joint in joint_path.q.T]
        )
    else:
        q = smooth(joint_path.s, joint_path.q, places, pieces)
    q = newton.nearest(joint_path.problem.path.sample(places).target, q)
    given = joint_path.problem.start, joint_path.problem.end
    for place, posture in zip((0, -1), given, strict=True):
        if posture is not None:
            q[place] = posture
    follows = (
        np.isfinite(q).all()
        and np.abs(np.diff(q, axis=0)).max(initial=0.0) <= LARGEST_STEP
    )
    return q if follows else None


def first_map(
    problem: Problem, decompositions: Sequence[Decomposition]
) -> tuple[PathMap, str]:
    """Return a joint map of the problem, of a closed form where there is one, and its family.

    It begins at the given start posture, or where that is free at that of the first joint path.

    Raises
    ------
    PathError
        The lattice has no joint path.
    """
    level = SEARCH_LEVELS["fast"][0]
    if isinstance(problem.task_map, JointSpace):
        start = joint_space_start(problem)
        return start.joint_map, start.family
    if decompositions and problem.start is not None:
        first = decompositions[0]
        return first.joint_map(problem.start, first.branches[0]), first.match.family
    found = (
        lattice_starts(decompositions[0], level, problem.task.search.seed)
        if decompositions
        else chart_starts(problem, decompositions, level)
    )
    if isinstance(found, DeadEnd):
        raise PathError(f"no joint path was found: {found}", s_interval=found.interval)
    assert found
    return found[0].joint_map, found[0].family
