"""The elements of a URDF: well-formed XML without macros, with unique names, and with links that form one tree.

Every number that brachis uses must be finite: other parsers silently drop an inertia that contains a NaN.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

from lxml import etree

from brachis.errors import UrdfError, suggest
from brachis.task.fields import LARGEST

Element: TypeAlias = Any  # lxml comes without types
_JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_EXPAND = "Expand the file with xacro first: xacro robot.xacro > robot.urdf"


@dataclass(frozen=True)
class UrdfTree:
    """A URDF as XML, so that messages can name an element and its line.

    Attributes
    ----------
    robot : lxml element
        The ``<robot>`` element.
    links, joints : mapping of str to lxml element
        Links and joints by name, in the order of the file.
    above : mapping of str to str
        Name of the joint above each link, except for the root.
    downward : tuple of str
        All links, beginning with the root; each link comes after its parent.
    """

    robot: Element
    links: Mapping[str, Element]
    joints: Mapping[str, Element]
    above: Mapping[str, str]
    downward: tuple[str, ...]

    @property
    def root(self) -> str:
        """The link without a joint above it."""
        return self.downward[0]


def read_tree(text: str, where: str) -> UrdfTree:
    """Read the elements of a URDF, and check all numbers that brachis uses.

    Parameters
    ----------
    text : str
    where : str
        Name of the file, for messages.

    Raises
    ------
    UrdfError
        The text is not XML or not a URDF, or contains xacro macros; a link or joint has no name, or two have the same
        name; the type of a joint is unknown, or its parent or child link does not exist; the links do not form one
        tree; a number is missing or wrong; or an element occurs twice. The message names the file, the line, and the
        link or joint.
    """
    robot = _robot_element(text, where)
    links = _by_name(robot, "link", where)
    joints = _by_name(robot, "joint", where)
    if not links:
        raise UrdfError("the URDF has no links", where=where)
    for name, joint in joints.items():
        kind = joint.get("type") or "none"
        if kind not in _JOINT_TYPES:
            raise UrdfError(
                f"joint {name!r} has an unknown type",
                where=where,
                found=kind,
                allowed=", ".join(_JOINT_TYPES),
                hint=suggest(kind, _JOINT_TYPES),
            )
    above, downward = connect(links, joints, where)
    for kind, owners in (("link", links), ("joint", joints)):
        for owner in owners.values():
            for entry in ENTRIES[kind]:
                _check_entry(owner, entry, where)
    return UrdfTree(robot, links, joints, above, downward)


def _place_of(element: Element, where: str) -> str:
    """Return the place of an element: the file, the line, and the link or joint that contains it."""
    place = f"{where}, line {element.sourceline}"
    for ancestor in (element, *element.iterancestors()):
        if ancestor.tag in ("link", "joint"):
            return f"{place}: {ancestor.tag} {ancestor.get('name')!r}"
    return place


def end_of(joint: Element, end: str) -> str:
    """Return the name of the link at a joint's ``parent`` or ``child`` end; empty if none is named."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _robot_element(text: str, where: str) -> Element:
    """Parse the text, and refuse everything except an expanded URDF."""
    if not text.lstrip("\ufeff\t\r\n ").startswith("<"):
        raise UrdfError(
            "the file is not a URDF",
            where=where,
            found=f"{text[:20]!r} at its beginning",
            allowed="XML, with the root element <robot>",
            hint="Name a URDF, or a robot that comes with brachis: brachis robots lists them",
        )
    parser = etree.XMLParser(
        remove_blank_text=True, resolve_entities=False, encoding="utf-8", recover=True
    )
    robot = etree.fromstring(text.encode("utf-8", "surrogatepass"), parser)
    for entry in parser.error_log:
        # ROS reads an undeclared prefix of a tag, as in sensor:camera, as part of the name.
        if entry.type_name != "NS_ERR_UNDEFINED_NAMESPACE":
            raise UrdfError(
                "the URDF file is not well-formed XML",
                where=where,
                found=f"{entry.message}, line {entry.line}, column {entry.column}",
            )
    if robot.tag != "robot":
        raise UrdfError(
            "the file is not a URDF",
            where=where,
            found=f"root element <{robot.tag}>",
            allowed="<robot>",
            hint="Convert it to a URDF",
        )
    for element in robot.iter(etree.Element):
        name = re.split("[:}]", element.tag)[-1]
        expressions = [value for value in element.values() if "${" in value]
        if "xacro" in (element.prefix, name) or "xacro" in element.tag or expressions:
            raise UrdfError(
                "the URDF has xacro macros",
                where=_place_of(element, where),
                found=expressions[0] if expressions else f"<xacro:{name}>",
                allowed="a plain URDF",
                hint=_EXPAND,
            )
    return robot


def _by_name(robot: Element, kind: str, where: str) -> dict[str, Element]:
    """Return the links, or the joints, of a robot by their names."""
    named: dict[str, Element] = {}
    repeated: dict[str, None] = {}
    for element in robot.findall(kind):
        name = element.get("name")
        if not name:
            raise UrdfError(
                f"a <{kind}> has no name", where=f"{where}, line {element.sourceline}"
            )
        if name in named:
            repeated[name] = None
        named[name] = element
    if repeated:
        raise UrdfError(
            f"{kind}s have the same name",
            where=where,
            found=", ".join(repeated),
            allowed="each name once",
        )
    return named


def connect(
    links: Collection[str], joints: Mapping[str, Element], where: str
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the joint above each link except the root; and all links, each after its parent.

    Raises
    ------
    UrdfError
        A joint's link does not exist, or the links do not form one tree.
    """
    above: dict[str, str] = {}
    below: dict[str, list[str]] = {name: [] for name in links}
    flaws = []
    for name, joint in joints.items():
        for end in ("parent", "child"):
            link = end_of(joint, end)
            if link not in links:
                add = f"Add <link name={link!r}/>" if link else None
                raise UrdfError(
                    f"the {end} of joint {name!r} is not a link of the robot",
                    where=f"{where}, line {joint.sourceline}",
                    found=link or "no name",
                    allowed=", ".join(links),
                    hint=suggest(link, links) or add,
                )
        child = end_of(joint, "child")
        if child in above:
            both = f"{above[child]!r} and {name!r}"
            flaws.append(f"link {child!r} is the child of two joints, {both}")
        above[child] = name
        below[end_of(joint, "parent")].append(child)
    downward = [name for name in links if name not in above]
    if len(downward) != 1:
        flaws.append(f"root links: {', '.join(downward) or 'none'}")
    if not flaws:
        for link in downward:  # the list grows during the loop
            downward.extend(below[link])
        looped = set(links) - set(downward)
        if looped:
            names = ", ".join(name for name in links if name in looped)
            flaws.append(f"a loop of links: {names}")
    if flaws:
        raise UrdfError(
            "the links do not form one tree",
            where=where,
            found=flaws[0],
            allowed="one root link, and one joint above every other link",
        )
    return above, tuple(downward)


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True)
class Entry:
    """An attribute that contains numbers.

    Attributes
    ----------
    path : str
        Element below the link or joint.
    attribute : str
    unit : str
    count : int, optional
        Number of values, which are separated by spaces.
    required : bool, optional
        Whether the element must have the attribute.
    largest : float, optional
        Maximum magnitude.
    """

    path: str
    attribute: str
    unit: str
    count: int = 1
    required: bool = False
    largest: float = LARGEST


ENTRIES: dict[str, tuple[Entry, ...]] = {
    "link": (
        Entry("inertial/origin", "xyz", "m", 3),
        Entry("inertial/origin", "rpy", "rad", 3),
        Entry("inertial/mass", "value", "kg", required=True),
        *(
            Entry("inertial/inertia", key, "kg m^2", required=key[1] == key[2])
            for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        ),
    ),
    "joint": (
        Entry("origin", "xyz", "m", 3),
        Entry("origin", "rpy", "rad", 3),
        Entry("axis", "xyz", "a direction", 3),
        Entry("limit", "lower", "rad or m", largest=sys.float_info.max),
        Entry("limit", "upper", "rad or m", largest=sys.float_info.max),
        Entry("limit", "velocity", "rad/s or m/s", largest=sys.float_info.max),
        Entry("limit", "effort", "Nm or N", largest=sys.float_info.max),
        Entry("mimic", "multiplier", "a factor"),
        Entry("mimic", "offset", "rad or m"),
        Entry("dynamics", "damping", "Nm s/rad or N s/m"),
        Entry("dynamics", "friction", "Nm or N"),
        Entry("dynamics", "armature", "kg m^2 or kg"),
    ),
}
"""All attributes of links and joints that are read, with the meaning of their numbers."""


def numbers_of(
    owner: Element, path: str, attribute: str, absent: str
) -> tuple[float, ...]:
    """Return the numbers of a checked attribute of a link or joint; the numbers in `absent` if it is missing."""
    element = owner.find(path)
    text = absent if element is None else element.get(attribute, absent)
    return tuple(float(word) for word in text.split())


_Absent = TypeVar("_Absent", float, None)


def number_of(
    owner: Element, path: str, attribute: str, absent: _Absent
) -> float | _Absent:
    """Return the number of a checked attribute of a link or joint; `absent` if it is missing."""
    numbers = numbers_of(owner, path, attribute, "")
    return numbers[0] if numbers else absent


def _check_entry(owner: Element, entry: Entry, where: str) -> None:
    """Refuse an attribute of a link or joint that is not a finite number, or an element that occurs twice."""
    elements = [owner]
    for tag in entry.path.split("/"):
        elements = elements[0].findall(tag)
        if not elements:
            return
        if len(elements) > 1:
            raise UrdfError(
                f"<{tag}> occurs twice",
                where=_place_of(elements[1], where),
                allowed="not more than one",
            )
    text = elements[0].get(entry.attribute)
    if text is None and not entry.required:
        return
    words = (text or "").split()
    if len(words) == entry.count and all(
        _NUMBER.fullmatch(word) and abs(float(word)) <= entry.largest for word in words
    ):
        return
    finite = "a finite number"
    if entry.count > 1:
        finite = f"{entry.count} finite numbers separated by spaces"
    if entry.largest < sys.float_info.max:
        finite += f" of at most {entry.largest:g} in magnitude"
    hint = None
    if words:
        hint = "Write numbers with decimal points, spaces between them, and no units"
    raise UrdfError(
        f"<{tag} {entry.attribute}> is {'missing' if text is None else 'wrong'}",
        where=_place_of(elements[0], where),
        found=None if text is None else f'{entry.attribute}="{text}"',
        allowed=f"{finite}, {entry.unit}",
        hint=hint,
    )
