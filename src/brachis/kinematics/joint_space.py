"""Joint motion along a path of all joints, q = q(s): only s(t) is chosen, y = (s).

With q_ds, q_dds and q_ddds the path's derivatives by s,

    G = q_ds,    qdot = q_ds sdot,    qddot = q_ds sddot + q_dds sdot^2
    dqdot/ds = q_dds sdot,    dqddot/dsdot = 2 q_dds sdot,    dqddot/ds = q_dds sddot + q_ddds sdot^2

`DirectJointMap` is the motion without a path: every joint is chosen freely, y = q.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.kinematics.joint_map import JointDerivatives, JointMap, JointState
from brachis.path import Path, PathSample
from brachis.robot import Robot


@dataclass(frozen=True)
class JointSpaceState(JointState):
    """Joint motion at K times, and the path there."""

    path: PathSample

    @property
    def s(self) -> np.ndarray:
        """Path coordinate, (K,)."""
        return self.y[:, 0]


class JointSpaceMap(JointMap):
    """A path of all joints as a `JointMap`.

    Parameters
    ----------
    robot : Robot
    path : Path
        Its target are the joint positions.
    """

    path: Path

    def __init__(self, robot: Robot, path: Path) -> None:
        self.robot = robot
        self.path = path
        self.start = path.sample(np.zeros(1)).target[0]

    def coordinates(self, s: float, _q: np.ndarray) -> np.ndarray:
        """Return s as the only curve."""
        return np.array([s])

    def postures(self, y: np.ndarray) -> np.ndarray:
        """Return the path's target."""
        return self.path.sample(y[:, 0]).target

    def state(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        *,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> JointSpaceState:
        """Return the motion along the path; neither `t` nor `near` matters."""
        path = self.path.sample(y[:, 0])
        qdot = path.xi * ydot
        qddot = path.xi * yddot + path.xi_ds * ydot**2
        gradient = path.xi[:, :, None]
        curves = (y, ydot, yddot, ydddot)
        return JointSpaceState(self, *curves, path.target, qdot, qddot, gradient, path)

    def derivatives(self, state: JointSpaceState) -> JointDerivatives:
        """Return the exact derivatives; see the module's formulas."""
        path = state.path
        qdot_y = path.xi_ds * state.ydot
        qddot_y = path.xi_dds * state.ydot**2 + path.xi_ds * state.yddot
        parts = (qdot_y, qddot_y, 2.0 * qdot_y)
        return JointDerivatives(*(part[:, :, None] for part in parts))


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

    def state(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        *,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> JointState:
        """Return the curves as the motion; neither `t` nor `near` matters."""
        gradient = np.broadcast_to(np.eye(self.r), (len(y), self.r, self.r))
        return JointState(self, y, ydot, yddot, ydddot, y, ydot, yddot, gradient)

    def derivatives(self, state: JointState) -> JointDerivatives:
        """Return zeros: all derivatives but G vanish."""
        zeros = np.zeros_like(state.gradient)
        return JointDerivatives(zeros, zeros, zeros)
