"""Newton's method for postures that reach their target almost.

With J the Jacobian of the joints that may move and g(q) the gap between target and posture, a round makes a step of
Newton's method and one more with the same J,

    d1 = J(q)^-1 g(q),    d2 = J(q)^-1 g(q + d1),

which leaves a gap of about 2 |g(q + d1)|^2 / |g(q)|. Steps have to shrink, |d2| < |d1| / 2: then the method converges,
and to the answer beside which it began. A posture from which the steps do not converge gives no answer.

P. Deuflhard, Newton methods for nonlinear problems, Springer 2004 (natural monotonicity test).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.screws import ChainGeometry, PosedScrews
from brachis.ik.vectors import apply, apply_inverse
from brachis.robot import TaskMap
from brachis.robot.task_map import Pose

EXACT = 1e-13
"""A gap that needs no polishing, m or rad, for joints near zero."""
_ROUNDS = 4
_FAR = 0.2
"""A step that leads farther, rad or in proportion to a slide's position, leads anywhere."""


class Goal(Protocol):
    """What N postures are to reach, in m rows."""

    def __getitem__(self, samples: np.ndarray) -> Goal:
        """Return the goals of some of the postures."""
        ...

    def gap(self, posed: PosedScrews) -> np.ndarray:
        """Displacement (N, m) that is left, m or rad."""
        ...

    def rows(self, columns: np.ndarray) -> np.ndarray:
        """Rows (m, k, N) in which the gap is stated, out of the tool's Jacobian (6, k, N) in world axes."""
        ...


@dataclass(frozen=True)
class Poses:
    """N poses; components along the first axis (see `vectors`). As goals: gaps are along and about world axes.

    Attributes
    ----------
    position : (3, N) ndarray
        m.
    rotation : (3, 3, N) ndarray
    """

    position: np.ndarray
    rotation: np.ndarray

    @classmethod
    def of_targets(cls, targets: np.ndarray) -> Poses:
        """Return the poses that task coordinates, (N, 12), stand for."""
        return cls(
            targets[:, :3].T, np.moveaxis(targets[:, 3:].reshape(-1, 3, 3), 0, 2)
        )

    @classmethod
    def of_tool(cls, screws: PosedScrews) -> Poses:
        """Return the placements of the tool."""
        return cls(screws.tool_position, screws.tool_rotation)

    def targets(self) -> np.ndarray:
        """Task coordinates, (N, 12)."""
        return np.concatenate(
            [self.position.T, np.moveaxis(self.rotation, 2, 0).reshape(-1, 9)], axis=1
        )

    def __matmul__(self, other: Poses) -> Poses:
        """Move other poses as these ones move the origin; N or 1 of each."""
        rotation = np.stack(
            [apply(self.rotation, other.rotation[:, column]) for column in range(3)],
            axis=1,
        )
        return Poses(apply(self.rotation, other.position) + self.position, rotation)

    def inverse(self) -> Poses:
        """Return the motions that undo these."""
        return Poses(
            -apply_inverse(self.rotation, self.position),
            np.swapaxes(self.rotation, 0, 1),
        )

    def __getitem__(self, samples: np.ndarray) -> Poses:
        """See `Goal`."""
        return Poses(self.position[:, samples], self.rotation[:, :, samples])

    def gap(self, posed: PosedScrews) -> np.ndarray:
        """See `Goal`."""
        turn = 0.5 * cross(posed.tool_rotation, self.rotation).sum(axis=1)
        return np.concatenate([self.position - posed.tool_position, turn]).T

    def rows(self, columns: np.ndarray) -> np.ndarray:
        """See `Goal`."""
        return columns

    def miss(self, posed: PosedScrews) -> np.ndarray:
        """Largest difference (N,) of positions (m) and rotation matrices."""
        shift = np.abs(self.position - posed.tool_position).max(axis=0)
        return np.maximum(
            shift, np.abs(self.rotation - posed.tool_rotation).max(axis=(0, 1))
        )


@dataclass(frozen=True)
class Rows:
    """Rows of N tool positions, and yaw where it is prescribed, as goals.

    Attributes
    ----------
    task_map : TaskMap
    targets : (N, m) ndarray
    """

    task_map: TaskMap
    targets: np.ndarray

    def __getitem__(self, samples: np.ndarray) -> Rows:
        """See `Goal`."""
        return Rows(self.task_map, self.targets[samples])

    def gap(self, posed: PosedScrews) -> np.ndarray:
        """See `Goal`."""
        reached = self.task_map.of_placements(
            posed.tool_position.T, np.moveaxis(posed.tool_rotation, 2, 0)
        )
        return self.task_map.difference(self.targets, reached)

    def rows(self, columns: np.ndarray) -> np.ndarray:
        """See `Goal`."""
        return self.task_map.rates(columns)


def goal_of(task_map: TaskMap, targets: np.ndarray) -> Goal:
    """Return what task coordinates, (N, c), ask for."""
    return (
        Poses.of_targets(targets)
        if isinstance(task_map, Pose)
        else Rows(task_map, targets)
    )


def polished(
    chain: ChainGeometry, joints: Sequence[int], q: np.ndarray, goal: Goal
) -> np.ndarray:
    """Move joints so that the tool reaches what it misses by little.

    Parameters
    ----------
    chain : ChainGeometry
    joints : sequence of int
        As many as the goal has rows.
    q : (N, n) ndarray
    goal : Goal

    Returns
    -------
    (N, m) ndarray
        Positions of these joints, NaN where the method does not converge to an answer beside the given posture.
    """
    q = q.copy()
    columns = list(joints)
    answers = np.full((len(q), len(columns)), np.nan)
    left = np.arange(len(q))
    for _ in range(_ROUNDS):
        if len(left) == 0:
            break
        converged, shrinking = _round(chain, columns, q, goal)
        answers[left[converged]] = q[converged][:, columns]
        again = np.flatnonzero(shrinking & ~converged)
        left = left[again]
        q = q[again]
        goal = goal[again]
    return answers


def _round(
    chain: ChainGeometry, columns: list[int], q: np.ndarray, goal: Goal
) -> tuple[np.ndarray, np.ndarray]:
    """Make two steps with one Jacobian, in place; tell which postures converged and of which the steps shrink."""
    posed = chain.posed(q)
    size = 1.0 + np.abs(q).max(axis=1)
    inverse = _inverses(np.moveaxis(goal.rows(posed.jacobian_columns(columns)), 2, 0))
    gaps = []
    steps = []
    for again in (False, True):
        gap = goal.gap(chain.posed(q) if again else posed)
        step = (inverse @ gap[:, :, None])[:, :, 0]
        q[:, columns] += step
        gaps.append(np.abs(gap).max(axis=1))
        steps.append(np.abs(step).max(axis=1))
    shrinking = (steps[1] < 0.5 * steps[0]) & (steps[0] < _FAR * size)
    small = EXACT * size
    converged = shrinking & (2.0 * gaps[1] ** 2 < small * gaps[0])
    return converged | ((gaps[0] < small) & (gaps[1] < small)), shrinking


def _inverses(matrices: np.ndarray) -> np.ndarray:
    """Inverse matrices (N, m, m), NaN where there is none."""
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        inverses = np.full_like(matrices, np.nan)
        regular = np.linalg.det(matrices) != 0.0
        inverses[regular] = np.linalg.inv(matrices[regular])
        return inverses
