"""Joint motion without a path: every joint is chosen freely, y = q."""

from __future__ import annotations

import numpy as np

from brachis.kinematics.joint_map import JointDerivatives, JointState
from brachis.robot import Robot


class DirectJointMap:
    """The identity as a `JointMap`, for free moves.

    Parameters
    ----------
    robot : Robot
    start : (n,) ndarray
        Posture at, or near, the beginning.
    """

    path = None
    branch_label = ""

    def __init__(self, robot: Robot, start: np.ndarray) -> None:
        self.robot = robot
        self.start = start

    @property
    def r(self) -> int:
        """See `JointMap`."""
        return self.robot.n

    @property
    def redundant_joints(self) -> tuple[str, ...]:
        """See `JointMap`."""
        return self.robot.joint_names

    def coordinates(self, _s: float, q: np.ndarray) -> np.ndarray:
        """See `JointMap`."""
        return q

    def postures(self, y: np.ndarray) -> np.ndarray:
        """See `JointMap`."""
        return y

    def state(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        *,
        t: np.ndarray | None = None,  # noqa: ARG002  (y itself tells the turns)
        near: np.ndarray | None = None,  # noqa: ARG002
    ) -> JointState:
        """See `JointMap`."""
        gradient = np.broadcast_to(np.eye(self.r), (len(y), self.r, self.r))
        return JointState(self, y, ydot, yddot, ydddot, y, ydot, yddot, gradient)

    def derivatives(self, state: JointState) -> JointDerivatives:
        """See `JointMap`."""
        zeros = np.zeros_like(state.gradient)
        return JointDerivatives(zeros, zeros, zeros)

    def start_margins(self) -> np.ndarray:
        """See `JointMap`."""
        return np.empty(0)

    def margins(self, state: JointState) -> np.ndarray:
        """See `JointMap`."""
        return np.empty((len(state.q), 0))

    def margin_gradient(self, state: JointState) -> tuple[np.ndarray, None]:
        """See `JointMap`."""
        return np.empty((len(state.q), 0, self.r)), None
