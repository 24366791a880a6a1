"""Joint torques of a batch of states and their exact derivatives, through Pinocchio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from brachis.robot.robot import Robot

_T = TypeVar("_T")


@dataclass(frozen=True)
class TorqueDerivatives:
    """Derivatives of the torque of K states, each (K, n, n): row joint torque, column joint.

    Attributes
    ----------
    q, qdot, qddot : (K, n, n) ndarray
        With respect to position, velocity, acceleration (the last is the mass matrix plus armature).
    """

    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray


class SharedTorques:
    """A joint motion whose torques, and their derivatives, are computed once for all who ask.

    Attributes
    ----------
    q, qdot, qddot : (K, n) ndarray
    """

    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray

    @cached_property
    def _known(self) -> dict[tuple[Callable[..., Any], int], tuple[Robot, Any]]:
        return {}

    def torque(self, robot: Robot) -> np.ndarray:
        """Joint torques, (K, n); not to be written to."""
        return self._once(torque, robot)

    def torque_derivatives(self, robot: Robot) -> TorqueDerivatives:
        """Return the derivatives of the joint torques; not to be written to."""
        return self._once(torque_derivatives, robot)

    def _once(self, function: Callable[..., _T], robot: Robot) -> _T:
        key = function, id(robot)
        known = self._known.get(key)
        # The robot is compared too: in another process an id may be that of another object.
        if known is None or known[0] is not robot:
            known = robot, function(robot, self.q, self.qdot, self.qddot)
            self._known[key] = known
        return known[1]


def torque(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> np.ndarray:
    """Joint torques of K states.

    Parameters
    ----------
    robot : Robot
    q, qdot, qddot : (K, n) ndarray
        Positions, velocities, accelerations.

    Returns
    -------
    (K, n) ndarray
        ``rnea + armature * qddot + viscous * qdot + coulomb * tanh(qdot / v_eps)``, Nm or N.
    """
    return rigid_torque(robot, q, qdot, qddot) + robot.friction.torque(qdot, qddot)


def rigid_torque(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> np.ndarray:
    """Joint torques of K states without friction and armature; parameters as for `torque`."""
    model = robot.model
    data = model.createData()
    rigid = np.empty_like(q)
    for k in range(len(q)):
        rigid[k] = pin.rnea(model, data, q[k], qdot[k], qddot[k])
    return rigid


def mass_matrices(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Mass matrices with armature, (K, n, n), of K postures (K, n)."""
    model = robot.model
    data = model.createData()
    matrices = np.empty((len(q), robot.n, robot.n))
    for k in range(len(q)):
        matrices[k] = pin.crba(model, data, q[k])
    return _with_armature(robot, matrices)


def torque_derivatives(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> TorqueDerivatives:
    """Exact derivatives of `torque`; parameters as there."""
    model = robot.model
    data = model.createData()
    by_q, by_qdot, by_qddot = np.empty((3, len(q), robot.n, robot.n))
    for k in range(len(q)):
        by_q[k], by_qdot[k], by_qddot[k] = pin.computeRNEADerivatives(
            model, data, q[k], qdot[k], qddot[k]
        )
    diagonal = np.arange(robot.n)
    by_qdot[:, diagonal, diagonal] += robot.friction.velocity_derivative(qdot)
    return TorqueDerivatives(by_q, by_qdot, _with_armature(robot, by_qddot))


def _with_armature(robot: Robot, matrices: np.ndarray) -> np.ndarray:
    """Complete mass matrices, (K, n, n), of which Pinocchio may fill the upper triangle alone, and add the armature."""
    complete = np.triu(matrices) + np.swapaxes(np.triu(matrices, 1), 1, 2)
    diagonal = np.arange(robot.n)
    complete[:, diagonal, diagonal] += robot.friction.armature
    return complete
