"""Joint paths by differential inverse kinematics along the path.

As in the paper, the start posture is continued along the path. The null-space motion increases the branch margin and
stays within the joint ranges, so that the closed form can follow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.kinematics import ClosedFormMap
from brachis.search.stations import stations


@dataclass(frozen=True)
class Strategy:
    """How numeric inverse kinematics uses the null space.

    Attributes
    ----------
    push : float
        Strength with which a branch margin below `threshold` is raised.
    threshold : float
        Branch margin below which `push` acts, dimensionless.
    drift : float
        Constant motion along the first null-space direction, rad or m per unit s, which may lead to a different local
        optimum.
    centre : float
        Strength with which joints are pulled to the middle of their ranges.
    """

    push: float
    threshold: float
    drift: float = 0.0
    centre: float = 0.0


STRATEGIES = (
    Strategy(2.0, 0.4),
    Strategy(6.0, 0.8),
    Strategy(4.0, 0.6, drift=1.0),
    Strategy(4.0, 0.6, drift=-1.0),
    Strategy(15.0, 1.0),
    Strategy(2.0, 0.1, centre=12.0),
    Strategy(4.0, 0.6, drift=3.0),
    Strategy(4.0, 0.6, drift=-3.0),
)


def differential_ik_paths(
    joint_map: ClosedFormMap, deadline: Deadline = NEVER
) -> Iterator[np.ndarray]:
    """Yield a joint path, (steps, 1 + r), for each strategy, unless it fails or is not complete by the deadline."""
    for strategy in STRATEGIES if joint_map.r else STRATEGIES[:1]:
        joint_path = differential_ik_path(joint_map, strategy, deadline)
        if joint_path is not None:
            yield joint_path


def differential_ik_path(
    joint_map: ClosedFormMap, strategy: Strategy, deadline: Deadline = NEVER
) -> np.ndarray | None:
    """Compute the redundant joints along the path by numeric inverse kinematics from the start posture.

    Close to a branch boundary, the posture is first unfolded while the tool stays where it is, because any motion of
    the tool would need fast joints there.

    Parameters
    ----------
    joint_map : ClosedFormMap
    strategy : Strategy
    deadline : Deadline, optional

    Returns
    -------
    (steps, 1 + r) ndarray or None
        Successive values of s and the redundant joints; None if the path cannot be followed, or the time is up.
    """
    if joint_map.r == 0:
        return np.array([[0.0], [1.0]])
    # Before the first step the posture is unfolded in up to 20 steps.
    s = np.append(np.zeros(20), stations(joint_map.path, joint_map.task_map)[1:])
    q = joint_map.start.astype(float)
    previous = np.zeros_like(q)
    joint_path = [np.append(0.0, q[joint_map.redundant])]
    steps = np.diff(s, prepend=0.0)
    targets = joint_map.path.sample(s).target
    for station, step, target in zip(s, steps, targets, strict=True):
        if not station:
            margin = joint_map.branch_margins(q[None]).min(initial=1.0)
            if margin > 0.5 * strategy.threshold:
                continue
        if deadline.passed:
            return None
        step_s = step if station else None
        moved = _follow(joint_map, strategy, q, previous, target, step_s)
        if moved is not None:
            q, previous = moved
            joint_path.append(np.append(station, q[joint_map.redundant]))
        elif station:
            return None
    return np.array(joint_path)


def _follow(
    joint_map: ClosedFormMap,
    strategy: Strategy,
    q: np.ndarray,
    previous: np.ndarray,
    target: np.ndarray,
    step_s: float | None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Take one step to the next target; return the new posture and the null-space motion; None if out of reach.

    `step_s` is the step in s, or None to unfold on the spot.
    """
    task_map = joint_map.task_map
    for correction in range(5):
        miss = task_map.difference(target, task_map.value(q))
        if correction and np.abs(miss).max() < 1e-3:
            return q, previous
        jacobian = task_map.jacobian(task_map.twists(q[None]))[0]
        square = jacobian @ jacobian.T + 1e-6 * np.eye(len(miss))  # damped
        step = jacobian.T @ np.linalg.solve(square, miss)
        if correction == 0:
            wish = _wish(joint_map, strategy, q, previous)
            free = wish - jacobian.T @ np.linalg.solve(square, jacobian @ wish)
            size = max(np.abs(free).max(), 1e-9)
            # No joint moves by more than 0.2 rad or m; to unfold, the fastest joint moves by 0.06.
            factor = 0.06 / size if step_s is None else min(step_s, 0.2 / size)
            previous = free * factor
            step = step + previous
        q = q + step
    return None


def _wish(
    joint_map: ClosedFormMap, strategy: Strategy, q: np.ndarray, previous: np.ndarray
) -> np.ndarray:
    """Return the desired joint motion per unit s, (n,), which is then projected onto the null space."""
    lower = joint_map.robot.limits.position_lower
    upper = joint_map.robot.limits.position_upper
    stroke = upper - lower
    # At each end a tenth of the range is kept clear, or 0.1 rad or m if the range is open.
    clear = 0.1 * np.where(np.isfinite(stroke), stroke, 1.0)
    wish = 20.0 * np.maximum(lower + clear - q, 0.0)
    wish -= 20.0 * np.maximum(q - upper + clear, 0.0)
    margins = joint_map.branch_margins(q[None])[0]
    if np.any(margins < strategy.threshold):
        gradients = joint_map.solver.margin_gradient(q[None], joint_map.branch)[0]
        shortfall = np.clip(strategy.threshold - margins, 0.0, 2.0 * strategy.threshold)
        wish += strategy.push * shortfall @ gradients
    if strategy.centre:
        ranged = np.isfinite(stroke)
        middle = lower[ranged] + 0.5 * stroke[ranged]
        wish[ranged] += strategy.centre * (middle - q[ranged])
    if strategy.drift:
        first = np.eye(len(q))[joint_map.redundant[0]]
        direction = previous if previous.any() else first
        wish += strategy.drift * direction / np.linalg.norm(direction)
    return wish
