"""Postures to begin with: drawn at random, or all that closed forms give."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.kinematics import Newton
from brachis.problem.problem import Decomposition, Problem
from brachis.robot import Robot
from brachis.robot.joints import TURN, complement

_TRIES = 1000
"""Random postures from which Newton's method begins, before a place counts as out of reach."""


def sampling_box(
    robot: Robot, near: np.ndarray | float = 0.0, opened: Sequence[int] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Box, (n,) and (n,), from which postures are drawn: the ranges, or a turn, or 10 m around a posture `near`.

    `opened` joints are taken as if they had no range.
    """
    limits = robot.limits
    is_open = np.isin(np.arange(robot.n), opened)
    lower = np.where(is_open, -np.inf, limits.position_lower)
    upper = np.where(is_open, np.inf, limits.position_upper)
    reach = np.where(robot.revolute, np.pi, 10.0)
    slides = np.clip(near, limits.position_lower, limits.position_upper)
    middle = np.where(robot.revolute, 0.0, slides)
    highest = np.where(np.isfinite(upper), upper, middle + reach)
    low = np.where(np.isfinite(lower), lower, highest - 2.0 * reach)
    high = np.where(np.isfinite(upper), upper, low + 2.0 * reach)
    return low, high


def reaches(problem: Problem, s: float) -> bool:
    """Tell whether Newton's method finds a posture at a path coordinate from any of many random ones."""
    low, high = sampling_box(problem.robot)
    drawn = np.random.default_rng(0).uniform(low, high, (_TRIES, problem.robot.n))
    targets = np.repeat(problem.path.sample([s]).target, _TRIES, axis=0)
    postures = Newton(problem.task_map).nearest(targets, drawn)
    return bool(np.isfinite(postures).all(axis=1).any())


def cell_sizes(robot: Robot, cells_per_turn: int) -> np.ndarray:
    """Return cell sizes of the joints, (n,), rad or m: at least four cells in a range."""
    limits = robot.limits
    size = np.where(robot.revolute, TURN, 3.0) / cells_per_turn
    return np.minimum(size, 0.25 * (limits.position_upper - limits.position_lower))


def spread_redundant(
    decomposition: Decomposition,
    cells_per_turn: int,
    count: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Spread redundant joints, (C, r), over their ranges: one in every cell; of several joints `count` at random.

    Closed ranges are covered, a turn of an open revolute joint, and what of an open prismatic joint is near the path's
    beginning.
    """
    problem = decomposition.problem
    joints = list(decomposition.redundant)
    turning = problem.robot.revolute[joints]
    low = problem.robot.limits.position_lower[joints]
    high = problem.robot.limits.position_upper[joints]
    size = cell_sizes(problem.robot, cells_per_turn)[joints]
    near = [_near_start(problem, joint) for joint in joints]
    origin = np.clip(np.where(turning, 0.0, near), low, high)
    reach = np.where(turning, 0.5 * TURN, 2.0 + problem.path.length)
    # Closed ranges are covered whole, up to 20 rad or m: every cell takes memory.
    closed = np.isfinite(low) & np.isfinite(high)
    reach = np.where(closed, np.maximum(reach, 20.0), reach)
    first = np.ceil((np.maximum(low, origin - reach) - origin) / size).astype(int)
    last = np.floor((np.minimum(high, origin + reach) - origin) / size).astype(int)
    if len(joints) == 1:
        cells = np.arange(first[0], last[0] + 1)[:, None]
    else:
        shape = (count if joints else 1, len(joints))
        cells = rng.integers(first, last + 1, shape)
    return origin + cells * size


def _near_start(problem: Problem, joint: int) -> float:
    """Where a joint takes the tool nearest to the path's beginning, if it is prismatic, others at zero, m."""
    axes = list(problem.task_map.axes)
    q = np.zeros((2, problem.robot.n))
    q[1, joint] = 1.0
    tool, displaced_tool = problem.robot.tool_placements(q)[0][:, axes]
    axis = displaced_tool - tool
    beginning = problem.path.sample(np.zeros(1)).target[0, : len(axes)]
    return float(axis @ (beginning - tool) / max(axis @ axis, 1e-12))


def solve_all(
    decomposition: Decomposition, targets: np.ndarray, q_r: np.ndarray
) -> np.ndarray:
    """Postures, (C, B, A, n), on all branches for targets (C, m) and redundant joints (C, r); NaN out of reach."""
    n = decomposition.problem.robot.n
    answers = decomposition.match.solver.solve(targets, q_r)
    q = np.empty((*answers.shape[:3], n))
    q[..., list(decomposition.redundant)] = q_r[:, None, None]
    q[..., complement(n, decomposition.redundant)] = answers
    return q
