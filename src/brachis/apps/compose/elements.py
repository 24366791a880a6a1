"""Pieces of a URDF as XML elements. SI units; numbers are written so that they read back unchanged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

from lxml import etree

Element: TypeAlias = Any  # lxml comes without types
Shape = Mapping[str, float | Sequence[float]]

ZERO = (0.0, 0.0, 0.0)
GREY = (0.35, 0.38, 0.42, 1.0)


def numbers(values: Iterable[float]) -> str:
    """Shortest text from which the same numbers are read again."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def box_inertia(mass: float, size: Sequence[float]) -> tuple[float, ...]:
    """Inertia of a solid box with sides `size`, m, about its centre: ixx, ixy, ixz, iyy, iyz, izz, kg m^2."""
    x, y, z = (side**2 for side in size)
    return mass * (y + z) / 12, 0.0, 0.0, mass * (x + z) / 12, 0.0, mass * (x + y) / 12


def link(name: str, *parts: Element) -> Element:
    """Make a link of `inertial` and `visual` elements."""
    element = etree.Element("link", name=name)
    element.extend(parts)
    return element


def inertial(
    mass: float,
    com: Sequence[float],
    inertia: Sequence[float],
    rpy: Sequence[float] = ZERO,
) -> Element:
    """Make an inertia: mass, centre of mass, and ixx, ixy, ixz, iyy, iyz, izz about the centre of mass.

    `rpy` turns the axes of the inertia against the link frame.
    """
    element = etree.Element("inertial")
    _origin(element, com, rpy)
    etree.SubElement(element, "mass", value=numbers([mass]))
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    etree.SubElement(
        element,
        "inertia",
        {key: numbers([value]) for key, value in zip(keys, inertia, strict=True)},
    )
    return element


def visual(
    shape: str,
    size: Shape,
    colour: tuple[str, Sequence[float]],
    *,
    xyz: Sequence[float] = ZERO,
    rpy: Sequence[float] = ZERO,
) -> Element:
    """Make a primitive for drawing.

    Parameters
    ----------
    shape : str
        ``box``, ``cylinder`` (along its z axis) or ``sphere``.
    size : mapping
        Its attributes, m: ``size`` of a box, ``radius`` and ``length`` of a cylinder, ``radius`` of a sphere.
    colour : tuple
        Name of the material, and red, green, blue and opacity in [0, 1].
    xyz, rpy : (3,) sequence of float
        Placement of its centre in the link frame, m and rad.
    """
    element = etree.Element("visual")
    _origin(element, xyz, rpy)
    attributes = {
        key: numbers([each] if isinstance(each, (int, float)) else each)
        for key, each in size.items()
    }
    etree.SubElement(etree.SubElement(element, "geometry"), shape, attributes)
    name, rgba = colour
    etree.SubElement(
        etree.SubElement(element, "material", name=name), "color", rgba=numbers(rgba)
    )
    return element


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    *,
    xyz: Sequence[float] = ZERO,
    rpy: Sequence[float] = ZERO,
    axis: Sequence[float] | None = None,
    limit: Mapping[str, float] | None = None,
) -> Element:
    """Make a joint of type `kind`; a moving one has an `axis` and a `limit` (lower, upper, velocity, effort)."""
    element = etree.Element("joint", name=name, type=kind)
    etree.SubElement(element, "parent", link=parent)
    etree.SubElement(element, "child", link=child)
    _origin(element, xyz, rpy)
    if axis is not None:
        etree.SubElement(element, "axis", xyz=numbers(axis))
    if limit is not None:
        etree.SubElement(
            element, "limit", {key: numbers([value]) for key, value in limit.items()}
        )
    return element


def robot_text(robot: Element) -> str:
    """Text of a ``<robot>`` element and of the comments before it, indented."""
    etree.cleanup_namespaces(robot)
    etree.indent(robot, "  ")
    comments = list(robot.itersiblings(etree.Comment, preceding=True))[::-1]
    parts = [
        etree.tostring(each, encoding="unicode", with_tail=False)
        for each in (*comments, robot)
    ]
    return "\n".join(['<?xml version="1.0"?>', *parts, ""])


def _origin(element: Element, xyz: Sequence[float], rpy: Sequence[float]) -> None:
    """Add ``<origin>``, unless it would say nothing."""
    parts = {"xyz": xyz, "rpy": rpy} if any(rpy) else {"xyz": xyz}
    if any(xyz) or any(rpy):
        etree.SubElement(
            element, "origin", {key: numbers(value) for key, value in parts.items()}
        )
