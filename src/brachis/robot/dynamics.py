"""Joint torques of a batch of states and their exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from brachis.kernel import Chain
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
    def _known(self) -> dict[tuple[str, int], tuple[Chain, Any]]:
        return {}

    def torque(self, robot: Robot) -> np.ndarray:
        """Joint torques, (K, n); not to be written to."""
        known = self.known_torque(robot.chain)
        if known is not None:
            return known
        found = torque(robot, self.q, self.qdot, self.qddot)
        self.share_torque(robot.chain, found)
        return found

    def torque_derivatives(self, robot: Robot) -> TorqueDerivatives:
        """Return the derivatives of the joint torques; not to be written to."""
        known: TorqueDerivatives | None = self._find("derivatives", robot.chain)
        if known is not None:
            return known
        found = torque_derivatives(robot, self.q, self.qdot, self.qddot)
        self._known["derivatives", id(robot.chain)] = robot.chain, found
        return found

    def known_torque(self, chain: Chain) -> np.ndarray | None:
        """Return the torques of a chain, (K, n), if they are known."""
        known: np.ndarray | None = self._find("torque", chain)
        return known

    def share_torque(self, chain: Chain, torque: np.ndarray) -> None:
        """Keep the torques of a chain, (K, n), for all who ask."""
        self._known["torque", id(chain)] = chain, torque

    def _find(self, what: str, chain: Chain) -> Any:
        """Return what is known of a chain; in another process an id may be that of another object."""
        owner, found = self._known.get((what, id(chain)), (None, None))
        return found if owner is chain else None


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
    return robot.chain.torques(q, qdot, qddot)


def mass_matrices(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Mass matrices with armature, (K, n, n), of K postures (K, n)."""
    return robot.chain.mass_matrices(q)


def torque_derivatives(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> TorqueDerivatives:
    """Exact derivatives of `torque`; parameters as there."""
    return TorqueDerivatives(*robot.chain.torque_derivatives(q, qdot, qddot))
