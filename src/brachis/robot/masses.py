"""What needs dynamics, and so the masses of the robot: the one place that decides it.

Torques need the mass of what every joint moves. So do the limits on torques, on their rates and means and on powers, a
payload, and friction that the task states. All else is kinematics.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from brachis.errors import UrdfError
from brachis.robot.friction import Friction
from brachis.robot.limits import Limits
from brachis.robot.urdf_bodies import UrdfDynamics
from brachis.task import FROM_URDF, LIMIT_KINDS, RobotSettings
from brachis.task.limit_models import per_joint_values

_MANY = 12
"""Joints that a message names, no more."""


def check_masses(
    dynamics: UrdfDynamics, source: str, users: Collection[str] | None = None
) -> None:
    """Refuse what needs dynamics if the body that a joint moves has no mass.

    Parameters
    ----------
    dynamics : UrdfDynamics
    source : str
        Name of the URDF, for messages.
    users : collection of str, optional
        Keys of the task that need the masses, if any; torques are asked for if it is left out.

    Raises
    ------
    UrdfError
    """
    is_asked = users is None or len(users) > 0
    if not is_asked or not dynamics.without_mass:
        return
    hint = "Add the masses to the URDF"
    if users is not None:
        hint += "; or leave the keys out, torque as null, and state robot.limits.acceleration"
    places = [
        f"{body.joint} ({', '.join(body.links)})" for body in dynamics.without_mass
    ]
    more = ", ..." if len(places) > _MANY else ""
    raise UrdfError(
        f"torques are unknown without masses, but needed for {', '.join(users)}"
        if users
        else "torques are unknown without masses",
        where=source,
        found=f"0 kg in the links that are moved by {', '.join(places[:_MANY])}{more}",
        allowed="for every joint a link with <inertial> and mass > 0 kg",
        hint=hint,
    )


def list_users(
    dynamics: UrdfDynamics,
    limits: Limits,
    friction: Friction,
    settings: RobotSettings,
) -> Iterator[str]:
    """Name what needs masses, by its key of the task and its joints."""
    names = [body.joint for body in dynamics.bodies]
    has_curve = np.array([bool(curve) for curve in limits.torque_speed])
    if has_curve.any():
        yield _name("robot.limits.torque_speed", names, has_curve)
    for kind, row in LIMIT_KINDS.items():
        if not row.needs_masses:
            continue
        is_limited = np.isfinite(limits.both_ways(kind)).any(axis=0)
        if kind == "torque":
            is_limited &= ~has_curve
        if is_limited.any():
            key = f"robot.limits.{kind}"
            stated = getattr(settings.limits, kind)
            listed = per_joint_values(key, stated, names, FROM_URDF)
            by_urdf = row.urdf and all(
                value == FROM_URDF
                for value, limited in zip(listed, is_limited, strict=False)
                if limited
            )
            origin = f" (the URDF's {row.urdf})" if by_urdf else ""
            yield _name(key, names, is_limited) + origin
    if np.isfinite(limits.total_power):
        yield "robot.limits.total_power"
    if settings.payload is not None:
        yield "robot.payload"
    for kind in ("armature", "viscous", "coulomb"):
        figures = getattr(friction, kind)[: len(names)]
        is_asked = (figures > 0.0) & (figures != dynamics.friction.get(kind, 0.0))
        if is_asked.any():
            yield _name(f"robot.friction.{kind}", names, is_asked)


def _name(key: str, names: Sequence[str], chosen: np.ndarray) -> str:
    """Name a key, and the joints for which it is set unless these are all."""
    joints = [name for name, is_one in zip(names, chosen, strict=False) if is_one]
    return key if len(joints) == len(names) else f"{key} of {', '.join(joints)}"
