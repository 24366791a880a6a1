"""Joint torques of a batch of states, and their exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from brachis.kernel import Chain, TorqueDerivatives
from brachis.robot.robot import Robot


class SharedTorques:
    """A joint motion whose torques and their derivatives are computed only once.

    Do not write to the arrays that the methods return.

    Attributes
    ----------
    q, qdot, qddot : (K, n) ndarray
    """

    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray

    @cached_property
    def _known(self) -> dict[Callable[..., Any], Any]:
        return {}

    def _compute_once(self, function: Callable[..., Any]) -> Any:
        """Return a function's value for the positions, velocities and accelerations of this motion."""
        if function not in self._known:
            self._known[function] = function(self.q, self.qdot, self.qddot)
        return self._known[function]

    def torque(self, robot: Robot) -> np.ndarray:
        """Return the joint torques, (K, n)."""
        return self.torque_of(_chain_with_masses(robot))

    def torque_of(self, chain: Chain) -> np.ndarray:
        """Return the joint torques of a chain, (K, n)."""
        return np.asarray(self._compute_once(chain.torques))

    def torque_derivatives(self, robot: Robot) -> TorqueDerivatives:
        """Return the derivatives of the joint torques."""
        chain = _chain_with_masses(robot)
        derivatives: TorqueDerivatives = self._compute_once(chain.torque_derivatives)
        return derivatives


def _chain_with_masses(robot: Robot) -> Chain:
    """Return the chain of a robot; refuse a robot without masses."""
    robot.check_masses("torques")
    return robot.dynamic_chain


def torque(
    robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
) -> np.ndarray:
    """Compute the joint torques of K states.

    Parameters
    ----------
    robot : Robot
    q, qdot, qddot : (K, n) ndarray
        Positions, velocities, accelerations.

    Returns
    -------
    (K, n) ndarray
        ``rnea + armature * qddot + viscous * qdot + coulomb * tanh(qdot / v_eps)``, Nm or N.

    Raises
    ------
    UrdfError
        Masses are missing in the URDF.
    """
    return _chain_with_masses(robot).torques(q, qdot, qddot)
