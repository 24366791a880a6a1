"""Joint paths by differential inverse kinematics along the path.

As in the paper, it carries the start posture along the path. Its null-space motion climbs the branch margin and stays
within the joint ranges, so that the closed form can follow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.kinematics import ClosedFormMap

# metres a step
_FEWEST_STEPS = 24
_MOST_STEPS = 1000
_STEP_LENGTH = 0.05
_DAMPING = 1e-6
_CORRECTIONS = 5
_UNFOLDING_STEPS = 20
_UNFOLDING_STEP = 0.06
_LARGEST_STEP = 0.2
_ROOMY = 0.05
_RANGE_PUSH = 20.0


@dataclass(frozen=True)
class Strategy:
    """How numeric inverse kinematics uses the null space.

    Attributes
    ----------
    push : float
        Strength with which a branch margin below `threshold` is raised.
    threshold : float
        Dimensionless.
    drift : float
        Constant motion along the first null-space direction, rad or m per unit s; other valleys lie beyond it.
    centre : float
        Strength with which joints are pulled to the middle of their ranges.
    """

    push: float
    threshold: float
    drift: float = 0.0
    centre: float = 0.0


STRATEGIES = (
    Strategy(push=2.0, threshold=0.4),
    Strategy(push=6.0, threshold=0.8),
    Strategy(push=4.0, threshold=0.6, drift=1.0),
    Strategy(push=4.0, threshold=0.6, drift=-1.0),
    Strategy(push=15.0, threshold=1.0),
    Strategy(push=2.0, threshold=0.1, centre=12.0),
    Strategy(push=4.0, threshold=0.6, drift=3.0),
    Strategy(push=4.0, threshold=0.6, drift=-3.0),
)


def differential_ik_paths(
    joint_map: ClosedFormMap, deadline: Deadline = NEVER
) -> Iterator[np.ndarray]:
    """Yield joint paths one after the other; where the first one comes near a branch boundary, the roomiest ones first.

    Parameters
    ----------
    joint_map : ClosedFormMap
    deadline : Deadline, optional
        Joint paths that are not complete by then are left out.

    Yields
    ------
    (steps, 1 + r) ndarray
        See `numeric_course`.
    """
    strategies = STRATEGIES if joint_map.r else STRATEGIES[:1]
    joint_paths = (
        differential_ik_path(joint_map, strategy, deadline)
        for strategy in strategies
        if not deadline.passed
    )
    found = (joint_path for joint_path in joint_paths if joint_path is not None)
    first = next(found, None)
    if first is None:
        return
    if _room(joint_map, first) > _ROOMY:
        yield first
        yield from found
    else:
        yield from sorted(
            (first, *found), key=lambda joint_path: -_room(joint_map, joint_path)
        )


def _room(joint_map: ClosedFormMap, joint_path: np.ndarray) -> float:
    """Return the least branch margin along a joint path; -inf where the branch cannot follow it."""
    q = joint_map.postures(joint_path)
    if not np.isfinite(q).all():
        return -np.inf
    return float(joint_map.branch_margins(q).min(initial=np.inf))


def differential_ik_path(
    joint_map: ClosedFormMap, strategy: Strategy, deadline: Deadline = NEVER
) -> np.ndarray | None:
    """Redundant joints along the path by numeric inverse kinematics from the start posture.

    Near a branch boundary the posture is unfolded first, while the tool stays where it is: there any motion of the tool
    would need fast joints.

    Parameters
    ----------
    joint_map : ClosedFormMap
    strategy : Strategy
    deadline : Deadline, optional

    Returns
    -------
    (steps, 1 + r) ndarray or None
        Successive values of s and the redundant joints; None where the target cannot be followed, or not in time.
    """
    if joint_map.r == 0:
        return np.array([[0.0], [1.0]])
    steps = int(
        np.clip(
            np.ceil(joint_map.path.length / _STEP_LENGTH), _FEWEST_STEPS, _MOST_STEPS
        )
    )
    s = np.linspace(0.0, 1.0, steps + 1)
    targets = joint_map.path.sample(s).target
    q = joint_map.start.astype(float)
    previous = np.zeros_like(q)
    joint_path = [np.append(0.0, q[joint_map.redundant])]
    for _ in range(_UNFOLDING_STEPS):
        if (
            joint_map.branch_margins(q[None]).min(initial=1.0)
            > 0.5 * strategy.threshold
        ):
            break
        moved = _follow(joint_map, strategy, q, previous, targets[0], step_s=None)
        if moved is None or deadline.passed:
            break
        q, previous = moved
        joint_path.append(np.append(0.0, q[joint_map.redundant]))
    for station, target in zip(s[1:], targets[1:], strict=True):
        moved = _follow(joint_map, strategy, q, previous, target, step_s=1.0 / steps)
        if moved is None or deadline.passed:
            return None
        q, previous = moved
        joint_path.append(np.append(station, q[joint_map.redundant]))
    return np.array(joint_path)


def _follow(
    joint_map: ClosedFormMap,
    strategy: Strategy,
    q: np.ndarray,
    previous: np.ndarray,
    target: np.ndarray,
    *,
    step_s: float | None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """One step to the next target: the new posture and the null-space motion made; None if it is not met.

    `step_s` is the step in s, None for unfolding on the spot.
    """
    task_map = joint_map.task_map
    for correction in range(_CORRECTIONS):
        miss = task_map.difference(target, task_map.value(q))
        if correction and np.abs(miss).max() < 1e-3:
            return q, previous
        jacobian = task_map.jacobian(task_map.twists(q[None]))[0]
        square = jacobian @ jacobian.T + _DAMPING * np.eye(len(miss))
        step = jacobian.T @ np.linalg.solve(square, miss)
        if correction == 0:
            wish = _wish(joint_map, strategy, q, previous)
            free = wish - jacobian.T @ np.linalg.solve(square, jacobian @ wish)
            size = float(np.abs(free).max())
            largest = _UNFOLDING_STEP if step_s is None else _LARGEST_STEP
            factor = largest / max(size, 1e-9)
            previous = free * (factor if step_s is None else min(step_s, factor))
            step = step + previous
        q = q + step
    return None


def _wish(
    joint_map: ClosedFormMap, strategy: Strategy, q: np.ndarray, previous: np.ndarray
) -> np.ndarray:
    """Joint motion per unit s that the null space may realise, (n,)."""
    limits = joint_map.robot.limits
    wish = np.zeros_like(q)
    margins = joint_map.branch_margins(q[None])[0]
    if np.any(margins < strategy.threshold):
        gradients = joint_map.branch_margin_gradient(q[None])[0]
        shortfall = np.clip(strategy.threshold - margins, 0.0, 2.0 * strategy.threshold)
        wish += strategy.push * shortfall @ gradients
    # A tenth of the range, or of a radian or metre where it is open, is kept clear at each end.
    stroke = limits.position_upper - limits.position_lower
    clear = 0.1 * np.where(np.isfinite(stroke), stroke, 1.0)
    wish += _RANGE_PUSH * np.maximum(limits.position_lower + clear - q, 0.0)
    wish -= _RANGE_PUSH * np.maximum(q - limits.position_upper + clear, 0.0)
    if strategy.centre:
        ranged = np.isfinite(stroke)
        middle = limits.position_lower[ranged] + 0.5 * stroke[ranged]
        wish[ranged] += strategy.centre * (middle - q[ranged])
    if strategy.drift:
        direction = (
            previous if previous.any() else np.eye(len(q))[joint_map.redundant[0]]
        )
        wish += strategy.drift * direction / np.linalg.norm(direction)
    return wish
