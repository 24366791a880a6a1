"""Joint torques that the rigid-body model does not know: rotor inertia and friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from brachis.arrays import freeze
from brachis.errors import InputError
from brachis.robot.limits import per_joint_values


@dataclass(frozen=True)
class Friction:
    """Armature, viscous and Coulomb terms of every joint. The arrays are read-only.

    The joint torque is ``rnea(q, qdot, qddot) + armature * qddot + viscous * qdot + coulomb * tanh(qdot / v_eps)``.
    Pinocchio's ``rnea`` would add ``model.armature``; brachis keeps that at zero and adds the term here. Pinocchio
    reads ``damping`` and ``friction`` of a URDF but its ``rnea`` does not use them, and neither does brachis.

    Attributes
    ----------
    armature : (n,) ndarray
        Rotor inertia seen at the joint, kg m^2 or kg.
    viscous : (n,) ndarray
        Nm s/rad or N s/m.
    coulomb : (n,) ndarray
        Nm or N.
    v_eps : (n,) ndarray
        Speed over which the Coulomb torque changes sign, rad/s or m/s.
    """

    armature: np.ndarray
    viscous: np.ndarray
    coulomb: np.ndarray
    v_eps: np.ndarray

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, *(each.name for each in fields(self)))

    @classmethod
    def of(
        cls,
        joint_names: Sequence[str],
        *,
        armature: object = 0.0,
        viscous: object = 0.0,
        coulomb: object = 0.0,
        coulomb_velocity: object = 0.01,
    ) -> Friction:
        """Spread scalars, lists or mappings over the joints of a chain."""
        given = {"armature": armature, "viscous": viscous, "coulomb": coulomb}
        spread = {}
        for key, value in given.items():
            where = f"robot.friction.{key}"
            spread[key] = np.array(per_joint_values(where, value, list(joint_names), 0.0), dtype=float)
            if not np.all(spread[key] >= 0.0):
                raise InputError("is negative or not a number", where=where, found=value, allowed="numbers >= 0")
        where = "robot.friction.coulomb_velocity"
        v_eps = np.array(per_joint_values(where, coulomb_velocity, list(joint_names), 0.01), dtype=float)
        if not np.all(v_eps > 0.0):
            raise InputError("is not positive", where=where, found=coulomb_velocity, allowed="> 0 rad/s or m/s")
        return cls(**spread, v_eps=v_eps)

    def check_against(self, joint_names: Sequence[str], limits: np.ndarray) -> None:
        """Refuse Coulomb friction that the torque limits, (n,), cannot overcome: the joint could only creep.

        Raises
        ------
        InputError
        """
        for name, coulomb, limit in zip(joint_names, self.coulomb, limits, strict=True):
            if coulomb >= limit:
                raise InputError(
                    f"Coulomb friction holds joint {name!r} against its largest torque",
                    where="robot.friction.coulomb",
                    found=f"{coulomb:g} Nm (N for a prismatic joint)",
                    allowed=f"less than the limit, {limit:g}",
                    hint=f"Lower the friction, or raise robot.limits.torque.{name}",
                )

    def torque(self, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
        """Torque of these terms, (..., n), for velocities and accelerations (..., n)."""
        return self.armature * qddot + self.viscous * qdot + self.coulomb * np.tanh(qdot / self.v_eps)

    def velocity_derivative(self, qdot: np.ndarray) -> np.ndarray:
        """Differentiate `torque` with respect to qdot (diagonal), (..., n)."""
        return self.viscous + self.coulomb / self.v_eps / np.cosh(np.clip(qdot / self.v_eps, -350.0, 350.0)) ** 2
