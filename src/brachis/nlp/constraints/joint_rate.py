"""|qdot| <= v_max and |qddot| <= a_max, as ratios in [-1, 1]."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import Decomposition, JointState
from brachis.nlp.constraints.protocol import Partials


class JointRateConstraint:
    """Joint velocities or accelerations over their limits.

    Parameters
    ----------
    kind : {"velocity", "acceleration"}
    decomposition : Decomposition
    joints : (c,) int ndarray
        The limited joints.
    limits : (c,) ndarray
    """

    timed = True
    physical = True

    def __init__(self, kind: str, decomposition: Decomposition, joints: np.ndarray, limits: np.ndarray) -> None:
        robot = decomposition.robot
        self.kind = kind
        self.labels = tuple(robot.joint_names[i] for i in joints)
        self.lower, self.upper = -np.ones(len(joints)), np.ones(len(joints))
        self.excess_scale = np.ones(len(joints))
        self._joints = joints
        self._scale = 1.0 / limits
        self._selection = np.eye(robot.n)[joints] * self._scale[:, None]

    def values(self, state: JointState) -> np.ndarray:
        """See `Constraint.values`."""
        rate = state.qdot if self.kind == "velocity" else state.qddot
        return rate[:, self._joints] * self._scale

    def partials(self, state: JointState) -> Partials:
        """See `Constraint.partials`."""
        constant = np.broadcast_to(self._selection, (len(state.q), *self._selection.shape))
        return Partials(qdot=constant) if self.kind == "velocity" else Partials(qddot=constant)


def build_velocity(decomposition: Decomposition, _margin: float) -> JointRateConstraint | None:
    """Build the constraint for the joints with a finite velocity limit."""
    return _build("velocity", decomposition, decomposition.robot.limits.velocity)


def build_acceleration(decomposition: Decomposition, _margin: float) -> JointRateConstraint | None:
    """Build the constraint for the joints with a finite acceleration limit."""
    return _build("acceleration", decomposition, decomposition.robot.limits.acceleration)


def _build(kind: str, decomposition: Decomposition, limits: np.ndarray) -> JointRateConstraint | None:
    joints = np.flatnonzero(np.isfinite(limits))
    return JointRateConstraint(kind, decomposition, joints, limits[joints]) if len(joints) else None
