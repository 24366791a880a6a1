"""Where a first motion may begin and lead: a posture far from limits and singularities, and a straight line from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brachis.robot import Robot, TaskMap
from brachis.robot.dynamics import rigid_torque

_POSTURES = 400
"""That are drawn at random."""
_BEST = 4
"""Of them that are looked at."""
_INNER = 0.15
"""Part of a range, at each end, in which no motion begins."""
_FARTHEST = 2.0
"""From zero, rad or m, of a joint that may be nearer."""
_DIGITS = 2
"""Of a position in the task file."""
_STEPS = 10
"""Of a line that is followed."""
_NEWTON = 6
"""Corrections per step."""
_ON_PATH = 1e-8
_SHARE = 0.25
"""Longest line, in lengths of the arm."""
_LENGTHS = (1.0, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Of lines, m."""
_LEAST_DEXTERITY = 1e-3
_KEPT = 0.4
"""Of the dexterity of the first posture, everywhere on the line."""
_CLEARANCE = 0.1
"""Of the tool above the robot's base, in lengths of the arm, where the arm can."""
_STRONGEST = 0.7
"""Of a torque limit, that holding the arm may need."""


@dataclass(frozen=True)
class Choice:
    """A first motion.

    Attributes
    ----------
    posture : (n,) ndarray
        Where it begins, rad or m.
    displacement : (len(axes),) ndarray
        Where it leads, m, in the position rows of the task space.
    """

    posture: np.ndarray
    displacement: np.ndarray


def choices(task_map: TaskMap) -> Iterator[Choice]:
    """Find first motions one by one, the most promising first.

    Postures whose tool stays above the robot's base come first. There are no motions where the robot cannot move its
    tool in all directions of the task space. The same robot gets the same answer: what is drawn at random has a fixed
    seed.
    """
    robot = task_map.robot
    postures = _drawn(robot)
    reach = _reach(robot, postures)
    for lowest in (_CLEARANCE * reach, -np.inf):
        quality = _quality(task_map, postures, reach, lowest)
        best = [k for k in np.argsort(-quality)[:_BEST] if quality[k] > _LEAST_DEXTERITY]
        for k in best:
            line = _line(task_map, postures[k], float(quality[k]), reach, lowest)
            if line is not None:
                yield Choice(postures[k], line)


def _drawn(robot: Robot) -> np.ndarray:
    """Draw postures in the inner part of all ranges, near zero where that is in it, with few digits."""
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    inner = _INNER * np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    near = np.clip([[-_FARTHEST], [_FARTHEST]], lower + inner, upper - inner)
    low, high = np.where(near[1] > near[0], near, [lower + inner, upper - inner])
    drawn = np.random.default_rng(0).uniform(low, high, (_POSTURES, robot.n))
    rounded = np.round(drawn, _DIGITS) + 0.0
    return np.where((rounded > lower) & (rounded < upper), rounded, drawn)


def _reach(robot: Robot, postures: np.ndarray) -> float:
    """Return how far the tool gets about, m."""
    positions, _ = robot.tool_placements(postures)
    return float(np.linalg.norm(np.ptp(positions, axis=0))) / 2.0


def _quality(task_map: TaskMap, postures: np.ndarray, reach: float, lowest: float) -> np.ndarray:
    """Rate postures (K, n): least singular value of the task Jacobian without units, with and without the rail.

    Positions are divided by the arm's length, and so are prismatic joints. Postures count nothing where holding takes
    much, or where the tool is lower than `lowest` above the base, m.
    """
    robot = task_map.robot
    rows = np.where([unit == "m" for unit in task_map.units], 1.0 / reach, 1.0)
    columns = np.where(robot.revolute, 1.0, reach)
    jacobian = rows[:, None] * task_map.jacobian(task_map.twists(postures)) * columns
    dexterity = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
    rail = int(np.argmax(robot.revolute))  # slides before the first joint that turns
    if 0 < rail <= robot.n - task_map.m:
        dexterity = np.minimum(dexterity, np.linalg.svd(jacobian[:, :, rail:], compute_uv=False)[:, -1])
    return dexterity * (_holding(robot, postures) < _STRONGEST) * (robot.heights(postures) >= lowest)


def _holding(robot: Robot, postures: np.ndarray) -> np.ndarray:
    """Return how much of its torque limits a robot needs to hold postures (K, n), at the joint that needs most."""
    still = np.zeros_like(postures)
    torque = rigid_torque(robot, postures, still, still)
    return np.asarray(
        np.max(np.maximum(torque / robot.limits.torque_upper, torque / robot.limits.torque_lower), axis=1)
    )


def _line(task_map: TaskMap, posture: np.ndarray, quality: float, reach: float, lowest: float) -> np.ndarray | None:
    """Find the longest line along an axis on which the arm stays about as dexterous; None where there is none."""
    for length in (each for each in _LENGTHS if each <= _SHARE * reach):
        rated = {}
        for row in range(len(task_map.axes)):
            for sign in (1.0, -1.0):
                displacement = np.zeros(len(task_map.axes))
                displacement[row] = sign * length
                followed = _followed(task_map, posture, displacement)
                if followed is not None:
                    rated[row, sign] = (float(_quality(task_map, followed, reach, lowest).min()), displacement)
        worst, displacement = max(rated.values(), key=lambda each: each[0], default=(0.0, np.zeros(0)))
        if worst > _KEPT * quality:
            return displacement
    return None


def _followed(task_map: TaskMap, posture: np.ndarray, displacement: np.ndarray) -> np.ndarray | None:
    """Follow a line by small steps of least joint motion; None where a joint leaves its range or the line is lost."""
    robot = task_map.robot
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    position, rotation = robot.tool_placements(posture[None])
    step = np.zeros(3)
    step[list(task_map.axes)] = displacement / _STEPS
    postures = [posture]
    for k in range(1, _STEPS + 1):
        target, q = task_map.of_placements(position + k * step, rotation)[0], postures[-1]
        for _ in range(_NEWTON):
            error = task_map.difference(target, task_map.value(q))
            if np.abs(error).max() < _ON_PATH:
                break
            q = q + np.linalg.pinv(task_map.jacobian(task_map.twists(q[None]))[0]) @ error
        else:
            return None
        if np.any(q <= lower) or np.any(q >= upper):
            return None
        postures.append(q)
    return np.array(postures)
