"""The chain from base to tool of a URDF: which joints it has, where the others are held, and what is refused.

Of a robot with several limbs, or with fingers, also the chain that is taken unless the user names another.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

from brachis.common import files
from brachis.common.files import Kind, check_kind
from brachis.errors import UnknownNameError, UrdfError
from brachis.robot.limits import FARTHEST, UrdfLimit
from brachis.robot.urdf_bodies import (
    Body,
    UrdfDynamics,
    check_inertia,
    inertia_matrix,
    read_dynamics,
)
from brachis.robot.urdf_elements import (
    Element,
    UrdfTree,
    end_of,
    number_of,
    numbers_of,
    read_tree,
)

MOVING_TYPES = ("revolute", "continuous", "prismatic")
_PINOCCHIO_LIMIT = {"effort": "0", "velocity": "0", "lower": "-1e9", "upper": "1e9"}
"""Limits of the model: brachis checks those of the URDF and of the task by itself."""

_NUMERIC = ("origin", "axis", "mass", "inertia", "dynamics")


def _check_joints(tree: UrdfTree, chain: Sequence[str], where: str) -> None:
    """Refuse joints that a serial chain of one-coordinate joints cannot have."""
    for name in chain:
        joint = tree.joints[name]
        kind = joint.get("type")
        if kind not in MOVING_TYPES:
            raise UrdfError(
                f"joint {name!r} cannot be planned for",
                where=where,
                found=f"type {kind!r}",
                allowed=", ".join(MOVING_TYPES),
                hint="Lock it with robot.locked_joints, or set robot.base_frame below it",
            )
        axis = numbers_of(joint, "axis", "xyz", "1 0 0")
        if not np.linalg.norm(axis) > 1e-9:
            raise UrdfError(
                f"joint {name!r} has no axis",
                where=where,
                found=f"<axis xyz={' '.join(f'{component:g}' for component in axis)!r}>",
                allowed="a direction, any length but zero",
            )
    for name in _movable(tree):
        mimic = tree.joints[name].find("mimic")
        if mimic is None:
            continue
        leader = mimic.get("joint")
        if name in chain or leader in chain:
            raise UrdfError(
                f"joint {name!r} mimics {leader!r}",
                where=where,
                found="a mimic joint that moves with the chain",
                allowed="independent joints",
                hint="Remove the mimic element, or lock the joint that it follows with robot.locked_joints",
            )


def _movable(tree: UrdfTree) -> list[str]:
    """List the joints that are not fixed."""
    return [name for name, joint in tree.joints.items() if joint.get("type") != "fixed"]


def check_inertias(tree: UrdfTree, bodies: Sequence[Body], where: str) -> None:
    """Refuse moving bodies without mass and inertias that no body can have.

    Massless links (frames) are fine if the body as a whole has mass.
    """
    for body in bodies:
        for name in body.links:
            inertial = tree.links[name].find("inertial")
            if inertial is not None:
                _check_inertia(name, inertial, where)
    for body in bodies:
        if not body.mass > 0.0:
            raise UrdfError(
                f"the body moved by joint {body.joint!r} has no mass",
                where=where,
                found=f"links {', '.join(body.links)} without <inertial>",
                allowed="at least one link with <inertial> and mass > 0 kg",
            )


def _check_inertia(link: str, inertial: Element, where: str) -> None:
    """Refuse a negative mass and an inertia matrix that breaks the triangle inequality."""
    mass = numbers_of(inertial, "mass", "value", "0")[0]
    if mass < 0.0:
        raise UrdfError(
            f"link {link!r} has a non-physical mass",
            where=where,
            found=f"{mass:g} kg",
            allowed=">= 0 kg",
        )
    if inertial.find("inertia") is None:
        if mass == 0.0:
            return
        raise UrdfError(
            f"link {link!r} has a mass but no <inertia>",
            where=where,
            found=f"{mass:g} kg",
            allowed="<inertia> with the moments about the centre of mass",
        )
    problem = f"link {link!r} has a non-physical inertia"
    check_inertia(inertia_matrix(inertial), problem, where, UrdfError)


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
    dynamics : UrdfDynamics
        Joints, bodies and friction as the text states them, read without Pinocchio.
    """

    joint_names: tuple[str, ...]
    limits: tuple[UrdfLimit, ...]
    locked: dict[str, float]
    tool_frame: str
    base_frame: str
    xml: str
    dynamics: UrdfDynamics


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
    tree = read_tree(text, where)
    tool = _find_tool(tree, tool_frame, where)
    base = base_frame if base_frame is not None else tree.root
    if base not in tree.links:
        raise UnknownNameError("frame", base, tree.links, where=f"{where}: base_frame")
    path = _joints_between(tree, base, tool, where)
    movable = _movable(tree)
    for name, position in locked_joints.items():
        if name not in movable:
            raise UnknownNameError(
                "moving joint", name, movable, where=f"{where}: locked_joints"
            )
        if not abs(position) <= FARTHEST:
            raise UrdfError(
                "the position of a locked joint is too large",
                where=f"robot.locked_joints.{name}",
                found=position,
                allowed=f"finite, within {FARTHEST:g} rad or m of zero",
            )
    chain = tuple(
        name for name in path if name in movable and name not in locked_joints
    )
    _check_joints(tree, chain, where)
    if not chain:
        raise UrdfError(
            "no joint moves the tool", where=where, found=f"chain {base} -> {tool}"
        )
    locked = {
        name: float(locked_joints.get(name, _rest_position(tree.joints[name])))
        for name in movable
        if name not in chain
    }
    dynamics = read_dynamics(tree, chain, locked, tool)
    check_inertias(tree, dynamics.bodies, where)
    limits = tuple(_read_limit(tree.joints[name]) for name in chain)
    return UrdfChain(chain, limits, locked, tool, base, _plain_xml(tree), dynamics)


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
        ours = files.shipped_folder("robots") / path.name / "robot.urdf"
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


def _find_tool(tree: UrdfTree, tool_frame: str | None, where: str) -> str:
    """Check the named tool frame, or take the only leaf link."""
    if tool_frame is not None:
        if tool_frame not in tree.links:
            raise UnknownNameError(
                "frame", tool_frame, tree.links, where=f"{where}: tool_frame"
            )
        return tool_frame
    leaves = _leaves(tree)
    if len(leaves) != 1:
        raise UrdfError(
            "the tool frame is not clear",
            where=where,
            found=f"{len(leaves)} links without children: {', '.join(leaves)}",
            hint="Set robot.tool_frame to one of the robot's links",
        )
    return leaves[0]


def _leaves(tree: UrdfTree) -> tuple[str, ...]:
    """List the links without children."""
    inner = {end_of(joint, "parent") for joint in tree.joints.values()}
    return tuple(name for name in tree.links if name not in inner)


def _joints_between(tree: UrdfTree, base: str, tool: str, where: str) -> list[str]:
    """List the joints from base to tool, in chain order."""
    joints: list[str] = []
    link = tool
    while link != base:
        if link not in tree.above:
            raise UrdfError(
                "the tool frame is not below the base frame",
                where=where,
                found=f"{base} -> {tool}",
            )
        joints.append(tree.above[link])
        link = str(end_of(tree.joints[joints[-1]], "parent"))
    return joints[::-1]


def _rest_position(joint: Element) -> float:
    """Position at which a joint off the chain is held: zero, or the nearest end of its range."""
    if joint.get("type") == "continuous":
        return 0.0
    lower = number_of(joint, "limit", "lower")
    upper = number_of(joint, "limit", "upper")
    low = -np.inf if lower is None else lower
    high = np.inf if upper is None else upper
    return float(np.clip(0.0, low, high)) if low <= high else 0.0


def _read_limit(joint: Element) -> UrdfLimit:
    """Read the limits of one joint; the range of a revolute or prismatic joint may have to come from the task."""
    lower = number_of(joint, "limit", "lower")
    upper = number_of(joint, "limit", "upper")
    velocity = number_of(joint, "limit", "velocity")
    effort = number_of(joint, "limit", "effort")
    if joint.get("type") == "continuous":
        return UrdfLimit(None, None, velocity, effort)
    if lower is None or upper is None:
        return UrdfLimit(None, None, velocity, effort, needs_range=True)
    return UrdfLimit(lower, upper, velocity, effort)


def _plain_xml(tree: UrdfTree) -> str:
    """Write the URDF with one-coordinate joints only; Pinocchio gives a continuous joint two coordinates."""
    robot = etree.Element("robot", name="robot")
    for name, link in tree.links.items():
        plain = etree.SubElement(robot, "link", name=name)
        plain.extend(_copy_parts(link, "inertial"))
    taken = set(tree.links)
    for name, joint in tree.joints.items():
        kind = "fixed"
        if joint.get("type") in MOVING_TYPES:
            kind = "prismatic" if joint.get("type") == "prismatic" else "revolute"
        unique = name
        while kind == "fixed" and unique in taken:  # Pinocchio looks frames up by name
            unique += "_joint"
        taken.add(unique)
        plain = etree.SubElement(robot, "joint", name=unique, type=kind)
        plain.extend(
            _copy_parts(joint, "parent", "child", "origin", "axis", "dynamics")
        )
        if kind != "fixed":
            etree.SubElement(plain, "limit", _PINOCCHIO_LIMIT)
    return str(etree.tostring(robot, encoding="unicode"))


@dataclass(frozen=True)
class DefaultChain:
    """The chain that is taken from a robot unless the user names another.

    Attributes
    ----------
    base : str or None
        The link from which several limbs part; None for a single limb, which begins at the URDF's root.
    tool : str
        The last link before the limb itself parts, into fingers for example; of a single chain its end.
    leaves : tuple of str
        Links at the limb's ends.
    """

    base: str | None
    tool: str
    leaves: tuple[str, ...]


def default_chain(text: str, where: str) -> DefaultChain:
    """Find the chain of most joints in a URDF: an arm without its fingers, and without the trunk that it shares.

    Limbs share less than half of their joints. Of several the first one in the file is taken.

    Raises
    ------
    UrdfError
        The text is broken, or no joint moves anything.
    """
    tree = read_tree(text, where)

    def count_moving(chain: Iterable[str]) -> int:
        return sum(tree.joints[name].get("type") in MOVING_TYPES for name in chain)

    chains = {
        leaf: _joints_between(tree, tree.root, leaf, where) for leaf in _leaves(tree)
    }
    most = max(count_moving(chain) for chain in chains.values())
    if not most:
        raise UrdfError(
            "no joint moves", where=where, found=f"chains to {', '.join(chains)}"
        )
    longest = [chain for chain in chains.values() if count_moving(chain) == most]

    def is_branch(chain: Sequence[str]) -> bool:
        """Tell whether a chain parts from the limb in its upper half, and moves there; frames are not fingers."""
        shared = count_moving(_common_beginning([longest[0], chain]))
        return 2 * shared >= most and (count_moving(chain) > shared or shared == most)

    limb = {leaf: chain for leaf, chain in chains.items() if is_branch(chain)}
    trunk = _common_beginning(longest)
    base = None
    if trunk and 2 * count_moving(trunk) < most:
        base = end_of(tree.joints[trunk[-1]], "child")
    last_joint = _common_beginning(limb.values())[-1]
    return DefaultChain(
        base, str(end_of(tree.joints[last_joint], "child")), tuple(limb)
    )


def _common_beginning(chains: Collection[Sequence[str]]) -> list[str]:
    """List the joints with which all chains from the same root begin."""
    shared = []
    for joints in zip(*chains, strict=False):
        if len(set(joints)) > 1:
            break
        shared.append(joints[0])
    return shared


def _copy_parts(owner: Element, *tags: str) -> list[Element]:
    """Copy parts of a checked link or joint, with plain numbers and canonical angles."""
    parts = [copy.deepcopy(part) for part in owner if part.tag in tags]
    for part in parts:
        for element in part.iter(*_NUMERIC):
            for key, text in element.attrib.items():
                values = np.array(text.split(), dtype=float)
                if key == "rpy":
                    values = _canonical_angles(*values)
                element.set(key, " ".join(map(str, values)))
    return parts


def _canonical_angles(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return roll, pitch and yaw of the same rotation, (3,), with a pitch within 90 degrees."""
    sin_roll, sin_pitch, sin_yaw = np.sin([roll, pitch, yaw])
    cos_roll, cos_pitch, cos_yaw = np.cos([roll, pitch, yaw])
    # Adding zero turns -0 into 0, so that half a turn is pi and not -pi.
    x_axis = cos_pitch * np.array([cos_yaw, sin_yaw]) + 0.0
    level = np.sqrt(x_axis[0] * x_axis[0] + x_axis[1] * x_axis[1])
    new_pitch = np.arctan2(sin_pitch, level)
    if level > 4.0 * np.finfo(float).eps:
        new_roll = np.arctan2(cos_pitch * sin_roll + 0.0, cos_pitch * cos_roll)
        return np.array([new_roll, new_pitch, np.arctan2(x_axis[1], x_axis[0])])
    # At a pitch of 90 degrees roll and yaw turn about the same axis.
    new_roll = np.arctan2(
        sin_roll * cos_yaw - sin_pitch * (cos_roll * sin_yaw),
        sin_pitch * (sin_roll * sin_yaw) + cos_roll * cos_yaw,
    )
    return np.array([new_roll, new_pitch, 0.0])
