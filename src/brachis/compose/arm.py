"""Reading the URDF of an arm that is to be mounted elsewhere, and what changes in it there."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from brachis import files
from brachis.compose.elements import Element
from brachis.robot.urdf import parse_urdf, read_file
from brachis.robot.urdf_checks import check_inertias
from brachis.robot.urdf_tree import read_tree


@dataclass(frozen=True)
class Arm:
    """A URDF as XML, so that whatever yourdfpy does not know is kept as written.

    Attributes
    ----------
    robot : lxml element
        The ``<robot>`` element.
    root_link : str
        The only link that no joint moves or holds.
    link_names, joint_names : tuple of str
        All links and joints, in the order of the file.
    source : Path
        The file.
    """

    robot: Element
    root_link: str
    link_names: tuple[str, ...]
    joint_names: tuple[str, ...]
    source: Path


def read_arm(source: Path) -> Arm:
    """Read a URDF whose links form one tree.

    Raises
    ------
    UrdfError
        See `read_file` and `read_tree`.
    """
    tree = read_tree(read_file(source), str(source))
    return Arm(tree.robot, tree.root, tuple(tree.links), tuple(tree.joints), source)


def rename_link(robot: Element, old: str, new: str) -> None:
    """Give a link another name wherever the URDF mentions it."""
    for element in robot.iter(etree.Element):
        if element.tag == "link" and element.get("name") == old:
            element.set("name", new)
        for attribute in ("link", "reference"):
            if element.get(attribute) == old:
                element.set(attribute, new)


def drop_meshes(robot: Element) -> None:
    """Remove every visual and collision whose geometry is a mesh; primitives stay."""
    for link in robot.findall("link"):
        for element in (*link.findall("visual"), *link.findall("collision")):
            if element.find("geometry/mesh") is not None:
                link.remove(element)


def relocate_meshes(robot: Element, source: Path, target: Path | None) -> None:
    """Name mesh and texture files, which are found from the folder of `source`, relative to the folder of `target`.

    Without `target` they become absolute. Absolute names stay as they are, and so do packages that ROS finds, or that
    are nowhere.
    """
    old = source.parent.resolve()
    new = None if target is None else target.parent.resolve()
    for element in robot.iter("mesh", "texture"):
        name = element.get("filename")
        if not name or Path(name).is_absolute():
            continue
        scheme, _, within = name.partition("://")
        path: Path | None = old / name
        if within:
            by_ros = any(files.is_file(place) for place in files.ros_files(within))
            path = None if by_ros or scheme != "package" else files.mesh_file(name, old)
        if path is None:
            continue
        element.set("filename", os.path.normpath(path) if new is None else os.path.relpath(path, new))


def check_composed(text: str, joint: str, where: str) -> None:
    """Refuse numbers that are none, and bodies below `joint` that cannot be.

    On a moving axis even the inertia of the arm's root link counts, which no joint moved before.

    Raises
    ------
    UrdfError
    """
    _, urdf = parse_urdf(text, where)
    parents = {each.child: each for each in urdf.robot.joints}
    check_inertias(urdf, [each for each in urdf.robot.joints if each.name == joint], parents, where)
