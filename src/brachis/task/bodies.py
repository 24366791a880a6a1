"""Bodies of a scene for programs: ``scene=[brachis.Box([0.1, 0.1, 1.2], position=[0.5, 0.2, 0.6])]``.

All lengths are in m, angles in degrees. A body is fixed to the world, or to the link of the robot that ``link`` names.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TypedDict, Unpack

from brachis.task.messages import validate
from brachis.task.scene import SceneBody


class Where(TypedDict, total=False):
    """Keywords of every body, in addition to those of its shape."""

    name: str
    """Unique name; by default the shape and number of the body in the scene."""
    link: str
    """Link of the robot that carries the body; by default the body stands still."""
    frame: str
    """Frame of the task in which the body is placed; by default the world."""
    position: Sequence[float]
    """Position in the world, in its frame, or in the frame of its link, m."""
    rpy_deg: Sequence[float]
    """Roll, pitch and yaw about fixed axes, degrees."""


def Box(size: Sequence[float], **where: Unpack[Where]) -> SceneBody:  # noqa: N802
    """Make a box from its lengths along x, y and z, m. For `where` see `Where`.

    Examples
    --------
    >>> import brachis
    >>> brachis.Box([0.1, 0.1, 1.2], position=[0.5, 0.2, 0.6])
    SceneBody(box=[0.1, 0.1, 1.2], position=[0.5, 0.2, 0.6])
    """
    return validate(SceneBody, {"box": size, **where}, "Box")


def Sphere(radius: float, **where: Unpack[Where]) -> SceneBody:  # noqa: N802
    """Make a ball of given radius, m. For `where` see `Where`.

    Examples
    --------
    >>> import brachis
    >>> brachis.Sphere(0.04, position=[0.35, 0.16, 0.53])
    SceneBody(sphere=0.04, position=[0.35, 0.16, 0.53])
    """
    return validate(SceneBody, {"sphere": radius, **where}, "Sphere")


def Cylinder(radius: float, length: float, **where: Unpack[Where]) -> SceneBody:  # noqa: N802
    """Make a cylinder about the z axis, centred at the origin; lengths in m. For `where` see `Where`.

    Examples
    --------
    >>> import brachis
    >>> brachis.Cylinder(0.05, 1.2, name="post").shape
    'cylinder'
    """
    shape = {"radius": radius, "length": length}
    return validate(SceneBody, {"cylinder": shape, **where}, "Cylinder")


def Capsule(radius: float, length: float, **where: Unpack[Where]) -> SceneBody:  # noqa: N802
    """Make a cylinder with round caps; its length, m, excludes the caps. For `where` see `Where`.

    Examples
    --------
    >>> import brachis
    >>> brachis.Capsule(0.03, 0.3, link="tool0", position=[0, 0, 0.15]).link
    'tool0'
    """
    shape = {"radius": radius, "length": length}
    return validate(SceneBody, {"capsule": shape, **where}, "Capsule")


def HalfSpace(  # noqa: N802
    normal: Sequence[float], offset: float = 0.0, **where: Unpack[Where]
) -> SceneBody:
    """Make the space behind a plane, such as a floor.

    Parameters
    ----------
    normal : sequence of float
        Direction out of the half-space, of any length.
    offset : float, optional
        Distance of the plane from the origin along the normal, m.
    **where
        See `Where`: only ``name`` and ``frame`` are possible.

    Examples
    --------
    >>> import brachis
    >>> brachis.HalfSpace([0, 0, 1], offset=-0.1).half_space.offset
    -0.1
    """
    shape = {"normal": normal, "offset": offset}
    return validate(SceneBody, {"half_space": shape, **where}, "HalfSpace")


def Mesh(  # noqa: N802
    file: str | PathLike[str], scale: float = 1.0, **where: Unpack[Where]
) -> SceneBody:
    """Make the convex hull of a mesh file; `scale` converts the unit of the mesh to m. For `where` see `Where`.

    Examples
    --------
    >>> import brachis
    >>> brachis.Mesh("body.stl", scale=0.001, name="body").mesh
    'body.stl'
    """
    return validate(SceneBody, {"mesh": file, "scale": scale, **where}, "Mesh")
