"""Every number of a URDF that counts is one, and finite: parsers further on drop an inertia with a NaN in silence."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from brachis.errors import UrdfError
from brachis.robot.urdf_tree import Element, UrdfTree, place_of

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
        *(Entry("inertial/inertia", moment, "kg m^2", required=True) for moment in ("ixx", "iyy", "izz")),
        *(Entry("inertial/inertia", product, "kg m^2") for product in ("ixy", "ixz", "iyz")),
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


def check_numbers(tree: UrdfTree, where: str) -> None:
    """Refuse what is no finite number, at links and joints off the chain as well.

    Parameters
    ----------
    tree : UrdfTree
    where : str
        Name of the file, for messages.

    Raises
    ------
    UrdfError
        Names file, line, link or joint, and what to write instead; or an element is there twice.
    """
    for kind, owners in (("link", tree.links), ("joint", tree.joints)):
        paths = dict.fromkeys(entry.path.split("/")[0] for entry in ENTRIES[kind])
        for owner in owners.values():
            for path in paths:
                _check_single(owner.findall(path), where)
            for entry in ENTRIES[kind]:
                _check_entry(owner, entry, where)


def numbers_of(owner: Element, path: str, attribute: str, absent: str) -> tuple[float, ...]:
    """Numbers of a checked attribute of a link or joint; those of `absent` where it is not there."""
    element = owner.find(path)
    text = absent if element is None else element.get(attribute, absent)
    return tuple(float(word) for word in text.split())


def _check_single(elements: list[Element], where: str) -> None:
    if len(elements) > 1:
        raise UrdfError(
            f"<{elements[1].tag}> is there twice", where=place_of(elements[1], where), allowed="one, or none"
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
    if len(words) == entry.count and all(_is_number(word, entry.largest) for word in words):
        return
    tag = entry.path.rsplit("/", 1)[-1]
    kind = "a finite number" if entry.count == 1 else f"{entry.count} finite numbers separated by spaces"
    bound = f", at most {entry.largest:g} in size" if math.isfinite(entry.largest) else ""
    raise UrdfError(
        f"<{tag} {entry.attribute}> is missing" if text is None else f"<{tag} {entry.attribute}> is wrong",
        where=place_of(elements[0], where),
        found=None if text is None else f'{entry.attribute}="{text}"',
        allowed=f"{kind}, {entry.unit}{bound}",
        hint=_instead(text or "", entry),
    )


def _is_number(word: str, largest: float) -> bool:
    return _NUMBER.fullmatch(word) is not None and math.isfinite(float(word)) and abs(float(word)) <= largest


def _instead(text: str, entry: Entry) -> str | None:
    """Say what to write instead: spaces for separating commas, points for decimal ones, no units."""
    spaced = text.replace(",", " ").replace(";", " ").split()
    pointed = text.replace(",", ".").split()
    for words in (spaced, pointed):
        if len(words) == entry.count and all(_is_number(word, entry.largest) for word in words):
            return f'Write {entry.attribute}="{" ".join(words)}"'
    bare = [match.group() for match in _NUMBER.finditer(text)]
    if len(bare) == entry.count:
        return f'Write numbers alone, in {entry.unit}, such as {entry.attribute}="{" ".join(bare)}"'
    return None
