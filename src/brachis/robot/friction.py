"""Joint torques that the rigid-body model does not know: rotor inertia and friction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
import pinocchio as pin

from brachis.common.arrays import freeze
from brachis.common.summary import Summary
from brachis.errors import InputError
from brachis.robot.limits import LARGEST, per_joint_values
from brachis.task import FROM_URDF

_LEAST_SPEED = 1e-9


@dataclass(frozen=True, repr=False)
class Friction(Summary):
    """Armature, viscous and Coulomb terms of every joint. The arrays are read-only.

    The joint torque is ``rnea(q, qdot, qddot) + armature * qddot + viscous * qdot + coulomb * tanh(qdot / v_eps)``.
    Pinocchio's ``rnea`` would add ``model.armature``; brachis keeps that at zero and adds the term here. Pinocchio
    reads ``damping`` and ``friction`` of a URDF but its ``rnea`` does not use them; here they are the viscous and the
    Coulomb term, unless the task says otherwise.

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
        stated: Mapping[str, np.ndarray] | None = None,
        *,
        armature: object = 0.0,
        rotor_inertia: object = 0.0,
        gear_ratio: object = None,
        viscous: object = FROM_URDF,
        coulomb: object = FROM_URDF,
        coulomb_velocity: object = 0.01,
    ) -> Friction:
        """Spread scalars, lists or mappings over the joints of a chain.

        Parameters
        ----------
        joint_names : sequence of str
        stated : mapping of str to (n,) ndarray, optional
            What the URDF states as ``viscous`` and ``coulomb``; zero where left out.
        armature, rotor_inertia, gear_ratio, viscous, coulomb, coulomb_velocity : optional
            As in `FrictionSettings`.

        Raises
        ------
        InputError, UnknownNameError
        """
        names = list(joint_names)
        urdf = {kind: np.zeros(len(names)) for kind in ("viscous", "coulomb")} | dict(
            stated or {}
        )
        given = {"armature": armature, "rotor_inertia": rotor_inertia}
        terms = {
            key: _spread(key, value, names, np.zeros(len(names)))
            for key, value in given.items()
        }
        rubbing = {"viscous": viscous, "coulomb": coulomb}
        terms |= {
            key: _spread(key, value, names, urdf[key]) for key, value in rubbing.items()
        }
        geared = _geared(
            terms.pop("rotor_inertia"), gear_ratio, terms["armature"], names
        )
        where = "robot.friction.coulomb_velocity"
        v_eps = np.array(
            per_joint_values(where, coulomb_velocity, names, 0.01), dtype=float
        )
        if not np.all((v_eps >= _LEAST_SPEED) & (v_eps <= LARGEST)):
            allowed = f"{_LEAST_SPEED:g} to {LARGEST:g} rad/s or m/s"
            raise InputError(
                "is not a usable speed",
                where=where,
                found=coulomb_velocity,
                allowed=allowed,
            )
        return cls(**(terms | {"armature": terms["armature"] + geared}), v_eps=v_eps)

    def check_against(self, model: pin.Model, limits: np.ndarray) -> None:
        """Refuse Coulomb friction of a chain that its torque limits, (n,), cannot overcome: a joint could only creep.

        Raises
        ------
        InputError
        """
        names = list(model.names)[1:]
        for name, coulomb, limit in zip(names, self.coulomb, limits, strict=True):
            if coulomb >= limit:
                carrier = model.frames[
                    model.frames[
                        model.getFrameId(name, pin.FrameType.JOINT)
                    ].parentFrame
                ].name
                first = name == names[0]
                shorter = (
                    ""
                    if first
                    else f". To leave the joint out, end the chain at {carrier} by robot.tool_frame or --tool-frame"
                )
                raise InputError(
                    f"Coulomb friction holds joint {name!r} against its largest torque",
                    where="robot.friction.coulomb",
                    found=f"{coulomb:g} Nm (N for a prismatic joint)",
                    allowed=f"less than the limit, {limit:g}",
                    hint=f"Lower the friction, or raise robot.limits.torque.{name}{shorter}",
                )

    def torque(self, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
        """Torque of these terms, (..., n), for velocities and accelerations (..., n)."""
        return (
            self.armature * qddot
            + self.viscous * qdot
            + self.coulomb * np.tanh(qdot / self.v_eps)
        )

    def velocity_derivative(self, qdot: np.ndarray) -> np.ndarray:
        """Differentiate `torque` with respect to qdot (diagonal), (..., n)."""
        return (
            self.viscous
            + self.coulomb
            / self.v_eps
            / np.cosh(np.clip(qdot / self.v_eps, -350.0, 350.0)) ** 2
        )


def _spread(key: str, value: object, names: list[str], urdf: np.ndarray) -> np.ndarray:
    """Spread one term over the joints, (n,); `urdf` where it is not given, nothing where it is None."""
    where = f"robot.friction.{key}"
    listed = per_joint_values(where, value, names, FROM_URDF)
    chosen = [
        stated if entry == FROM_URDF else entry
        for entry, stated in zip(listed, urdf, strict=True)
    ]
    terms = np.array([0.0 if entry is None else entry for entry in chosen], dtype=float)
    for name, term, entry in zip(names, terms, listed, strict=True):
        if not 0.0 <= term <= LARGEST:
            raise InputError(
                "is negative, too large or not a number",
                where=f"{where}.{name}",
                found=f"{term:g}" + (" in the URDF" if entry == FROM_URDF else ""),
                allowed=f"numbers from 0 to {LARGEST:g}",
            )
    return terms


def _geared(
    rotor: np.ndarray, gear_ratio: object, armature: np.ndarray, names: list[str]
) -> np.ndarray:
    """Inertias of rotors, (n,), as the joints feel them through their gears."""
    key = "robot.friction.gear_ratio"
    ratios = [
        0.0 if ratio is None else ratio
        for ratio in per_joint_values(key, gear_ratio, names, None)
    ]
    ratio = np.array(ratios, dtype=float)
    for name, inertia, turns, other in zip(names, rotor, ratio, armature, strict=True):
        if inertia > 0.0 and not 0.0 < turns <= LARGEST:
            raise InputError(
                f"the rotor of joint {name!r} has no gear ratio",
                where=f"{key}.{name}",
                found=f"{turns:g}" if turns else None,
                allowed=f"turns of the rotor per turn of the joint, > 0, at most {LARGEST:g}; 1 for a direct drive",
            )
        if inertia > 0.0 and other > 0.0:
            raise InputError(
                f"armature and rotor_inertia of joint {name!r} say the same",
                where=f"robot.friction.rotor_inertia.{name}",
                found=f"armature {other:g}, rotor inertia {inertia:g} at a gear ratio of {turns:g}",
                allowed="one of them",
            )
    return np.asarray(rotor * ratio**2)
