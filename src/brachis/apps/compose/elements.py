"""Pieces of a URDF as XML elements. SI units; numbers are written so that they read back unchanged."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from lxml import etree

Element: TypeAlias = Any  # lxml comes without types
Shape = Mapping[str, float | Sequence[float]]

ZERO = (0.0, 0.0, 0.0)
GREY = (0.35, 0.38, 0.42, 1.0)


def make(
    tag: str, *children: Element, **attributes: str | float | Sequence[float]
) -> Element:
    """Make an element; numbers are written as the shortest text from which the same numbers are read again."""
    element = etree.Element(tag)
    for name, value in attributes.items():
        text = value
        if not isinstance(text, str):
            figures = np.array(value, dtype=float, ndmin=1) + 0.0
            text = " ".join(repr(float(each)).removesuffix(".0") for each in figures)
        element.set(name, text)
    element.extend(children)
    return element


def box_inertia(mass: float, size: Sequence[float]) -> tuple[float, ...]:
    """Inertia of a solid box with sides `size`, m, about its centre: ixx, ixy, ixz, iyy, iyz, izz, kg m^2."""
    x, y, z = (side**2 for side in size)
    return mass * (y + z) / 12, 0.0, 0.0, mass * (x + z) / 12, 0.0, mass * (x + y) / 12


def link(name: str, *parts: Element) -> Element:
    """Make a link of `inertial` and `visual` elements."""
    return make("link", *parts, name=name)


def inertial(
    mass: float,
    com: Sequence[float],
    inertia: Sequence[float],
    rpy: Sequence[float] = ZERO,
) -> Element:
    """Make an inertia: mass, centre of mass, and ixx, ixy, ixz, iyy, iyz, izz about the centre of mass.

    `rpy` turns the axes of the inertia against the link frame.
    """
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    return make(
        "inertial",
        *_origin(com, rpy),
        make("mass", value=mass),
        make("inertia", **dict(zip(keys, inertia, strict=True))),
    )


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
    name, rgba = colour
    return make(
        "visual",
        *_origin(xyz, rpy),
        make("geometry", make(shape, **size)),
        make("material", make("color", rgba=rgba), name=name),
    )


def collision(drawn: Element) -> Element:
    """Make the collision geometry that is what a visual shows."""
    return make(
        "collision", *(copy.deepcopy(part) for part in drawn if part.tag != "material")
    )


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
    element = make(
        "joint",
        make("parent", link=parent),
        make("child", link=child),
        *_origin(xyz, rpy),
        name=name,
        type=kind,
    )
    if axis is not None:
        element.append(make("axis", xyz=axis))
    if limit is not None:
        element.append(make("limit", **limit))
    return element


def robot_text(robot: Element) -> str:
    """Text of a ``<robot>`` element and of the comments around it, indented."""
    etree.cleanup_namespaces(robot)
    etree.indent(robot, "  ")
    tree = robot.getroottree()
    text = etree.tostring(tree, encoding="unicode", pretty_print=True)
    return f'<?xml version="1.0"?>\n{text}'


def _origin(xyz: Sequence[float], rpy: Sequence[float]) -> list[Element]:
    """Make an ``<origin>``, or nothing for the identity."""
    if any(rpy):
        return [make("origin", xyz=xyz, rpy=rpy)]
    return [make("origin", xyz=xyz)] if any(xyz) else []
