"""Joint torques that are not part of the rigid-body model: rotor inertia and friction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.common.arrays import freeze
from brachis.common.summary import Summary
from brachis.errors import InputError
from brachis.task import FROM_URDF, FrictionSettings
from brachis.task.fields import LARGEST
from brachis.task.limit_models import per_joint_values


@dataclass(frozen=True, repr=False, eq=False)
class Friction(Summary):
    """Armature, viscous friction and Coulomb friction of every joint. The arrays are read-only.

    The joint torque is ``rnea(q, qdot, qddot) + armature * qddot + viscous * qdot + coulomb * tanh(qdot / v_eps)``.
    Pinocchio's ``rnea`` would add ``model.armature``; brachis keeps this attribute at zero and adds the term here.
    Pinocchio reads ``damping`` and ``friction`` from a URDF, but its ``rnea`` does not use them. Here they are the
    viscous and the Coulomb term, unless the task gives other values.

    Attributes
    ----------
    armature : (n,) ndarray
        Rotor inertia as seen at the joint, kg m^2 or kg.
    viscous : (n,) ndarray
        Nm s/rad or N s/m.
    coulomb : (n,) ndarray
        Nm or N.
    v_eps : (n,) ndarray
        Width of the speed range in which the Coulomb torque changes its sign, rad/s or m/s.
    """

    armature: np.ndarray
    viscous: np.ndarray
    coulomb: np.ndarray
    v_eps: np.ndarray

    def __post_init__(self) -> None:
        """Make the arrays read-only copies."""
        freeze(self, *vars(self))

    @classmethod
    def of(
        cls,
        joint_names: Sequence[str],
        urdf: Mapping[str, np.ndarray],
        settings: FrictionSettings,
    ) -> Friction:
        """Combine the friction in a task with that in the URDF, for the joints of a chain.

        Parameters
        ----------
        joint_names : sequence of str
        urdf : mapping of str to (n,) ndarray
            Values of the URDF for ``viscous``, ``coulomb`` and ``armature``. A rotor inertia in the settings replaces
            the armature.
        settings : FrictionSettings

        Raises
        ------
        InputError, UnknownNameError
        """
        names = list(joint_names)
        terms = {}
        for key, field in FrictionSettings.model_fields.items():
            where = f"robot.friction.{key}"
            stated = per_joint_values(
                where, getattr(settings, key), names, field.default
            )
            terms[key] = np.array(
                [
                    urdf[key][i] if entry == FROM_URDF else entry or 0.0
                    for i, entry in enumerate(stated)
                ],
                dtype=float,
            )
            for name, entry, value in zip(names, stated, terms[key], strict=True):
                if not 0.0 <= value <= LARGEST:
                    origin = " in the URDF" if entry == FROM_URDF else ""
                    raise InputError(
                        "the value is negative, too large or not a number",
                        where=f"{where}.{name}",
                        found=f"{value:g}{origin}",
                        allowed=f"numbers from 0 to {LARGEST:g}",
                    )
        rotors = terms.pop("rotor_inertia")
        if settings.armature == FROM_URDF:
            terms["armature"][rotors > 0.0] = 0.0
        ratios = terms.pop("gear_ratio")
        for i in np.flatnonzero((rotors > 0.0) & (ratios == 0.0)):
            raise InputError(
                f"the rotor of joint {names[i]!r} has no gear ratio",
                where=f"robot.friction.gear_ratio.{names[i]}",
                allowed=f"turns of the rotor per turn of the joint, > 0, at most {LARGEST:g}; 1 for a direct drive",
            )
        for i in np.flatnonzero((rotors > 0.0) & (terms["armature"] > 0.0)):
            raise InputError(
                f"joint {names[i]!r} has both armature and rotor_inertia",
                where=f"robot.friction.rotor_inertia.{names[i]}",
                found=f"armature {terms['armature'][i]:g}, rotor inertia {rotors[i]:g}",
                allowed="either armature, or rotor_inertia with gear_ratio",
            )
        terms["armature"] += rotors * ratios**2
        v_eps = terms.pop("coulomb_velocity")
        least = 1e-9  # rad/s or m/s: steeper steps have slopes that overflow in squares
        if v_eps.min() < least:
            raise InputError(
                "the speed at which Coulomb friction reaches 76 % of its value is too small",
                where="robot.friction.coulomb_velocity",
                found=settings.coulomb_velocity,
                allowed=f"{least:g} to {LARGEST:g} rad/s or m/s",
            )
        return cls(**terms, v_eps=v_eps)

    def check_against(self, model: pin.Model, limits: np.ndarray) -> None:
        """Refuse Coulomb friction that the torque limits, (n,), cannot overcome, because the joint could only creep.

        Raises
        ------
        InputError
        """
        names = list(model.names)[1:]
        for i in np.flatnonzero(self.coulomb >= limits):
            hint = f"Lower the friction, or raise robot.limits.torque.{names[i]}"
            if i > 0:
                joint = model.frames[model.getFrameId(names[i], pin.FrameType.JOINT)]
                carrier = model.frames[joint.parentFrame].name
                hint += f". To leave the joint out, end the chain at {carrier} with robot.tool_frame or --tool-frame"
            raise InputError(
                f"the Coulomb friction of joint {names[i]!r} is not below its torque limit",
                where="robot.friction.coulomb",
                found=f"{self.coulomb[i]:g} Nm (N for a prismatic joint)",
                allowed=f"less than the limit, {limits[i]:g}",
                hint=hint,
            )

    @property
    def table(self) -> np.ndarray:
        """The terms of all joints, (n, 4), in the order of the attributes."""
        return np.column_stack([self.armature, self.viscous, self.coulomb, self.v_eps])
