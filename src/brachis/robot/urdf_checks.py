"""What brachis refuses in a URDF: joints that no serial chain has, and bodies that cannot be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.errors import UrdfError

if TYPE_CHECKING:
    import yourdfpy

MOVING_TYPES = ("revolute", "continuous", "prismatic")
_LEAST_AXIS = 1e-9


def check_joints(chain: Sequence[Any], names: set[str], by_name: Mapping[str, Any], where: str) -> None:
    """Refuse joints that a serial chain of one-coordinate joints cannot have."""
    for joint in chain:
        if joint.type not in MOVING_TYPES:
            raise UrdfError(
                f"joint {joint.name!r} cannot be planned for",
                where=where,
                found=f"type {joint.type!r}",
                allowed=", ".join(MOVING_TYPES),
                hint="Lock it with robot.locked_joints, or set robot.base_frame below it",
            )
        if joint.axis is not None and not np.linalg.norm(joint.axis) > _LEAST_AXIS:
            raise UrdfError(
                f"joint {joint.name!r} has no axis",
                where=where,
                found=f"<axis xyz={' '.join(f'{component:g}' for component in joint.axis)!r}>",
                allowed="a direction, any length but zero",
            )
    for joint in by_name.values():
        if joint.mimic is not None and (joint.name in names or joint.mimic.joint in names):
            raise UrdfError(
                f"joint {joint.name!r} mimics {joint.mimic.joint!r}",
                where=where,
                found="a mimic joint that moves with the chain",
                allowed="independent joints",
                hint="Remove the mimic element, or lock the joint that it follows with robot.locked_joints",
            )


def check_inertias(urdf: yourdfpy.URDF, chain: Sequence[Any], parents: Mapping[str, Any], where: str) -> None:
    """Refuse moving bodies without mass and inertias that no body can have.

    A body is the links that move as one, that is, up to the next moving joint of the chain. Massless links (frames)
    are fine so long as the body as a whole has mass.
    """
    moving = {joint.name for joint in chain}
    bodies: dict[str, list[str]] = {name: [] for name in moving}
    masses: dict[str, float] = dict.fromkeys(moving, 0.0)
    for link in urdf.robot.links:
        joint = parents.get(link.name)
        while joint is not None and joint.name not in moving:
            joint = parents.get(joint.parent)
        if joint is None:
            continue
        bodies[joint.name].append(link.name)
        if link.inertial is not None:
            masses[joint.name] += link.inertial.mass or 0.0
            _check_inertia(link, where)
    for joint in chain:
        if not masses[joint.name] > 0.0:
            raise UrdfError(
                f"the body moved by joint {joint.name!r} has no mass",
                where=where,
                found=f"links {', '.join(bodies[joint.name])} without <inertial>",
                allowed="at least one link with <inertial> and mass > 0 kg",
            )


def _check_inertia(link: Any, where: str) -> None:  # noqa: ANN401
    """Refuse a negative mass and an inertia matrix that breaks the triangle inequality."""
    mass, matrix = link.inertial.mass or 0.0, link.inertial.inertia
    if not np.isfinite(mass) or mass < 0.0:
        raise UrdfError(
            f"link {link.name!r} has a non-physical mass", where=where, found=f"{mass:g} kg", allowed=">= 0 kg"
        )
    if matrix is None and mass == 0.0:
        return
    if matrix is None:
        raise UrdfError(
            f"link {link.name!r} has a mass but no <inertia>",
            where=where,
            found=f"{mass:g} kg",
            allowed="<inertia> with the moments about the centre of mass",
        )
    moments = np.linalg.eigvalsh(np.asarray(matrix, dtype=float)) if np.all(np.isfinite(matrix)) else np.array([np.nan])
    slack = 1e-3 * max(abs(moments).max(), 1e-12)  # figures from CAD are rounded
    physical = moments[0] >= -slack and (len(moments) < 3 or moments[0] + moments[1] >= moments[2] - slack)  # noqa: PLR2004
    if not physical:
        raise UrdfError(
            f"link {link.name!r} has a non-physical inertia",
            where=where,
            found="principal moments " + ", ".join(f"{m:.4g}" for m in moments) + " kg m^2",
            allowed="moments >= 0, none above the sum of the other two",
        )
