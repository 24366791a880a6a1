"""A joint map without a path: the smallest one that programs, and the checks of joint maps, can be tried with."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import JointDerivatives, JointMap, JointState
from brachis.robot import Robot


class DirectJointMap(JointMap):
    """The identity as a `JointMap`, for free moves.

    Parameters
    ----------
    robot : Robot
    start : (n,) ndarray
        Posture at, or near, the beginning.
    """

    def __init__(self, robot: Robot, start: np.ndarray) -> None:
        self.robot = robot
        self.start = start
        self.r = robot.n
        self.redundant_joints = robot.joint_names

    def coordinates(self, _s: float, q: np.ndarray) -> np.ndarray:
        """Return the posture."""
        return q

    def postures(self, y: np.ndarray) -> np.ndarray:
        """Return the curves."""
        return y

    def state(self, *curves: np.ndarray, **_others: object) -> JointState:
        """Return the curves as the motion; in which turns joints are, they say themselves."""
        y, ydot, yddot, ydddot = curves
        gradient = np.broadcast_to(np.eye(self.r), (len(y), self.r, self.r))
        return JointState(self, y, ydot, yddot, ydddot, y, ydot, yddot, gradient)

    def derivatives(self, state: JointState) -> JointDerivatives:
        """Return zeros: all derivatives but G vanish."""
        zeros = np.zeros_like(state.gradient)
        return JointDerivatives(zeros, zeros, zeros)
