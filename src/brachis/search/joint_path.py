"""Joint paths, the choice of distinct joint paths, and the reasons why a lattice has no joint path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.kinematics import Newton
from brachis.limits import Limit, Moments
from brachis.limits.joint import reciprocals_near
from brachis.problem.feasibility import in_figures
from brachis.problem.problem import Problem
from brachis.robot import Robot

ALL_POSTURES = "all postures"
"""Name of the lattice that is not bound to a choice of redundant joints."""
NO_ANSWER = "it is out of reach"
OTHER_BRANCH = "the branch ends"
NO_CHART = "the arm stays too close to a singularity"
JUMPS = "no neighbouring posture continues the joint path"
NO_TIME = "the time was up"
_TRIES = 1000
"""Number of random postures from which Newton's method is tried before a target counts as out of reach."""


@dataclass(frozen=True)
class PosturePath:
    """Postures along the path.

    Attributes
    ----------
    problem : Problem
    s : (S + 1,) ndarray
    q : (S + 1, n) ndarray
        Postures, rad or m; angles are continuous, without jumps by whole turns.
    length : float
        Length in the measure of the lattice, s^2.
    branch : int
        Index into the closed form's branches; 0 if the joint path is not bound to a branch.
    seed : str
        Redundant joints whose closed form gave the first posture, or ``random``; empty if the task gives this posture.
    """

    problem: Problem
    s: np.ndarray
    q: np.ndarray
    length: float
    branch: int = 0
    seed: str = ""


@dataclass(frozen=True)
class DeadEnd:
    """Where the lattice ends.

    Attributes
    ----------
    s : float
        Path coordinate of the first station that no node reaches.
    cause : str
        Why the lattice ends there: the cause for the impossible edges that came closest to being possible.
    backwards : bool
        Whether the lattice begins at the given end posture.
    """

    s: float
    cause: str
    backwards: bool = False

    @property
    def interval(self) -> tuple[float, float]:
        """Part of the path, in s, that is not reached."""
        return (0.0, self.s) if self.backwards else (self.s, 1.0)

    def __str__(self) -> str:
        """Return the place and the cause, in words."""
        place = (
            f"back from the end posture, at s = {self.s:.3g}"
            if self.backwards
            else f"from s = {self.s:.3g} on"
        )
        return f"{place} {self.cause}"


def distinct(joint_paths: Sequence[PosturePath], count: int) -> list[int]:
    """Choose up to `count` joint paths: the shortest one, and others that are far from the joint paths already chosen.

    Each further choice is the joint path with the largest ratio of its distance from the chosen ones to its length. The
    distance to another branch is infinite.

    Parameters
    ----------
    joint_paths : sequence of PosturePath
        At least one joint path, the shortest one first.
    count : int

    Returns
    -------
    list of int
        Indices of the chosen joint paths.
    """
    branches = np.array([joint_path.branch for joint_path in joint_paths])
    q = np.array([joint_path.q for joint_path in joint_paths])
    length = np.array([joint_path.length for joint_path in joint_paths])
    problem = joint_paths[0].problem
    weights = weights_near(problem.robot, problem.limits, q[0, q.shape[1] // 2])
    distance = np.full(len(joint_paths), np.inf)
    chosen: list[int] = []
    best = 0
    while len(chosen) < min(count, len(joint_paths)):
        chosen.append(best)
        apart = (np.abs(q - q[best]) * weights).max(axis=(1, 2))
        distance = np.minimum(
            distance, np.where(branches == branches[best], apart, np.inf)
        )
        best = int(np.argmax(distance / (length + 1e-9)))
        largest = distance[np.isfinite(distance)].max(initial=0.0)
        if distance[best] <= 0.02 * largest:
            break
    return chosen


def weights_near(robot: Robot, limits: Sequence[Limit], q: np.ndarray) -> np.ndarray:
    """Return the weights of the joints, (n,), with which postures close to `q`, (n,), are compared.

    A weight is the reciprocal of the largest acceleration that the joint's own limits allow if it moves alone. If no
    joint has such limits, it is the reciprocal of the largest velocity.
    """
    by_acceleration, by_velocity = reciprocals_near(robot, limits, q)
    return by_acceleration if by_acceleration.any() else by_velocity


def sampling_box(
    robot: Robot, near: np.ndarray | float = 0.0, opened: Sequence[int] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Return the box, (n,) and (n,), from which postures are drawn: ranges, or one turn, or 10 m around `near`.

    The posture `near` is used only for prismatic joints. The joints `opened` are treated as if they had no range.
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
    """Tell whether Newton's method, begun at many random postures, finds a posture at a path coordinate."""
    low, high = sampling_box(problem.robot)
    drawn = np.random.default_rng(0).uniform(low, high, (_TRIES, problem.robot.n))
    targets = np.repeat(problem.path.sample([s]).target, _TRIES, axis=0)
    postures = Newton(problem.task_map).nearest(targets, drawn)
    return bool(np.isfinite(postures).all(axis=1).any())


def least_excess(limit: Limit, q: np.ndarray) -> tuple[float, int, str]:
    """Find by how much a limit is exceeded at rest on the best of K ways through L postures, (K, L, n).

    Return the largest violation on this way, its column, and a text with the figure there and the allowed figure.
    """
    values = limit.values(Moments.at_rest(q.reshape(-1, q.shape[-1])))
    values = values.reshape(*q.shape[:2], -1)
    beyond = limit.violation(values)
    best = np.argmin(beyond.max(axis=(1, 2)))
    place, column = np.unravel_index(np.argmax(beyond[best]), beyond.shape[1:])
    figure, allowed = in_figures(limit, int(column), float(values[best, place, column]))
    unit = limit.labels[column].after
    text = f"{figure}{unit} at best, allowed: {allowed}{unit}"
    return float(beyond[best, place, column]), int(column), text


def leaving_range(robot: Robot, inside: np.ndarray) -> str:
    """Name the joint that is most often out of its range in K postures; `inside` is (K, n) bool."""
    joint = robot.joint_names[np.argmin(inside.sum(axis=0))]
    return f"the range of joint {joint!r} ends"
