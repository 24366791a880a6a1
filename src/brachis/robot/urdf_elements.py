"""The elements of a URDF: well-formed XML without macros, names that are there once, joints between them, one tree.

Every number of a URDF that counts is one, and finite: parsers further on drop an inertia with a NaN in silence.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from lxml import etree

from brachis.errors import UrdfError, nearest

Element: TypeAlias = Any  # lxml comes without types
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_SHOWN = 20
"""Characters of a file that is not a URDF."""
_EXPAND = "Expand the file with xacro first: xacro robot.xacro > robot.urdf"


@dataclass(frozen=True)
class UrdfTree:
    """A URDF as XML, so that messages can name an element and its line.

    Attributes
    ----------
    robot : lxml element
        The ``<robot>`` element.
    links, joints : mapping of str to lxml element
        By name, in the order of the file.
    above : mapping of str to str
        For every link but the root the name of the joint that it hangs from.
    root : str
        The link that hangs from no joint.
    """

    robot: Element
    links: Mapping[str, Element]
    joints: Mapping[str, Element]
    above: Mapping[str, str]
    root: str


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
        The text is not XML or not a URDF; xacro macros are left in it; a link or joint has no name or that of another
        one; a joint has no known type, or hangs from or holds a link that is not there; the links are not one tree; a
        number is missing or wrong, or an element is there twice. The message names file, line, and link or joint.
    """
    robot = _robot_element(text, where)
    links, joints = _by_name(robot, "link", where), _by_name(robot, "joint", where)
    if not links:
        raise UrdfError("the URDF has no links", where=where)
    for name, joint in joints.items():
        _check_type(name, joint.get("type"), where)
    above = _joints_above(links, joints, where)
    root = _root(links, joints, above, where)
    tree = UrdfTree(robot, links, joints, above, root)
    _check_numbers(tree, where)
    return tree


def place_of(element: Element, where: str) -> str:
    """Say where an element is: the file, its line, and the link or joint that it is part of."""
    text = f"{where}, line {element.sourceline}"
    owners = (
        each
        for each in (element, *element.iterancestors())
        if each.tag in ("link", "joint")
    )
    owner = next(owners, None)
    return text if owner is None else f"{text}: {owner.tag} {owner.get('name')!r}"


def end_of(joint: Element, end: str) -> str | None:
    """Name of the link at a joint's ``parent`` or ``child`` end; None where none is named."""
    element = joint.find(end)
    return None if element is None else element.get("link")


def _robot_element(text: str, where: str) -> Element:
    """Parse the text, and refuse what is no expanded URDF."""
    if not text.lstrip("\ufeff\t\r\n ").startswith("<"):
        raise UrdfError(
            "the file is not a URDF",
            where=where,
            found=f"{text[:_SHOWN]!r} at its beginning",
            allowed="XML, with the root element <robot>",
            hint="brachis inspect takes a URDF, the name of a robot, or a task file (.yaml)",
        )
    parser = etree.XMLParser(
        remove_blank_text=True, resolve_entities=False, encoding="utf-8"
    )
    try:
        robot = etree.fromstring(text.encode("utf-8", "surrogatepass"), parser)
    except etree.XMLSyntaxError as error:
        hint = _EXPAND if "xacro" in str(error) else None
        raise UrdfError(
            "the URDF file is not well-formed XML",
            where=where,
            found=str(error),
            hint=hint,
        ) from error
    if robot.tag != "robot":
        raise UrdfError(
            "the file is not a URDF",
            where=where,
            found=f"root element <{robot.tag}>",
            allowed="<robot>",
            hint=_EXPAND,
        )
    for element in robot.iter(etree.Element):
        macro = "xacro" in (etree.QName(element).namespace or "") or str(
            element.tag
        ).startswith("xacro:")
        expression = next(
            (
                f"{key}={value!r}"
                for key, value in element.attrib.items()
                if "${" in value
            ),
            None,
        )
        if macro or expression:
            prefix = f"{element.prefix}:" if element.prefix else ""
            shown = f"<{prefix}{etree.QName(element).localname}{' ' + expression if expression else ''}>"
            raise UrdfError(
                "the URDF has xacro macros",
                where=place_of(element, where),
                found=shown,
                allowed="a plain URDF",
                hint=_EXPAND,
            )
    return robot


def _by_name(robot: Element, kind: str, where: str) -> dict[str, Element]:
    """Links or joints by their names."""
    elements = robot.findall(kind)
    for element in elements:
        if not element.get("name"):
            raise UrdfError(
                f"a <{kind}> has no name", where=f"{where}, line {element.sourceline}"
            )
    names = Counter(str(element.get("name")) for element in elements)
    repeated = [name for name, count in names.items() if count > 1]
    if repeated:
        raise UrdfError(
            f"{kind}s share a name",
            where=where,
            found=", ".join(repeated),
            allowed="each name once",
        )
    return {str(element.get("name")): element for element in elements}


def _check_type(name: str, kind: str | None, where: str) -> None:
    if kind in JOINT_TYPES:
        return
    near = nearest(kind or "", JOINT_TYPES)
    raise UrdfError(
        f"joint {name!r} has no known type",
        where=where,
        found=repr(kind) if kind else "none",
        allowed=", ".join(JOINT_TYPES),
        hint=f"Did you mean {near!r}?" if near else None,
    )


def _joints_above(
    links: Mapping[str, Element], joints: Mapping[str, Element], where: str
) -> dict[str, str]:
    """Find the joint that every link hangs from."""
    above: dict[str, str] = {}
    for name, joint in joints.items():
        for end in ("parent", "child"):
            link = end_of(joint, end)
            if link not in links:
                near = nearest(link or "", links)
                raise UrdfError(
                    f"the {end} of joint {name!r} is not a link of the robot",
                    where=f"{where}, line {joint.sourceline}",
                    found=link or "none",
                    allowed=", ".join(links),
                    hint=f"Did you mean {near!r}?"
                    if near
                    else f"Add <link name={link!r}/>"
                    if link
                    else None,
                )
        child = str(end_of(joint, "child"))
        if child in above:
            raise UrdfError(
                "the links do not form one tree",
                where=where,
                found=f"link {child!r} is the child of two joints, {above[child]!r} and {name!r}",
                allowed="one joint above every link",
            )
        above[child] = name
    return above


def _root(
    links: Mapping[str, Element],
    joints: Mapping[str, Element],
    above: Mapping[str, str],
    where: str,
) -> str:
    """Find the only link that hangs from no joint."""
    roots = [name for name in links if name not in above]
    if len(roots) != 1:
        raise UrdfError(
            "the links do not form one tree",
            where=where,
            found=f"root links: {', '.join(roots) or 'none'}",
            allowed="one link without a joint above it",
        )
    below: dict[str | None, list[str]] = {}
    for child, joint in above.items():
        below.setdefault(end_of(joints[joint], "parent"), []).append(child)
    reached, waiting = set(roots), list(roots)
    while waiting:
        found = below.get(waiting.pop(), [])
        reached.update(found)
        waiting += found
    if len(reached) < len(links):
        looped = ", ".join(name for name in links if name not in reached)
        raise UrdfError(
            "the links do not form one tree",
            where=where,
            found=f"a loop of links: {looped}",
        )
    return roots[0]


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_LARGEST = 1e12
"""No length, mass or inertia of a robot is larger, in SI units; squares of such figures are still numbers."""


@dataclass(frozen=True)
class Entry:
    """An attribute that holds numbers.

    Attributes
    ----------
    path : str
        Element below the link or joint.
    attribute : str
    unit : str
    count : int, optional
        How many numbers, separated by spaces.
    required : bool, optional
        Whether the attribute has to be there where the element is.
    largest : float, optional
        Largest magnitude.
    """

    path: str
    attribute: str
    unit: str
    count: int = 1
    required: bool = False
    largest: float = _LARGEST


ENTRIES: dict[str, tuple[Entry, ...]] = {
    "link": (
        Entry("inertial/origin", "xyz", "m", 3),
        Entry("inertial/origin", "rpy", "rad", 3),
        Entry("inertial/mass", "value", "kg", required=True),
        *(
            Entry("inertial/inertia", moment, "kg m^2", required=True)
            for moment in ("ixx", "iyy", "izz")
        ),
        *(
            Entry("inertial/inertia", product, "kg m^2")
            for product in ("ixy", "ixz", "iyz")
        ),
    ),
    "joint": (
        Entry("origin", "xyz", "m", 3),
        Entry("origin", "rpy", "rad", 3),
        Entry("axis", "xyz", "a direction", 3),
        Entry("limit", "lower", "rad or m", largest=math.inf),
        Entry("limit", "upper", "rad or m", largest=math.inf),
        Entry("limit", "velocity", "rad/s or m/s", largest=math.inf),
        Entry("limit", "effort", "Nm or N", largest=math.inf),
        Entry("mimic", "multiplier", "a factor"),
        Entry("mimic", "offset", "rad or m"),
        Entry("dynamics", "damping", "Nm s/rad or N s/m"),
        Entry("dynamics", "friction", "Nm or N"),
    ),
}
"""All that is read from links and joints, and what a number there means."""


def _check_numbers(tree: UrdfTree, where: str) -> None:
    """Refuse what is not a finite number, at links and joints off the chain as well."""
    for kind, owners in (("link", tree.links), ("joint", tree.joints)):
        paths = dict.fromkeys(entry.path.split("/")[0] for entry in ENTRIES[kind])
        for owner in owners.values():
            for path in paths:
                _check_single(owner.findall(path), where)
            for entry in ENTRIES[kind]:
                _check_entry(owner, entry, where)


def numbers_of(
    owner: Element, path: str, attribute: str, absent: str
) -> tuple[float, ...]:
    """Numbers of a checked attribute of a link or joint; those of `absent` where it is not there."""
    element = owner.find(path)
    text = absent if element is None else element.get(attribute, absent)
    return tuple(float(word) for word in text.split())


def number_of(owner: Element, path: str, attribute: str) -> float | None:
    """Return the number of a checked attribute of a link or joint; None if it is absent."""
    numbers = numbers_of(owner, path, attribute, "")
    return numbers[0] if numbers else None


def _check_single(elements: list[Element], where: str) -> None:
    if len(elements) > 1:
        raise UrdfError(
            f"<{elements[1].tag}> is there twice",
            where=place_of(elements[1], where),
            allowed="one, or none",
        )


def _check_entry(owner: Element, entry: Entry, where: str) -> None:
    """Check one attribute of a link or joint."""
    elements = owner.findall(entry.path)
    _check_single(elements, where)
    if not elements:
        return
    text = elements[0].get(entry.attribute)
    if text is None and not entry.required:
        return
    words = [] if text is None else text.split()
    if len(words) == entry.count and all(
        _is_number(word, entry.largest) for word in words
    ):
        return
    tag = entry.path.rsplit("/", 1)[-1]
    kind = (
        "a finite number"
        if entry.count == 1
        else f"{entry.count} finite numbers separated by spaces"
    )
    bound = (
        f", at most {entry.largest:g} in size" if math.isfinite(entry.largest) else ""
    )
    raise UrdfError(
        f"<{tag} {entry.attribute}> is missing"
        if text is None
        else f"<{tag} {entry.attribute}> is wrong",
        where=place_of(elements[0], where),
        found=None if text is None else f'{entry.attribute}="{text}"',
        allowed=f"{kind}, {entry.unit}{bound}",
        hint=_instead(text or "", entry),
    )


def _is_number(word: str, largest: float) -> bool:
    return (
        _NUMBER.fullmatch(word) is not None
        and math.isfinite(float(word))
        and abs(float(word)) <= largest
    )


def _instead(text: str, entry: Entry) -> str | None:
    """Say what to write instead: spaces for separating commas, points for decimal ones, no units."""
    spaced = text.replace(",", " ").replace(";", " ").split()
    pointed = text.replace(",", ".").split()
    for words in (spaced, pointed):
        if len(words) == entry.count and all(
            _is_number(word, entry.largest) for word in words
        ):
            return f'Write {entry.attribute}="{" ".join(words)}"'
    bare = [match.group() for match in _NUMBER.finditer(text)]
    if len(bare) == entry.count:
        return f'Write numbers alone, in {entry.unit}, such as {entry.attribute}="{" ".join(bare)}"'
    return None
