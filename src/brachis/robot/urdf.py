"""The chain from base to tool of a URDF: its joints, the positions of all other joints, and checks.

For a robot with several limbs or with fingers, the module also finds the default chain.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from graphlib import CycleError, TopologicalSorter
from itertools import takewhile
from pathlib import Path

import numpy as np
from lxml import etree

from brachis.common import files, tolerances
from brachis.errors import UrdfError, check_names
from brachis.robot.limits import FARTHEST, UrdfLimit
from brachis.robot.mjcf import is_mjcf, urdf_of_mjcf
from brachis.robot.urdf_bodies import (
    Body,
    UrdfDynamics,
    check_inertia,
    inertia_matrix,
    mass_of,
    read_dynamics,
)
from brachis.robot.urdf_elements import (
    ENTRIES,
    Element,
    UrdfTree,
    end_of,
    number_of,
    numbers_of,
    read_tree,
)
from brachis.robot.workpiece import carrying_joints, tree_seen_from

LINK = "link:"
"""Prefix of link names in the URDF that Pinocchio reads, which distinguishes them from joint names."""
_WORLD = "universe"
_MOVING_TYPES = ("revolute", "continuous", "prismatic")


def _check_joints(
    tree: UrdfTree, path: Sequence[str], chain: Sequence[str], where: str
) -> None:
    """Refuse joints that a serial chain of one-coordinate joints cannot contain.

    Joints on the path from base to tool that do not move are not in the chain. A mimic joint that is not on the path is
    held.
    """
    if _WORLD in tree.joints:
        raise UrdfError(
            "a joint has the name that Pinocchio gives to the world",
            where=where,
            found=f"joint {_WORLD!r}",
            hint="Rename the joint",
        )
    for name in chain:
        joint = tree.joints[name]
        kind = joint.get("type")
        if kind not in _MOVING_TYPES:
            raise UrdfError(
                f"joint {name!r} cannot be planned for",
                where=where,
                found=f"type {kind!r}",
                allowed=", ".join(_MOVING_TYPES),
                hint="Lock it with robot.locked_joints, or set robot.base_frame below it",
            )
        axis = numbers_of(joint, "axis", "xyz", "1 0 0")
        if not np.linalg.norm(axis) > tolerances.ANGLE:
            raise UrdfError(
                f"the axis of joint {name!r} has zero length",
                where=where,
                found=f"<axis xyz={' '.join(f'{component:g}' for component in axis)!r}>",
                allowed="a direction, of any length except zero",
            )
    for name in path:
        leader = _leader_of(tree.joints[name])
        if leader and not {name, leader}.isdisjoint(chain):
            raise UrdfError(
                f"joint {name!r} mimics {leader!r}",
                where=where,
                found="a mimic joint between base and tool",
                allowed="independent joints",
                hint=f"Remove the mimic element, or lock {name} and {leader} with robot.locked_joints",
            )


def check_inertias(tree: UrdfTree, bodies: Sequence[Body], where: str) -> None:
    """Refuse a negative mass, a mass without moments of inertia, and moments of inertia that no body can have."""
    for body in bodies:
        hint = (
            f"Correct it in the URDF; or lock the joints from the base to {body.joint} with robot.locked_joints, if "
            "they need not move"
        )
        for name in body.links:
            element = tree.links[name]
            mass = mass_of(element)
            if mass < 0.0:
                raise UrdfError(
                    f"link {name!r} has a negative mass",
                    where=where,
                    found=f"{mass:g} kg",
                    allowed=">= 0 kg",
                    hint=hint,
                )
            if mass > 0.0 and element.find("inertial/inertia") is None:
                raise UrdfError(
                    f"link {name!r} has a mass but no <inertia>",
                    where=where,
                    found=f"{mass:g} kg",
                    allowed="<inertia> with the moments about the centre of mass",
                    hint=hint,
                )
            problem = f"link {name!r} has a non-physical inertia"
            check_inertia(inertia_matrix(element), problem, where, UrdfError, hint)


@dataclass(frozen=True)
class UrdfChain:
    """The chain from base to tool of a URDF, with all other joints fixed.

    Attributes
    ----------
    joint_names : tuple of str
        Moving joints of the chain, from base to tool.
    limits : tuple of UrdfLimit
        Limits of these joints as stated in the URDF.
    locked : dict of str to float
        Position at which each of the other moving joints is held, rad or m.
    tool_frame, base_frame : str
        Links at the end and at the beginning of the chain.
    xml : str
        The URDF that Pinocchio reads. In it ``continuous`` joints are ``revolute`` joints without a range, so that
        every joint has one coordinate; unsupported joints outside the chain are fixed; and names of links begin with
        `LINK`.
    dynamics : UrdfDynamics
        Joints, bodies and friction as stated in the text, read without Pinocchio.
    """

    joint_names: tuple[str, ...]
    limits: tuple[UrdfLimit, ...]
    locked: dict[str, float]
    tool_frame: str
    base_frame: str
    xml: str
    dynamics: UrdfDynamics


@lru_cache(maxsize=16)
def read_chain(
    text: str,
    where: str,
    tool_frame: str | None = None,
    base_frame: str | None = None,
    locked_joints: tuple[tuple[str, float], ...] = (),
    workpiece_frame: str | None = None,
) -> UrdfChain:
    """Read a URDF and find the chain from `base_frame` to `tool_frame`. The result is cached for further plans.

    Parameters
    ----------
    text : str
        The URDF.
    where : str
        Name of the file, for messages.
    tool_frame : str, optional
        Link at the end of the chain. Default: the only leaf link of the URDF.
    base_frame : str, optional
        Link at the beginning of the chain. Default: the root link.
    locked_joints : tuple of (str, float), optional
        Joints held at a position, rad or m.
    workpiece_frame : str, optional
        Link in whose frame the paths are given; the chain then begins there, and goes through the joints that carry it.

    Raises
    ------
    UrdfError
        The text is broken, `base_frame` is given with `workpiece_frame`, the chain has an unsupported joint, or the
        inertia of a moving link is not physical.
    UnknownNameError
        A frame or joint does not exist.
    """
    positions = dict(locked_joints)
    tree = read_tree(text, where)
    frames = {
        "tool_frame": tool_frame,
        "base_frame": base_frame,
        "workpiece_frame": workpiece_frame,
    }
    for key, frame in frames.items():
        if frame is not None:
            check_names("frame", [frame], tree.links, f"{where}: {key}")
    world = tree.root
    carrying: list[str] = []
    if workpiece_frame is not None:
        if base_frame is not None:
            raise UrdfError(
                "a chain to a workpiece has no base frame",
                where=f"{where}: base_frame",
                found=base_frame,
                allowed="either base_frame or workpiece_frame",
                hint="Hold joints in front of the arm with robot.locked_joints",
            )
        carrying = carrying_joints(tree, workpiece_frame)
        tree = tree_seen_from(tree, workpiece_frame, where)
    leaves = _leaves(tree)
    if tool_frame is None and len(leaves) != 1:
        raise UrdfError(
            "the tool frame is ambiguous",
            where=where,
            found=f"{len(leaves)} links without children: {', '.join(leaves)}",
            hint="Set robot.tool_frame to one of the robot's links",
        )
    tool = leaves[0] if tool_frame is None else tool_frame
    base = tree.root if base_frame is None else base_frame
    path = _joints_between(tree, base, tool, where)
    joints = tree.joints.items()
    movable = [name for name, joint in joints if joint.get("type") != "fixed"]
    check_names("moving joint", positions, movable, f"{where}: locked_joints")
    for name, position in positions.items():
        _check_locked_position(tree.joints[name], name, position)
    chain = tuple(name for name in path if name in movable and name not in positions)
    _check_joints(tree, path, chain, where)
    if not chain:
        raise UrdfError(
            "no joint moves the tool", where=where, found=f"chain {base} -> {tool}"
        )
    still = [name for name in movable if name not in chain]
    locked = _lock(tree, still, positions, where)
    carriers = sum(name in carrying for name in chain)
    dynamics = read_dynamics(tree, chain, locked, tool, world, carriers)
    check_inertias(tree, dynamics.bodies, where)
    limits = tuple(_read_limit(tree.joints[name]) for name in chain)
    return UrdfChain(chain, limits, locked, tool, base, _plain_xml(tree), dynamics)


def _check_locked_position(joint: Element, name: str, position: float) -> None:
    """Refuse a position of a locked joint, rad or m, that is out of its range."""
    lowest, highest = (_clip_to_range(joint, end) for end in (-FARTHEST, FARTHEST))
    if not lowest - tolerances.ANGLE <= position <= highest + tolerances.ANGLE:
        unit = _unit_of(joint)
        raise UrdfError(
            "the position of a locked joint is out of its range",
            where=f"robot.locked_joints.{name}",
            found=f"{position:g} {unit}",
            allowed=f"{lowest:g} to {highest:g} {unit}",
        )


def _lock(
    tree: UrdfTree, names: Sequence[str], positions: Mapping[str, float], where: str
) -> dict[str, float]:
    """Find the positions, rad or m, of held joints: the given one, else the mimicked one, else the closest to 0.

    A mimic joint may be outside its own range, if the joint that it mimics places it there.
    """
    locked = {
        name: float(positions.get(name, _clip_to_range(tree.joints[name], 0.0)))
        for name in names
    }
    leaders = {name: _leader_of(tree.joints[name]) for name in names}
    graph = {name: {leaders[name]} & set(names) for name in names}
    try:
        order = tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        raise UrdfError(
            "joints mimic each other in a loop",
            where=where,
            found=" -> ".join(error.args[1]),
        ) from error
    for name in order:
        joint = tree.joints[name]
        leader = leaders[name]
        if leader not in locked:
            continue
        multiplier = number_of(joint, "mimic", "multiplier", 1.0)
        offset = number_of(joint, "mimic", "offset", 0.0)
        position = multiplier * locked[leader] + offset
        if name in positions and abs(positions[name] - position) > tolerances.ANGLE:
            unit = _unit_of(joint)
            raise UrdfError(
                f"joint {name!r} mimics {leader!r}, which is locked at "
                f"{locked[leader]:g} {_unit_of(tree.joints[leader])}",
                where=f"robot.locked_joints.{name}",
                found=f"{positions[name]:g} {unit}",
                allowed=f"{position:g} {unit}",
                hint=f"Leave {name} out, or lock {leader} at the position that {name} needs",
            )
        locked[name] = position
    return locked


def _leader_of(joint: Element) -> str:
    """Return the name of the joint that this joint mimics; empty if it mimics none."""
    mimic = joint.find("mimic")
    return "" if mimic is None else mimic.get("joint", "")


def _unit_of(joint: Element) -> str:
    """Return the unit of a joint's position."""
    return "m" if joint.get("type") == "prismatic" else "rad"


def read_file(path: Path) -> str:
    """Return the text of a URDF file; convert an MJCF file to a URDF.

    Raises
    ------
    UrdfError
        The file is missing, is not text, is a different kind of brachis file, is not a regular file or is too long; or
        MuJoCo refuses it.
    """
    files.check_kind(path, files.Kind.URDF, UrdfError)
    ours = files.shipped_folder("robots") / path.name / "robot.urdf"
    hint = f"The robot of this name that comes with brachis is {ours}"
    text = files.read_text(
        path,
        where=str(path),
        hint=hint if files.is_file(ours) else "",
        error=UrdfError,
    )
    return urdf_of_mjcf(path) if is_mjcf(text) else text


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
        link = end_of(tree.joints[joints[-1]], "parent")
    return joints[::-1]


def _clip_to_range(joint: Element, position: float) -> float:
    """Return the position in the joint's range that is closest to a given position."""
    if joint.get("type") == "continuous":
        return position
    lower = number_of(joint, "limit", "lower", -np.inf)
    upper = number_of(joint, "limit", "upper", np.inf)
    return float(np.clip(position, lower, upper)) if lower <= upper else position


def _read_limit(joint: Element) -> UrdfLimit:
    """Read the limits of one joint. The task may have to state the range of a revolute or prismatic joint."""
    lower, upper, velocity, effort = (
        number_of(joint, "limit", key, None)
        for key in ("lower", "upper", "velocity", "effort")
    )
    effort = effort or None  # exporters write 0 if no limit was stated
    turns_freely = joint.get("type") == "continuous"
    if turns_freely or lower is None or upper is None:
        return UrdfLimit(None, None, velocity, effort, needs_range=not turns_freely)
    return UrdfLimit(lower, upper, velocity, effort)


def _plain_xml(tree: UrdfTree) -> str:
    """Write the URDF with one-coordinate joints only, because Pinocchio gives a continuous joint two coordinates.

    Pinocchio looks up joints and links by name alone, so the names of links get the prefix `LINK`.
    """
    robot = etree.Element("robot", name="robot")
    for name in dict.fromkeys([*tree.links, *tree.downward]):
        plain = etree.SubElement(robot, "link", name=LINK + name)
        link = tree.links.get(name)
        if link is not None and mass_of(link):
            plain.extend(_copy_parts(link, "inertial"))
    kinds = {"prismatic": "prismatic", "revolute": "revolute", "continuous": "revolute"}
    for name, joint in tree.joints.items():
        kind = kinds.get(joint.get("type"), "fixed")
        plain = etree.SubElement(robot, "joint", name=name, type=kind)
        plain.extend(_copy_parts(joint, "parent", "child", "origin", "axis"))
        for end in plain.iter("parent", "child"):
            end.set("link", LINK + end.get("link"))
        if kind != "fixed":  # brachis checks the limits of the URDF itself
            wide = {"effort": "0", "velocity": "0", "lower": "-1e9", "upper": "1e9"}
            etree.SubElement(plain, "limit", wide)
    return str(etree.tostring(robot, encoding="unicode"))


def _copy_parts(owner: Element, *tags: str) -> list[Element]:
    """Copy elements of a checked link or joint, with numbers as Python writes them."""
    attributes = {entry.attribute for kind in ENTRIES.values() for entry in kind}
    children = [copy.deepcopy(child) for child in owner if child.tag in tags]
    for child in children:
        for element in child.iter(etree.Element):
            for key in attributes & set(element.keys()):
                numbers = map(float, element.get(key).split())
                element.set(key, " ".join(map(str, numbers)))
    return children


@dataclass(frozen=True)
class DefaultChain:
    """The chain of a robot that is used unless the user names another chain.

    Attributes
    ----------
    base : str or None
        Link from which several limbs branch off; None for a single limb, which begins at the root of the URDF.
    tool : str
        Last link before the limb itself branches, for example into fingers; the last link of all if the limb does not
        branch.
    leaves : tuple of str
        Links at the ends of the limb.
    """

    base: str | None
    tool: str
    leaves: tuple[str, ...]


def default_chain(text: str, where: str) -> DefaultChain:
    """Find the chain with the most joints in a URDF: an arm without its fingers, and without a shared trunk.

    Limbs are chains that share less than half of their joints. Of several limbs, the first in the file is used.

    Raises
    ------
    UrdfError
        The text is broken, or no joint moves anything.
    """
    tree = read_tree(text, where)

    def count_moving(chain: Iterable[str]) -> int:
        return sum(tree.joints[name].get("type") in _MOVING_TYPES for name in chain)

    chains = {
        leaf: _joints_between(tree, tree.root, leaf, where) for leaf in _leaves(tree)
    }
    most_joints = max(count_moving(chain) for chain in chains.values())
    if not most_joints:
        raise UrdfError(
            "no joint moves", where=where, found=f"chains to {', '.join(chains)}"
        )
    longest = [chain for chain in chains.values() if count_moving(chain) == most_joints]
    limb = {}
    for leaf, chain in chains.items():
        # A chain that leaves the limb in its upper half and has moving joints there is a branch; fixed frames are not.
        shared = count_moving(_common_beginning([longest[0], chain]))
        if 2 * shared >= most_joints and (
            count_moving(chain) > shared or shared == most_joints
        ):
            limb[leaf] = chain
    trunk = _common_beginning(longest)
    has_trunk = trunk and 2 * count_moving(trunk) < most_joints
    base = end_of(tree.joints[trunk[-1]], "child") if has_trunk else None
    last_joint = _common_beginning(limb.values())[-1]
    return DefaultChain(base, end_of(tree.joints[last_joint], "child"), tuple(limb))


def _common_beginning(chains: Collection[Sequence[str]]) -> list[str]:
    """List the joints with which all chains from the same root begin."""
    rows = zip(*chains, strict=False)
    shared = takewhile(lambda joints: len(set(joints)) == 1, rows)
    return [joints[0] for joints in shared]
