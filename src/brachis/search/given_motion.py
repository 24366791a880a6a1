"""The start from a motion that is known already, of the same task or of one like it.

What is taken over are curves: the postures over the path coordinate, brought onto the path where it is another one, and
the time law. So limits, splines, coordinates and the path may be others than when the motion was planned.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics import (
    CHART,
    ChartMap,
    ChartRows,
    JointSpaceMap,
    Newton,
    chart_around,
    null_spaces,
    transversality,
)
from brachis.optimise.candidate import InitialGuess, PathMap
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.task_map import JointSpace
from brachis.search.lattice import LARGEST_STEP
from brachis.search.schedule import charts_allowed
from brachis.search.solving import SELECTABLE
from brachis.search.starts import FAMILY
from brachis.trajectory import Trajectory

GIVEN = "given motion"
_TIMES = 401


def given_start(
    problem: Problem, decompositions: Sequence[Decomposition], motion: Trajectory
) -> InitialGuess | str:
    """Make a start of a known motion.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    motion : Trajectory

    Returns
    -------
    InitialGuess or str
        Why there is none, in plain words.
    """
    robot = problem.robot
    if motion.joint_names != robot.joint_names:
        return f"its joints are {', '.join(motion.joint_names)}, the robot's {', '.join(robot.joint_names)}"
    t = np.linspace(0.0, motion.t_end, _TIMES)
    s = np.clip(motion.path_coordinate(t), 0.0, 1.0)
    s[[0, -1]] = 0.0, 1.0
    try:
        joint_map, curves, family = _in_coordinates(
            problem, decompositions, motion, s, motion.position(t)
        )
        reached = np.isfinite(joint_map.postures(curves)).all()
    except UnreachableError as error:
        return str(error)
    if not reached:
        return "its postures cannot be brought onto the path"
    return InitialGuess(
        problem, joint_map, curves, motion.t_end, GIVEN, family, timed=True
    )


def _in_coordinates(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    motion: Trajectory,
    s: np.ndarray,
    q: np.ndarray,
) -> tuple[PathMap, np.ndarray, str]:
    """Joint map, its curves (S, 1 + r), and family, for path coordinates (S,) and postures (S, n)."""
    if isinstance(problem.task_map, JointSpace):
        return JointSpaceMap(problem.robot, problem.path), s[:, None], FAMILY
    q = _on_path(problem, s, q)
    if charts_allowed(problem, decompositions):
        chart = _chart(problem, motion, s, q)
        return chart, chart.curves(s, q), CHART
    same = [
        each
        for each in decompositions
        if each.match.redundant_joints == motion.redundant_joints
    ]
    chosen = (same or list(decompositions))[0]
    labels = chosen.match.solver.branches
    branch = next(
        (each for each in chosen.branches if labels[each] == motion.branch),
        chosen.branches[0],
    )
    return (
        chosen.joint_map(q[0], branch),
        np.column_stack([s, q[:, list(chosen.redundant)]]),
        chosen.match.family,
    )


def _chart(
    problem: Problem, motion: Trajectory, s: np.ndarray, q: np.ndarray
) -> ChartMap:
    """Lay a chart around postures, with the motion's own rows where these do for it."""
    robot = problem.robot
    names = motion.redundant_joints
    selected = np.eye(robot.n)[[robot.joint_names.index(name) for name in names]]
    saved = (
        ChartRows.of_arrays(motion.chart_rows, motion.chart_knots)
        if len(motion.chart_rows)
        else None
    )
    own = saved or (
        ChartRows.constant(selected)
        if len(names) == robot.n - problem.task_map.m
        else None
    )
    if own is not None:
        null = null_spaces(Newton(problem.task_map).task_coordinates(q)[1])
        if transversality(own.at(s)[0], null).min() < SELECTABLE:
            own = None
    return chart_around(problem.task_map, problem.path, s, q, own)


def _on_path(problem: Problem, s: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Postures (S, n) on the path, near given ones, between the ends that the task gives.

    Raises
    ------
    UnreachableError
    """
    given = problem.start, problem.end
    ends = [
        own if one is None else one for one, own in zip(given, q[[0, -1]], strict=True)
    ]
    q = q + np.outer(1.0 - s, ends[0] - q[0]) + np.outer(s, ends[1] - q[-1])
    if problem.robot.n >= problem.task_map.m:
        q = Newton(problem.task_map).nearest(problem.path.sample(s).target, q)
    for place, posture in zip((0, -1), given, strict=True):
        if posture is not None:
            q[place] = posture
    if not (np.isfinite(q).all() and np.abs(np.diff(q, axis=0)).max() <= LARGEST_STEP):
        raise UnreachableError("its postures cannot be brought onto the path")
    return q
