"""A URDF's chain as its text states it, read without Pinocchio: to compare a model with, and to verify motions by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.common.summary import Summary
from brachis.errors import InputError, UrdfError
from brachis.robot.urdf_elements import Element, UrdfTree, end_of, numbers_of

_ROUNDING = 1e-9
_ZEROS = "0 0 0"


@dataclass(frozen=True, eq=False, repr=False)
class Body(Summary):
    """What one joint of a chain moves: its child link and all that is held to it.

    Attributes
    ----------
    joint : str
    placement : (4, 4) ndarray
        Of the joint at zero in the frame of the joint before it, of the first one in the root link.
    axis : (3,) ndarray
        Unit vector of the joint's axis in its own frame.
    sliding : bool
        Whether the joint is prismatic.
    links : tuple of str
    mass : float
        kg.
    com : (3,) ndarray
        Centre of mass in the frame of the joint's child link, m; zeros where the mass is zero.
    inertia : (3, 3) ndarray
        About the centre of mass, axes of the same frame, kg m^2.
    size : float
        Sum of the links' moments about the frame's origin, kg m^2: what differences are measured by.
    """

    joint: str
    placement: np.ndarray
    axis: np.ndarray
    sliding: bool
    links: tuple[str, ...]
    mass: float
    com: np.ndarray
    inertia: np.ndarray
    size: float


@dataclass(frozen=True, eq=False, repr=False)
class UrdfDynamics(Summary):
    """What a URDF says of a chain.

    Attributes
    ----------
    bodies : tuple of Body
        What each joint moves, in the order of the chain.
    tool : (4, 4) ndarray
        Placement of the tool frame in the frame of the last joint.
    friction : dict of str to (n,) ndarray
        ``viscous``: damping, Nm s/rad or N s/m; ``coulomb``: friction, Nm or N. Zero where nothing is said.
    """

    bodies: tuple[Body, ...]
    tool: np.ndarray
    friction: dict[str, np.ndarray]


def read_dynamics(
    tree: UrdfTree, chain: Sequence[str], locked: Mapping[str, float], tool: str
) -> UrdfDynamics:
    """Read a chain of a checked URDF, and sum up the inertias of what each joint moves.

    Parameters
    ----------
    tree : UrdfTree
        Its numbers have been checked.
    chain : sequence of str
        Moving joints.
    locked : mapping of str to float
        Where the others are held, rad or m.
    tool : str
        Link at the chain's end.
    """
    placed: dict[str, tuple[str | None, np.ndarray]] = {tree.root: (None, np.eye(4))}
    for link in tree.links:
        for each in _unplaced(tree, link, placed):
            placed[each] = _placement(tree, each, placed, chain, locked)
    carried: dict[str, list[str]] = {name: [] for name in chain}
    for link in tree.links:
        carrier, _ = placed[link]
        if carrier is not None:
            carried[carrier].append(link)
    bodies = []
    for name in chain:
        joint, links = (
            tree.joints[name],
            [(link, tree.links[link], placed[link][1]) for link in carried[name]],
        )
        before = placed[str(end_of(joint, "parent"))][1] @ _origin(joint, "origin")
        bodies.append(_body(name, before, joint, links))
    friction = {
        kind: np.array(
            [numbers_of(tree.joints[name], "dynamics", word, "0")[0] for name in chain]
        )
        for kind, word in (("viscous", "damping"), ("coulomb", "friction"))
    }
    return UrdfDynamics(tuple(bodies), placed[tool][1], friction)


def _unplaced(tree: UrdfTree, link: str, placed: Mapping[str, object]) -> list[str]:
    """List a link and the links above it that are not placed yet, the highest first."""
    way = []
    while link not in placed:
        way.append(link)
        link = str(end_of(tree.joints[tree.above[link]], "parent"))
    return way[::-1]


def _placement(
    tree: UrdfTree,
    link: str,
    placed: Mapping[str, tuple[str | None, np.ndarray]],
    chain: Sequence[str],
    locked: Mapping[str, float],
) -> tuple[str | None, np.ndarray]:
    """Give the joint of the chain that carries a link, and the link's (4, 4) placement in that joint's child link."""
    name = tree.above[link]
    if name in chain:
        return name, np.eye(4)
    joint = tree.joints[name]
    carrier, parent = placed[str(end_of(joint, "parent"))]
    return carrier, parent @ _origin(joint, "origin") @ _held(
        joint, locked.get(name, 0.0)
    )


def check_bodies(model: pin.Model, bodies: Sequence[Body], where: str) -> None:
    """Refuse a model that does not weigh what its URDF says.

    Parameters
    ----------
    model : pinocchio.Model
        Of a chain.
    bodies : sequence of Body
        In the order of the chain.
    where : str
        Name of the file, for messages.

    Raises
    ------
    UrdfError
    """
    for body, inertia in zip(bodies, list(model.inertias)[1:], strict=True):
        length = np.sqrt(body.size / body.mass) if body.mass > 0.0 else 0.0
        figures = (
            ("mass", "kg", inertia.mass, body.mass, body.mass),
            ("centre of mass", "m", inertia.lever, body.com, length),
            ("inertia", "kg m^2", inertia.inertia, body.inertia, body.size),
        )
        for kind, unit, found, stated, size in figures:
            if not np.abs(found - stated).max() <= _ROUNDING * max(size, _ROUNDING):
                raise UrdfError(
                    f"the body moved by joint {body.joint!r} has another {kind} in the model than in the file",
                    where=where,
                    found=f"{np.round(found, 9).tolist()} {unit}",
                    allowed=f"{np.round(stated, 9).tolist()} {unit}, of links {', '.join(body.links)}",
                    hint="Report this: the URDF was misread",
                )


def _body(
    name: str,
    placement: np.ndarray,
    joint: Element,
    links: Sequence[tuple[str, Element, np.ndarray]],
) -> Body:
    """Sum up links with their placements in the joint's frame."""
    mass, moment, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for _, element, placed in links:
        inertial = element.find("inertial")
        if inertial is None:
            continue
        frame = placed @ _origin(inertial, "origin")
        rotation, lever = frame[:3, :3], frame[:3, 3]
        (weight,) = numbers_of(inertial, "mass", "value", "0")
        mass += weight
        moment += weight * lever
        second += rotation @ inertia_matrix(inertial) @ rotation.T + weight * _spread(
            lever
        )
    com = moment / mass if mass > 0.0 else np.zeros(3)
    return Body(
        joint=name,
        placement=placement,
        axis=_axis(joint),
        sliding=joint.get("type") == "prismatic",
        links=tuple(link for link, _, _ in links),
        mass=mass,
        com=com,
        inertia=second - mass * _spread(com),
        size=float(np.trace(np.abs(second))),
    )


def _axis(joint: Element) -> np.ndarray:
    """Return the unit vector of a joint's axis, (3,)."""
    axis = np.array(numbers_of(joint, "axis", "xyz", "1 0 0"))
    return np.asarray(axis / np.linalg.norm(axis))


def inertia_matrix(inertial: Element) -> np.ndarray:
    """Matrix of moments and products, (3, 3) kg m^2, of a checked <inertial>."""
    return symmetric_matrix(
        {key: numbers_of(inertial, "inertia", key, "0")[0] for key in _MOMENTS.ravel()}
    )


_MOMENTS = np.array(
    [["ixx", "ixy", "ixz"], ["ixy", "iyy", "iyz"], ["ixz", "iyz", "izz"]]
)


def symmetric_matrix(moments: Mapping[str, float]) -> np.ndarray:
    """Return the (3, 3) matrix of moments and products ``ixx``, ``ixy``, ..., kg m^2."""
    return np.array([[moments[key] for key in row] for row in _MOMENTS])


def check_inertia(
    matrix: np.ndarray, problem: str, where: str, error: type[InputError]
) -> None:
    """Refuse an inertia matrix, (3, 3) kg m^2, that no rigid body has."""
    moments = np.linalg.eigvalsh(matrix)
    slack = 1e-3 * max(abs(moments).max(), 1e-12)  # figures from CAD are rounded
    if moments[0] < -slack or moments[0] + moments[1] < moments[2] - slack:
        found = ", ".join(f"{moment:.4g}" for moment in moments)
        raise error(
            problem,
            where=where,
            found=f"principal moments {found} kg m^2",
            allowed="moments >= 0, none above the sum of the other two, about the centre of mass",
        )


def _spread(lever: np.ndarray) -> np.ndarray:
    """Second moment of a point of 1 kg at `lever`, (3,) m, about the origin, kg m^2."""
    return np.asarray(np.dot(lever, lever) * np.eye(3) - np.outer(lever, lever))


def _origin(owner: Element, path: str) -> np.ndarray:
    """Placement, (4, 4), that an origin describes: roll, pitch and yaw about fixed axes."""
    placed = np.eye(4)
    roll, pitch, yaw = numbers_of(owner, path, "rpy", _ZEROS)
    placed[:3, :3] = _turn(np.array([0.0, 0.0, 1.0]), yaw)
    placed[:3, :3] = (
        placed[:3, :3]
        @ _turn(np.array([0.0, 1.0, 0.0]), pitch)
        @ _turn(np.array([1.0, 0.0, 0.0]), roll)
    )
    placed[:3, 3] = numbers_of(owner, path, "xyz", _ZEROS)
    return placed


def _held(joint: Element, position: float) -> np.ndarray:
    """Displacement, (4, 4), of a joint that is held at a position, rad or m."""
    placed = np.eye(4)
    if position == 0.0:
        return placed
    axis = _axis(joint)
    if joint.get("type") == "prismatic":
        placed[:3, 3] = position * axis
    elif joint.get("type") in ("revolute", "continuous"):
        placed[:3, :3] = _turn(axis, position)
    return placed


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation matrix, (3, 3), about a unit vector (Rodrigues)."""
    cross = np.array(
        [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]
    )
    return np.asarray(
        np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    )
