"""A URDF's chain as its text states it, read without Pinocchio: to verify motions by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import cross
from brachis.common.summary import Summary
from brachis.errors import InputError
from brachis.robot.urdf_elements import Element, UrdfTree, end_of, number_of, numbers_of
from brachis.task import Placement


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
    """

    joint: str
    placement: np.ndarray
    axis: np.ndarray
    sliding: bool
    links: tuple[str, ...]
    mass: float
    com: np.ndarray
    inertia: np.ndarray


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
        ``viscous``: damping, Nm s/rad or N s/m; ``coulomb``: friction, Nm or N; ``armature``, kg m^2 or kg, which
        only `write_urdf` writes. Zero by default.
    links : dict of str to tuple of int and (4, 4) ndarray
        Of every link the number of the joint that moves it, from 1 on, and its placement in the joint's frame; 0 and
        the placement in the root link where none does.
    """

    bodies: tuple[Body, ...]
    tool: np.ndarray
    friction: dict[str, np.ndarray]
    links: dict[str, tuple[int, np.ndarray]]

    @property
    def without_mass(self) -> tuple[Body, ...]:
        """Bodies of which no link has a mass."""
        return tuple(body for body in self.bodies if not body.mass)


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
    carried = {tree.root: (0, np.eye(4))}  # see UrdfDynamics.links
    befores = {}  # placements of joints of the chain
    for link in tree.downward[1:]:
        name = tree.above[link]
        joint = tree.joints[name]
        number, parent = carried[end_of(joint, "parent")]
        placement = parent @ origin_of(joint, "origin")
        if name in chain:
            befores[name] = placement
            carried[link] = (chain.index(name) + 1, np.eye(4))
        else:
            held = _displacement(joint, locked.get(name, 0.0))
            carried[link] = (number, placement @ held)
    in_order = {link: carried[link] for link in tree.links}
    bodies = []
    for i, name in enumerate(chain, 1):
        links = {link: placed for link, (body, placed) in in_order.items() if body == i}
        bodies.append(_read_body(tree, name, befores[name], links))
    friction = {
        kind: np.array(
            [number_of(tree.joints[name], "dynamics", word, 0.0) for name in chain]
        )
        for kind, word in (
            ("viscous", "damping"),
            ("coulomb", "friction"),
            ("armature", "armature"),
        )
    }
    return UrdfDynamics(tuple(bodies), carried[tool][1], friction, in_order)


def _read_body(
    tree: UrdfTree, name: str, placement: np.ndarray, links: Mapping[str, np.ndarray]
) -> Body:
    """Sum up links with their placements in the joint's frame."""
    joint = tree.joints[name]
    mass = 0.0
    moment = np.zeros(3)
    second = np.zeros((3, 3))
    for link, placed in links.items():
        element = tree.links[link]
        weight = mass_of(element)
        if not weight:
            continue
        frame = placed @ origin_of(element, "inertial/origin")
        rotation = frame[:3, :3]
        lever = frame[:3, 3]
        mass += weight
        moment += weight * lever
        second += rotation @ inertia_matrix(element) @ rotation.T
        second += weight * _spread(lever)
    com = moment / mass if mass > 0.0 else np.zeros(3)
    return Body(
        joint=name,
        placement=placement,
        axis=_axis(joint),
        sliding=joint.get("type") == "prismatic",
        links=tuple(links),
        mass=mass,
        com=com,
        inertia=second - mass * _spread(com),
    )


def placement_matrix(placement: Placement) -> np.ndarray:
    """Return a placement as a (4, 4) matrix."""
    return _place(placement.xyz, np.radians(placement.rpy_deg))


def _axis(joint: Element) -> np.ndarray:
    """Return the unit vector of a joint's axis, (3,)."""
    axis = np.array(numbers_of(joint, "axis", "xyz", "1 0 0"))
    return axis / np.linalg.norm(axis)


def mass_of(link: Element) -> float:
    """Return the mass of a checked link, kg; without one its moments of inertia do not count."""
    return number_of(link, "inertial/mass", "value", 0.0)


def inertia_matrix(link: Element) -> np.ndarray:
    """Matrix of moments and products, (3, 3) kg m^2, of a checked link; zeros where it states none."""
    keys = _MOMENTS.ravel()
    return symmetric_matrix(
        {key: number_of(link, "inertial/inertia", key, 0.0) for key in keys}
    )


_MOMENTS = np.array(
    [["ixx", "ixy", "ixz"], ["ixy", "iyy", "iyz"], ["ixz", "iyz", "izz"]]
)


def symmetric_matrix(moments: Mapping[str, float]) -> np.ndarray:
    """Return the (3, 3) matrix of moments and products ``ixx``, ``ixy``, ..., kg m^2."""
    return np.array([[moments[key] for key in row] for row in _MOMENTS])


def check_inertia(
    matrix: np.ndarray,
    problem: str,
    where: str,
    error: type[InputError],
    hint: str | None = None,
) -> None:
    """Refuse an inertia matrix, (3, 3) kg m^2, that no rigid body has."""
    moments = np.linalg.eigvalsh(matrix)
    slack = 1e-3 * max(abs(moments).max(), 1e-12)  # figures from CAD are rounded
    if moments[0] < -slack or moments[0] + moments[1] < moments[2] - slack:
        moments_text = ", ".join(f"{moment:.4g}" for moment in moments)
        raise error(
            problem,
            where=where,
            found=f"principal moments {moments_text} kg m^2",
            allowed="moments >= 0, none above the sum of the other two, about the centre of mass",
            hint=hint,
        )


def _spread(lever: np.ndarray) -> np.ndarray:
    """Second moment of a point of 1 kg at `lever`, (3,) m, about the origin, kg m^2."""
    return np.dot(lever, lever) * np.eye(3) - np.outer(lever, lever)


def origin_of(owner: Element, path: str) -> np.ndarray:
    """Return the placement, (4, 4), that an origin describes."""
    zeros = "0 0 0"
    return _place(
        numbers_of(owner, path, "xyz", zeros), numbers_of(owner, path, "rpy", zeros)
    )


def _place(xyz: Sequence[float], rpy: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the placement, (4, 4), with roll, pitch and yaw, rad, about the fixed x, then y, then z axis."""
    placed = np.eye(4)
    roll, pitch, yaw = map(turns_about, np.eye(3), rpy)
    placed[:3, :3] = yaw @ pitch @ roll
    placed[:3, 3] = xyz
    return placed


def _displacement(joint: Element, position: float) -> np.ndarray:
    """Displacement, (4, 4), of a joint that is held at a position, rad or m."""
    placed = np.eye(4)
    if joint.get("type") == "prismatic":
        placed[:3, 3] = position * _axis(joint)
    elif joint.get("type") in ("revolute", "continuous"):
        placed[:3, :3] = turns_about(_axis(joint), position)
    return placed


def turns_about(axis: np.ndarray, angles: np.ndarray | float) -> np.ndarray:
    """Return the rotation matrices, (..., 3, 3), about a unit vector by angles (...), rad (Rodrigues' formula)."""
    identity = np.eye(3)
    still = np.outer(axis, axis)
    cosine = np.cos(angles)[..., None, None]
    sine = np.sin(angles)[..., None, None]
    return still + cosine * (identity - still) + sine * cross(axis[:, None], identity)
