"""Reading and checking a URDF with yourdfpy, and the chain from base to tool within it.

What brachis refuses in a URDF: joints that no serial chain has, and bodies that cannot be.
"""

from __future__ import annotations

import copy
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree

from brachis.common import files
from brachis.common.files import Kind, check_kind
from brachis.errors import UnknownNameError, UrdfError
from brachis.robot.limits import FARTHEST, UrdfLimit
from brachis.robot.urdf_bodies import StatedChain, stated_chain
from brachis.robot.urdf_elements import UrdfTree, check_numbers, read_tree

if TYPE_CHECKING:
    import yourdfpy

MOVING_TYPES = ("revolute", "continuous", "prismatic")
_LEAST_AXIS = 1e-9


def check_joints(
    chain: Sequence[Any], names: set[str], by_name: Mapping[str, Any], where: str
) -> None:
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
        if joint.mimic is not None and (
            joint.name in names or joint.mimic.joint in names
        ):
            raise UrdfError(
                f"joint {joint.name!r} mimics {joint.mimic.joint!r}",
                where=where,
                found="a mimic joint that moves with the chain",
                allowed="independent joints",
                hint="Remove the mimic element, or lock the joint that it follows with robot.locked_joints",
            )


def check_inertias(
    urdf: yourdfpy.URDF, chain: Sequence[Any], parents: Mapping[str, Any], where: str
) -> None:
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


def _check_inertia(link: Any, where: str) -> None:
    """Refuse a negative mass and an inertia matrix that breaks the triangle inequality."""
    mass, matrix = link.inertial.mass or 0.0, link.inertial.inertia
    if not np.isfinite(mass) or mass < 0.0:
        raise UrdfError(
            f"link {link.name!r} has a non-physical mass",
            where=where,
            found=f"{mass:g} kg",
            allowed=">= 0 kg",
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
    moments = (
        np.linalg.eigvalsh(np.asarray(matrix, dtype=float))
        if np.all(np.isfinite(matrix))
        else np.array([np.nan])
    )
    slack = 1e-3 * max(abs(moments).max(), 1e-12)  # figures from CAD are rounded
    physical = moments[0] >= -slack and (
        len(moments) < 3 or moments[0] + moments[1] >= moments[2] - slack
    )
    if not physical:
        raise UrdfError(
            f"link {link.name!r} has a non-physical inertia",
            where=where,
            found="principal moments "
            + ", ".join(f"{m:.4g}" for m in moments)
            + " kg m^2",
            allowed="moments >= 0, none above the sum of the other two",
        )


_NEEDED = (
    "inertial",
    "parent",
    "child",
    "origin",
    "axis",
    "limit",
    "dynamics",
    "mimic",
)
"""Parts of links and joints that say how the robot moves and what it weighs."""


@dataclass(frozen=True)
class UrdfChain:
    """The chain from base to tool of a URDF, all other joints fixed.

    Attributes
    ----------
    joint_names : tuple of str
        Moving joints of the chain, from base to tool.
    limits : tuple of UrdfLimit
        Their limits as the URDF states them.
    locked : dict of str to float
        Every other moving joint and the position it is held at, rad or m.
    tool_frame, base_frame : str
        Link names.
    xml : str
        The URDF that Pinocchio reads: ``continuous`` joints have become ``revolute`` ones without range, so that
        every joint has one coordinate, and unsupported joints off the chain have become fixed.
    stated : StatedChain
        The chain as the text states it, read without Pinocchio.
    """

    joint_names: tuple[str, ...]
    limits: tuple[UrdfLimit, ...]
    locked: dict[str, float]
    tool_frame: str
    base_frame: str
    xml: str
    stated: StatedChain


def read_chain(
    text: str,
    where: str,
    *,
    tool_frame: str | None,
    base_frame: str | None,
    locked_joints: Mapping[str, float],
) -> UrdfChain:
    """Read a URDF and find the chain from `base_frame` to `tool_frame`.

    Parameters
    ----------
    text : str
        The URDF.
    where : str
        Name of the file, for messages.
    tool_frame : str or None
        Link at the chain's end; None takes the URDF's only leaf link.
    base_frame : str or None
        Link at the chain's beginning; None takes the root link.
    locked_joints : mapping of str to float
        Joints held at a position, rad or m.

    Raises
    ------
    UrdfError
        The text is broken, the chain has an unsupported joint, or a moving link lacks a physical inertia.
    UnknownNameError
        A frame or joint does not exist.
    """
    tree, urdf = parse_urdf(text, where)
    parents = {joint.child: joint for joint in urdf.robot.joints}
    links = list(tree.links)
    tool = _tool(urdf, tool_frame, where)
    base = base_frame if base_frame is not None else tree.root
    if base not in links:
        raise UnknownNameError("frame", base, links, where=f"{where}: base_frame")
    path_joints = joints_between(base, tool, parents, where)
    by_name = {
        joint.name: joint for joint in urdf.robot.joints if joint.type != "fixed"
    }
    for name in locked_joints:
        if name not in by_name:
            raise UnknownNameError(
                "moving joint", name, by_name, where=f"{where}: locked_joints"
            )
        if not abs(locked_joints[name]) <= FARTHEST:
            raise UrdfError(
                "the position of a locked joint is no position",
                where=f"robot.locked_joints.{name}",
                found=locked_joints[name],
                allowed=f"finite, within {FARTHEST:g} rad or m of zero",
            )
    chain = [
        joint
        for joint in path_joints
        if joint.type != "fixed" and joint.name not in locked_joints
    ]
    check_joints(chain, {joint.name for joint in chain}, by_name, where)
    if not chain:
        raise UrdfError(
            "no joint moves the tool", where=where, found=f"chain {base} -> {tool}"
        )
    locked = {
        name: _lock_position(by_name[name], locked_joints)
        for name in by_name
        if name not in {j.name for j in chain}
    }
    check_inertias(urdf, chain, parents, where)
    limits = tuple(_limit_of(joint) for joint in chain)
    names = tuple(joint.name for joint in chain)
    return UrdfChain(
        names,
        limits,
        locked,
        tool,
        base,
        _plain_xml(urdf),
        stated_chain(tree, names, locked, tool),
    )


def read_file(path: Path) -> str:
    """Text of a URDF file.

    Raises
    ------
    UrdfError
        The file is missing, not text, another file of brachis, or no regular file of a size that a URDF may have.
    """
    check_kind(path, Kind.URDF, UrdfError)
    try:
        return files.read_file(path).decode()
    except FileNotFoundError as error:
        ours = files.shipped("robots") / path.name / "robot.urdf"
        hint = (
            f"The robot of this name that comes with brachis is {ours}"
            if files.is_file(ours)
            else ""
        )
        raise UrdfError(
            "the URDF file does not exist", where=str(path), hint=hint
        ) from error
    except UnicodeDecodeError as error:
        raise UrdfError(
            "the URDF file cannot be read", where=str(path), found=str(error)
        ) from error
    except OSError as error:
        raise UrdfError(
            f"the URDF file cannot be read: {error.strerror}", where=str(path)
        ) from error


def parse_urdf(text: str, where: str) -> tuple[UrdfTree, yourdfpy.URDF]:
    """Read the checked elements of a URDF, and have yourdfpy read what of them is needed.

    Raises
    ------
    UrdfError
        See `read_tree` and `check_numbers`.
    """
    import yourdfpy

    tree = read_tree(text, where)
    check_numbers(tree, where)
    try:
        urdf = yourdfpy.URDF.load(
            io.BytesIO(_needed(tree)),
            build_scene_graph=False,
            build_collision_scene_graph=False,
            load_meshes=False,
        )
    except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
        raise UrdfError(
            "the URDF cannot be read",
            where=where,
            found=f"{type(error).__name__}: {error}",
        ) from error
    return tree, urdf


def _needed(tree: UrdfTree) -> bytes:
    """Write links and joints without what does not move or weigh: shapes, drives, plugins."""
    robot = etree.Element("robot", name="robot")
    for owner in (*tree.links.values(), *tree.joints.values()):
        kept = etree.SubElement(
            robot,
            owner.tag,
            {key: owner.get(key) for key in ("name", "type") if owner.get(key)},
        )
        kept.extend(copy.deepcopy(part) for part in owner if part.tag in _NEEDED)
    return bytes(etree.tostring(robot))


def _tool(urdf: yourdfpy.URDF, tool_frame: str | None, where: str) -> str:
    """Check the named tool frame, or take the only leaf link."""
    links = [link.name for link in urdf.robot.links]
    if tool_frame is not None:
        if tool_frame not in links:
            raise UnknownNameError(
                "frame", tool_frame, links, where=f"{where}: tool_frame"
            )
        return tool_frame
    inner = {joint.parent for joint in urdf.robot.joints}
    leaves = [name for name in links if name not in inner]
    if len(leaves) != 1:
        raise UrdfError(
            "the tool frame is not clear",
            where=where,
            found=f"{len(leaves)} links without children: {', '.join(leaves)}",
            hint="Set robot.tool_frame to one of the robot's links",
        )
    return leaves[0]


def joints_between(
    base: str, tool: str, parents: Mapping[str, Any], where: str
) -> list[Any]:
    """List the joints from base to tool, in chain order."""
    joints: list[Any] = []
    link = tool
    while link != base:
        joint = parents.get(link)
        if joint is None or joint in joints:
            raise UrdfError(
                "the tool frame is not below the base frame",
                where=where,
                found=f"{base} -> {tool}",
            )
        joints.append(joint)
        link = joint.parent
    return joints[::-1]


def _lock_position(joint: Any, locked_joints: Mapping[str, float]) -> float:
    """Position at which a joint off the chain is held: the user's, else zero or the range's nearest end."""
    if joint.name in locked_joints:
        return float(locked_joints[joint.name])
    if joint.limit is None or joint.type == "continuous":
        return 0.0
    low = -np.inf if joint.limit.lower is None else joint.limit.lower
    high = np.inf if joint.limit.upper is None else joint.limit.upper
    return float(np.clip(0.0, low, high)) if low <= high else 0.0


def _limit_of(joint: Any) -> UrdfLimit:
    """Read the limits of one joint; the range of a revolute or prismatic joint may have to come from the task."""
    limit = joint.limit
    velocity, effort = (limit.velocity, limit.effort) if limit else (None, None)
    if joint.type == "continuous":
        return UrdfLimit(None, None, velocity, effort)
    if limit is None or limit.lower is None or limit.upper is None:
        return UrdfLimit(None, None, velocity, effort, needs_range=True)
    return UrdfLimit(limit.lower, limit.upper, velocity, effort)


def _plain_xml(urdf: yourdfpy.URDF) -> str:
    """Write the URDF with one-coordinate joints only; Pinocchio gives a continuous joint two coordinates."""
    from yourdfpy import Limit

    taken = {link.name for link in urdf.robot.links}
    for joint in urdf.robot.joints:
        joint.mimic = None
        if joint.type == "continuous":
            joint.type = "revolute"
            joint.limit = Limit(effort=0.0, velocity=0.0, lower=-1e9, upper=1e9)
        elif joint.type not in (*MOVING_TYPES, "fixed"):
            joint.type = "fixed"
        elif joint.type != "fixed":
            joint.limit = Limit(effort=0.0, velocity=0.0, lower=-1e9, upper=1e9)
        while (
            joint.type == "fixed" and joint.name in taken
        ):  # Pinocchio looks frames up by name
            joint.name += "_joint"
        taken.add(joint.name)
    for link in urdf.robot.links:
        link.visuals, link.collisions = [], []
    xml = urdf.write_xml_string()
    return xml.decode() if isinstance(xml, bytes) else str(xml)
