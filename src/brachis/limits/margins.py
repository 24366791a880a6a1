"""Margins that a task may ask for: a distance from singular postures, and a distance from the ends of joint ranges.

If u and v are the singular vectors of the smallest singular value of the Jacobian J(q), the slope of this value is u^T
dJ v.
"""

from __future__ import annotations

import numpy as np

from brachis.common.labels import Label
from brachis.limits.protocol import Bound, JointStates, Limit, Partials
from brachis.robot import Robot, task_map_of
from brachis.robot.joints import in_turn_of
from brachis.task import Task


class SingularityLimit(Limit):
    """Ratio of the smallest singular value of the task Jacobian, for the arm's own joints, to the required value.

    Parameters
    ----------
    robot : Robot
    task : Task
    figure : float
        Required smallest singular value.
    """

    kind = "singularity"
    at_rest = "posture"
    refusal = "is not kept"

    def __init__(self, robot: Robot, task: Task, figure: float) -> None:
        self._task_map = task_map_of(robot, task.task_space)
        self._count = len(robot.urdf_joints)
        self._figure = figure
        self.labels = (Label("arm", "singularity", "-", "margins.singularity"),)
        self.lower = np.ones(1)
        self.upper = np.full(1, np.inf)
        self.bounds = (Bound(0, figure, figure, 1.0 / figure, "lower"),)

    def _arm_jacobian(self, twists: np.ndarray) -> np.ndarray:
        return self._task_map.jacobian(twists)[:, :, : self._count]

    def values(self, motion: JointStates) -> np.ndarray:
        jacobian = self._arm_jacobian(self._task_map.twists(motion.q))
        least = np.linalg.svd(jacobian, compute_uv=False)[:, -1:]
        return least / self._figure

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate the ratio with respect to q, (K, 1, n)."""
        twists = self._task_map.twists(motion.q)
        u, sizes, vt = np.linalg.svd(self._arm_jacobian(twists))
        last = sizes.shape[1] - 1
        moving = np.zeros_like(motion.q)
        moving[:, : self._count] = vt[:, last]
        still = np.zeros_like(moving)
        slopes = self._task_map.derivatives(twists, moving, still).velocity_q
        by_q = np.einsum("ki,kij->kj", u[:, :, last], slopes)
        return Partials(q=by_q[:, None] / self._figure)


class JointEndLimit(Limit):
    """Limit that keeps joint positions away from both ends of their ranges; a range counts from 0 to 1.

    Parameters
    ----------
    robot : Robot
    share : float
        Fraction of each range that is kept clear at either end.
    """

    kind = "joint_ends"
    at_rest = "posture"
    refusal = "is not kept"

    def __init__(self, robot: Robot, _task: Task, share: float) -> None:
        count = len(robot.urdf_joints)
        lower = robot.limits.position_lower[:count]
        width = robot.limits.position_upper[:count] - lower
        joints = np.flatnonzero(np.isfinite(width))
        self._joints = joints
        self._begin = lower[joints]
        self._width = width[joints]
        self._revolute = robot.revolute[joints]
        self._rows = np.eye(robot.n)[joints] / self._width[:, None]
        self.labels = tuple(
            Label(robot.joint_names[joint], "range margin", "-", "margins.joint_ends")
            for joint in joints
        )
        self.lower = np.full(len(joints), share)
        self.upper = 1.0 - self.lower
        self.violation_scale = np.minimum(self._width, 1.0)

    def holds_at_rest(self, q: np.ndarray, slack: float) -> np.ndarray:
        """Tell in which postures, (K, n), it is met, (K,) bool; angles count in the turn closest to the middle."""
        middle = self._begin + 0.5 * self._width
        turned = q.copy()
        turned[:, self._joints] = in_turn_of(q[:, self._joints], middle, self._revolute)
        return super().holds_at_rest(turned, slack)

    def values(self, motion: JointStates) -> np.ndarray:
        return (motion.q[:, self._joints] - self._begin) / self._width

    def partials(self, motion: JointStates) -> Partials:
        shape = (len(motion.q), *self._rows.shape)
        return Partials(q=np.broadcast_to(self._rows, shape))
