"""Joint torques of a batch of states and their exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

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
    return robot.chain.torques(q, qdot, qddot)


def mass_matrices(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Mass matrices with armature, (K, n, n), of K postures (K, n)."""
    return robot.chain.mass_matrices(q)


def torque_derivatives(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> TorqueDerivatives:
    """Exact derivatives of `torque`; parameters as there."""
    return TorqueDerivatives(*robot.chain.torque_derivatives(q, qdot, qddot))
