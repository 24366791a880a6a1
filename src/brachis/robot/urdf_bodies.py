"""The chain of a URDF as stated in its text, read without Pinocchio, for the verification of motions."""

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
    """The body that one joint of a chain moves: a link and all links that are fixed to it.

    A joint that carries the workpiece moves, in the world, the body before it in the chain.

    Attributes
    ----------
    joint : str
    placement : (4, 4) ndarray
        Placement of the joint at position zero in the frame of the joint before it, or in the root link for the first
        joint.
    axis : (3,) ndarray
        Unit vector of the joint's axis in the joint's own frame.
    sliding : bool
        Whether the joint is prismatic.
    links : tuple of str
    mass : float
        kg.
    com : (3,) ndarray
        Centre of mass in the frame of the body's first link, m; zeros if the mass is zero.
    inertia : (3, 3) ndarray
        Inertia about the centre of mass, along the axes of the same frame, kg m^2.
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
    """The dynamics of a chain as stated in a URDF.

    Attributes
    ----------
    bodies : tuple of Body
        The body that each joint moves, in the order of the chain.
    tool : (4, 4) ndarray
        Placement of the tool frame in the frame of the last joint.
    friction : dict of str to (n,) ndarray
        ``viscous``: damping, Nm s/rad or N s/m. ``coulomb``: friction, Nm or N. ``armature``: kg m^2 or kg, written
        only by `write_urdf`. Zero if not stated.
    links : dict of str to tuple of int and (4, 4) ndarray
        For every link, the number of the joint before it in the chain, counted from 1, and the link's placement in the
        joint's frame. For a link before all joints: 0, and its placement in the first link of the chain.
    root : str
        Link that is fixed in the world: the root link of the URDF.
    carriers : int
        Number of joints, the first ones, that carry the workpiece; see `brachis.robot.workpiece`.
    """

    bodies: tuple[Body, ...]
    tool: np.ndarray
    friction: dict[str, np.ndarray]
    links: dict[str, tuple[int, np.ndarray]]
    root: str
    carriers: int

    @property
    def without_mass(self) -> tuple[Body, ...]:
        """The bodies without any mass."""
        return tuple(body for body in self.bodies if not body.mass)


def read_dynamics(
    tree: UrdfTree,
    chain: Sequence[str],
    locked: Mapping[str, float],
    tool: str,
    world: str | None = None,
    carriers: int = 0,
) -> UrdfDynamics:
    """Read a chain of a checked URDF, and sum up the inertias of the links that each joint moves.

    Parameters
    ----------
    tree : UrdfTree
        The URDF; its numbers have been checked.
    chain : sequence of str
        Moving joints of the chain.
    locked : mapping of str to float
        Positions of the other joints, rad or m.
    tool : str
        Link at the end of the chain.
    world : str, optional
        Link that is fixed in the world. Default: the root of the tree.
    carriers : int, optional
        Number of joints that carry the workpiece.
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
        moved = i if i > carriers else i - 1
        links = {
            link: placed
            for link, (number, placed) in in_order.items()
            if number == moved
        }
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
    return UrdfDynamics(
        tuple(bodies),
        carried[tool][1],
        friction,
        in_order,
        world or tree.root,
        carriers,
    )


def _read_body(
    tree: UrdfTree, name: str, placement: np.ndarray, links: Mapping[str, np.ndarray]
) -> Body:
    """Sum up the links of a body, given with their placements in the joint's frame."""
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
    """Return the mass of a checked link, kg. If a link has no mass, its moments of inertia are ignored."""
    return number_of(link, "inertial/mass", "value", 0.0)


def inertia_matrix(link: Element) -> np.ndarray:
    """Return the inertia matrix, (3, 3) kg m^2, of a checked link; zeros if it states none."""
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
    """Refuse an inertia matrix, (3, 3) kg m^2, that no rigid body can have."""
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
    """Return the inertia of a 1 kg point mass at `lever`, (3,) m, about the origin, kg m^2."""
    return np.dot(lever, lever) * np.eye(3) - np.outer(lever, lever)


def origin_of(owner: Element, path: str) -> np.ndarray:
    """Return the placement, (4, 4), given by an ``<origin>``."""
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
    """Return the displacement, (4, 4), of a joint that is held at a position, rad or m."""
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
