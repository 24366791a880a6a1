"""Joint motion along a path of all joints, q = q(s): only s(t) is chosen, y = (s).

With q_ds, q_dds and q_ddds the path's derivatives by s,

    G = q_ds,    qdot = q_ds sdot,    qddot = q_ds sddot + q_dds sdot^2
    dqdot/ds = q_dds sdot,    dqddot/dsdot = 2 q_dds sdot,    dqddot/ds = q_dds sddot + q_ddds sdot^2

Joint motion without a path: every joint is chosen freely, y = q.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.kinematics.joint_map import JointDerivatives, JointState
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


class JointSpaceMap:
    """A path of all joints as a `JointMap`.

    Parameters
    ----------
    robot : Robot
    path : Path
        Its target are the joint positions.
    """

    redundant_joints: tuple[str, ...] = ()
    branch_label = ""
    r = 0

    def __init__(self, robot: Robot, path: Path) -> None:
        self.robot, self.path = robot, path
        self.start = path.sample(np.zeros(1)).target[0]

    def coordinates(self, s: float, _q: np.ndarray) -> np.ndarray:
        """See `JointMap`."""
        return np.array([s])

    def postures(self, y: np.ndarray) -> np.ndarray:
        """See `JointMap`."""
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
        """See `JointMap`."""
        path = self.path.sample(y[:, 0])
        qdot, qddot = path.xi * ydot, path.xi * yddot + path.xi_ds * ydot**2
        return JointSpaceState(
            self,
            y,
            ydot,
            yddot,
            ydddot,
            path.target,
            qdot,
            qddot,
            path.xi[:, :, None],
            path,
        )

    def derivatives(self, state: JointSpaceState) -> JointDerivatives:
        """See `JointMap`."""
        path, sdot = state.path, state.ydot
        qddot_y = path.xi_dds * sdot**2 + path.xi_ds * state.yddot
        parts = (path.xi_ds * sdot, qddot_y, 2.0 * path.xi_ds * sdot)
        return JointDerivatives(*(part[:, :, None] for part in parts))

    def start_margins(self) -> np.ndarray:
        """See `JointMap`."""
        return np.empty(0)

    def margins(self, state: JointSpaceState) -> np.ndarray:
        """See `JointMap`."""
        return np.empty((len(state.q), 0))

    def margin_gradient(self, state: JointSpaceState) -> tuple[np.ndarray, None]:
        """See `JointMap`."""
        return np.empty((len(state.q), 0, self.robot.n)), None


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
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
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
