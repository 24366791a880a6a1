"""Reading the URDF of an arm that is to be mounted elsewhere, and what changes in it there."""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from brachis.compose.elements import Element
from brachis.errors import UrdfError
from brachis.robot.urdf import read_file
from brachis.robot.urdf_checks import check_inertias


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
        The file is missing or not a URDF, two links or joints share a name, or the links are not one tree.
    """
    where = str(source)
    robot = _robot_element(read_file(source), where)
    links = tuple(_name_of(link, where) for link in robot.findall("link"))
    joints = tuple(_name_of(joint, where) for joint in robot.findall("joint"))
    if not links:
        raise UrdfError("the URDF has no links", where=where)
    for kind, names in (("links", links), ("joints", joints)):
        repeated = [name for name, count in Counter(names).items() if count > 1]
        if repeated:
            raise UrdfError(f"{kind} share a name", where=where, found=", ".join(repeated), allowed="each name once")
    return Arm(robot, _root_link(robot, links, where), links, joints, source)


def _robot_element(text: str, where: str) -> Element:
    parser = etree.XMLParser(remove_blank_text=True, resolve_entities=False, encoding="utf-8")
    try:
        robot = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        raise UrdfError("the URDF file is not well-formed XML", where=where, found=str(error)) from error
    if robot.tag != "robot":
        raise UrdfError("the file is not a URDF", where=where, found=f"root element <{robot.tag}>", allowed="<robot>")
    for element in robot.iter(etree.Element):
        macro = "xacro" in (etree.QName(element).namespace or "")
        if macro or any("${" in value for value in element.attrib.values()):
            raise UrdfError(
                "the URDF has xacro macros",
                where=f"{where}, line {element.sourceline}",
                found=f"<{etree.QName(element).localname}>",
                allowed="a plain URDF",
                hint="Expand the file with xacro first",
            )
    return robot


def _name_of(element: Element, where: str) -> str:
    name = element.get("name")
    if not name:
        raise UrdfError(f"a <{element.tag}> has no name", where=f"{where}, line {element.sourceline}")
    return str(name)


def _root_link(robot: Element, links: Sequence[str], where: str) -> str:
    """Find the link that all others hang from."""
    parents: dict[str, str] = {}
    for joint in robot.findall("joint"):
        ends = []
        for end in ("parent", "child"):
            element = joint.find(end)
            name = None if element is None else element.get("link")
            if name not in links:
                problem = f"the {end} of joint {joint.get('name')!r} is not a link of the robot"
                raise UrdfError(problem, where=where, found=name or "none", allowed=", ".join(links))
            ends.append(str(name))
        parent, child = ends
        if child in parents:
            raise UrdfError(
                "the links do not form one tree",
                where=where,
                found=f"link {child!r} is the child of two joints",
                allowed="one joint above every link",
            )
        parents[child] = parent
    roots = [name for name in links if name not in parents]
    if len(roots) != 1 or not all(_reaches(name, roots[0], parents) for name in links):
        raise UrdfError(
            "the links do not form one tree", where=where, found=f"root links: {', '.join(roots) or 'none'}"
        )
    return roots[0]


def _reaches(link: str, root: str, parents: dict[str, str]) -> bool:
    """Whether the joints above `link` lead to `root` and not round a loop."""
    for _ in range(len(parents)):
        if link == root:
            return True
        link = parents[link]
    return link == root


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
    """Make relative mesh and texture files, which lie relative to `source`, relative to the folder of `target`.

    Without `target` they become absolute. Absolute files and those with a scheme (``package://``) stay as they are.
    """
    old = source.parent.resolve()
    new = None if target is None else target.parent.resolve()
    for element in robot.iter("mesh", "texture"):
        name = element.get("filename")
        if not name or "://" in name or Path(name).is_absolute():
            continue
        path = old / name
        element.set("filename", os.path.normpath(path) if new is None else os.path.relpath(path, new))


def check_composed(text: str, joint: str, where: str) -> None:
    """Refuse what yourdfpy cannot read, and bodies below `joint` that cannot be.

    On a moving axis even the inertia of the arm's root link counts, which no joint moved before.

    Raises
    ------
    UrdfError
    """
    import yourdfpy  # noqa: PLC0415  (imports trimesh: one second)

    try:
        urdf = yourdfpy.URDF.load(
            io.BytesIO(text.encode()), build_scene_graph=False, build_collision_scene_graph=False, load_meshes=False
        )
    except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
        raise UrdfError("the URDF cannot be read", where=where, found=f"{type(error).__name__}: {error}") from error
    parents = {each.child: each for each in urdf.robot.joints}
    check_inertias(urdf, [each for each in urdf.robot.joints if each.name == joint], parents, where)
