"""The features that need dynamics, and thus the masses of the robot. Only this module decides which they are.

Torques need the mass of the bodies that each joint moves. The same holds for limits on torques, torque rates, mean
torques and powers, for a payload, and for friction that the task states. Everything else needs only kinematics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.errors import UrdfError
from brachis.robot.friction import Friction
from brachis.robot.limits import Limits
from brachis.robot.urdf_bodies import UrdfDynamics
from brachis.task import LIMIT_KINDS, ROBOT_LIMITS, RobotSettings


def list_users(
    dynamics: UrdfDynamics, limits: Limits, friction: Friction, settings: RobotSettings
) -> list[str]:
    """List the keys of the task that need masses. A torque limit may also come from an effort in the URDF."""
    is_user = {
        f"limits.{kind}.{body.joint}": is_limited
        for kind, row in LIMIT_KINDS.items()
        if row.needs_masses
        for body, is_limited in zip(
            dynamics.bodies,
            np.isfinite(limits.both_ways(kind)).any(axis=0),
            strict=False,
        )
    }
    is_user |= {
        f"limits.{kind}": np.isfinite(getattr(limits, kind)) for kind in ROBOT_LIMITS
    }
    is_user |= {
        "limits.torque_speed": any(limits.torque_speed),
        "payload": settings.payload is not None,
    }
    for kind in ("armature", "viscous", "coulomb"):
        figures = getattr(friction, kind)[: len(dynamics.bodies)]
        is_user[f"friction.{kind}"] = np.any(figures > dynamics.friction[kind])
    return [f"robot.{key}" for key, needs_masses in is_user.items() if needs_masses]


def check_masses(dynamics: UrdfDynamics, source: str, users: Sequence[str]) -> None:
    """Refuse features that need masses if a body that a joint moves has no mass.

    Parameters
    ----------
    dynamics : UrdfDynamics
    source : str
        Name of the URDF, for messages.
    users : sequence of str
        Features that need masses; see `list_users`. Nothing is refused if the list is empty.

    Raises
    ------
    UrdfError
    """
    bodies = dynamics.without_mass
    if not (bodies and users):
        return
    places = [f"{body.joint} ({', '.join(body.links)})" for body in bodies]
    raise UrdfError(
        f"the URDF has no masses, which are needed for {', '.join(users)}",
        where=source,
        found=f"0 kg in the links that are moved by {', '.join(places)}",
        allowed="for every joint a link with <inertial> and mass > 0 kg",
        hint="Add the masses to the URDF; or plan without torques: set what needs masses to null (an effort in the "
        "URDF is a limit too), and state robot.limits.acceleration",
    )
