"""Joint torques of a batch of states and their exact derivatives, through Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from brachis.robot.robot import Robot


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
    def _torques(self) -> dict[int, tuple[Robot, np.ndarray]]:
        return {}

    @cached_property
    def _derivatives_of_torques(self) -> dict[int, tuple[Robot, TorqueDerivatives]]:
        return {}

    def torque(self, robot: Robot) -> np.ndarray:
        """See `torque`; not to be written to."""
        known = self._torques.get(id(robot))
        if (
            known is None or known[0] is not robot
        ):  # a number says nothing in another process
            known = self._torques[id(robot)] = (
                robot,
                torque(robot, self.q, self.qdot, self.qddot),
            )
        return known[1]

    def torque_derivatives(self, robot: Robot) -> TorqueDerivatives:
        """See `torque_derivatives`; not to be written to."""
        known = self._derivatives_of_torques.get(id(robot))
        if known is None or known[0] is not robot:
            slopes = torque_derivatives(robot, self.q, self.qdot, self.qddot)
            known = self._derivatives_of_torques[id(robot)] = robot, slopes
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
    model, data, rnea = robot.model, robot.model.createData(), pin.rnea
    rigid = np.empty_like(q)
    for k in range(len(q)):
        rigid[k] = rnea(model, data, q[k], qdot[k], qddot[k])
    return rigid


def mass_matrices(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Mass matrices with armature, (K, n, n), of K postures (K, n)."""
    model, data, crba = robot.model, robot.model.createData(), pin.crba
    matrices = np.empty((len(q), robot.n, robot.n))
    for k in range(len(q)):
        matrices[k] = crba(model, data, q[k])
    upper = np.triu(matrices)
    matrices = upper + np.swapaxes(np.triu(matrices, 1), 1, 2)
    diagonal = np.arange(robot.n)
    matrices[:, diagonal, diagonal] += robot.friction.armature
    return matrices


def torque_derivatives(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> TorqueDerivatives:
    """Exact derivatives of `torque`; parameters as there."""
    model, data, derivatives = (
        robot.model,
        robot.model.createData(),
        pin.computeRNEADerivatives,
    )
    by_q, by_qdot, by_qddot = (np.empty((len(q), robot.n, robot.n)) for _ in range(3))
    for k in range(len(q)):
        by_q[k], by_qdot[k], by_qddot[k] = derivatives(
            model, data, q[k], qdot[k], qddot[k]
        )
    # Some versions of Pinocchio fill the upper triangle of the mass matrix only.
    upper = np.triu(by_qddot)
    by_qddot = upper + np.swapaxes(np.triu(by_qddot, 1), 1, 2)
    diagonal = np.arange(robot.n)
    by_qddot[:, diagonal, diagonal] += robot.friction.armature
    by_qdot[:, diagonal, diagonal] += robot.friction.velocity_derivative(qdot)
    return TorqueDerivatives(by_q, by_qdot, by_qddot)
