"""Solids: convex bodies of the scene, from the task, and of a robot's links, from ``<collision>`` in the URDF.

A mesh is replaced by its convex hull.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from brachis.common.arguments import check_most
from brachis.common.files import mesh_file, read_text
from brachis.errors import InputError, TaskError, UrdfError
from brachis.robot.urdf_bodies import origin_of, placement_matrix
from brachis.robot.urdf_elements import Element, UrdfTree, end_of, numbers_of, read_tree
from brachis.task.scene import Round, SceneBody

_LARGEST = 1e4
"""Maximum radius of a ball around a body, m.

Distances from a rod of 100 km have errors above 0.1 mm, so plans close to such a rod cannot be verified. Close to a rod
of 10 km, they can.
"""
_LARGEST_FILE = 32.0
"""Maximum size of a mesh file, MB. For a file of this size, computing the hull takes 20 s and 0.8 GB of memory."""
_HULL = (True, "Qt")
"""Arguments for computing the hull: whether to keep the triangles, and the options of Qhull."""
_THICKNESS = 0.02
"""Radius of capsules along links, as a fraction of the total length of all links."""
Geometry = Any  # coal has no type annotations


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex body in the frame that carries it.

    Attributes
    ----------
    name : str
    link : str or None
        Link that carries the solid; None if it is fixed to the world.
    geometry : coal.CollisionGeometry
    placement : (4, 4) ndarray
        Placement in the frame of the link, or in the world.
    padding : float
        Distance by which the solid is larger than its geometry, m.
    """

    name: str
    link: str | None
    geometry: Geometry
    placement: np.ndarray
    padding: float = 0.0

    def __post_init__(self) -> None:
        """Apply the padding to the geometry, and check its size.

        Raises
        ------
        InputError
            The solid is too large.
        """
        self.geometry.setSweptSphereRadius(self.padding)
        self.geometry.computeLocalAABB()
        if not isinstance(self.geometry, coal.Halfspace):
            problem = "the body is too large for exact distances"
            check_most(self.radius, _LARGEST, "m", problem, self.name)

    @property
    def radius(self) -> float:
        """Radius of the ball around the solid, m; infinite for a half-space."""
        # Coal leaves out the padding in the ball around a sphere.
        return self.geometry.aabb_radius + self.padding


def build_solids(body: SceneBody, frame: np.ndarray) -> Iterator[Solid]:
    """Build the solids of a body of the scene: one solid, or all of its URDF. `frame`, (4, 4), is the body's frame.

    Raises
    ------
    TaskError
        A mesh or a URDF cannot be read.
    UrdfError
        A shape of a URDF cannot be read.
    """
    if body.urdf is None:
        yield _build_solid(body, frame)
        return
    where = f"scene: {body.name}: {body.urdf}"
    path = Path(body.urdf)
    tree = read_tree(read_text(path, where=where, folder=Path.cwd()), where)
    placed = {tree.downward[0]: frame @ placement_matrix(body.placement)}
    for link in tree.downward[1:]:
        joint = tree.joints[tree.above[link]]
        if joint.get("type") != "fixed":
            raise TaskError(
                "a joint of the cell can move",
                where=where,
                found=f"joint {joint.get('name')!r} of type {joint.get('type')}",
                allowed="fixed joints",
                hint="Fix the joint, or leave out the links that it moves",
            )
        placed[link] = placed[end_of(joint, "parent")] @ origin_of(joint, "origin")
    solids = list(read_solids(tree, path.absolute().parent, {}))
    if not solids:
        raise TaskError(
            "the cell has no collision geometry",
            where=where,
            found="no <collision>",
            allowed="a URDF with <collision> elements",
        )
    for solid in solids:
        placement = placed[str(solid.link)] @ solid.placement
        name = f"{body.name}: {solid.name}"
        yield Solid(name, body.link, solid.geometry, placement)


def _build_solid(body: SceneBody, frame: np.ndarray) -> Solid:
    shape = getattr(body, body.shape)
    placement = frame @ placement_matrix(body.placement)
    if body.half_space is not None:
        # The plane of a half-space is given in the world frame.
        normal = frame[:3, :3] @ shape.normal / np.linalg.norm(shape.normal)
        geometry = coal.Halfspace(normal, shape.offset + normal @ frame[:3, 3])
        placement = np.eye(4)
    elif body.mesh is not None:
        try:
            geometry = _hull(Path(shape), np.full(3, body.scale))
        except InputError as error:
            raise TaskError(str(error), where=f"scene: {body.name}") from error
    else:
        is_round = isinstance(shape, Round)
        lengths = (shape.radius, shape.length) if is_round else np.ravel(shape)
        geometry = _SHAPES[body.shape][0](*lengths)
    return Solid(str(body.name), body.link, geometry, placement)


def read_solids(
    tree: UrdfTree, folder: Path, padding: Mapping[str, float]
) -> Iterator[Solid]:
    """Build the solids of a URDF's links, each enlarged by the padding of its link, m.

    Raises
    ------
    UrdfError
        A shape cannot be read.
    """
    for name, link in tree.links.items():
        collisions = link.findall("collision")
        for number, collision in enumerate(collisions):
            label = f"{name} {number}" if len(collisions) > 1 else name
            try:
                geometry = _geometry(collision, folder)
            except (InputError, ValueError) as error:
                raise UrdfError(
                    f"the collision geometry cannot be read: {error}",
                    where=f"link {name!r}",
                ) from error
            placement = origin_of(collision, "origin")
            yield Solid(label, name, geometry, placement, padding.get(name, 0.0))


def build_capsules(tree: UrdfTree, padding: Mapping[str, float]) -> Iterator[Solid]:
    """Build capsules from each link's joint to its child joints; the radius is a fraction of the total length."""
    ends = [
        (end_of(joint, "parent"), origin_of(joint, "origin")[:3, 3])
        for joint in tree.joints.values()
    ]
    thick = _THICKNESS * sum(np.linalg.norm(end) for _, end in ends)
    for number, (link, end) in enumerate(ends):
        length = np.linalg.norm(end)
        if length <= thick:
            continue
        geometry = coal.Capsule(thick, length)
        placement = np.eye(4)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end)
        placement[:3, :3] = turn.matrix()
        placement[:3, 3] = 0.5 * end
        yield Solid(
            f"{link} {number}", link, geometry, placement, padding.get(link, 0.0)
        )


def _geometry(collision: Element, folder: Path) -> Geometry:
    """Read the geometry of a ``<collision>`` element."""
    known = (*_SHAPES, "mesh")
    shapes = [
        element
        for element in collision.iterfind("geometry[1]/*")
        if element.tag in known
    ]
    if len(shapes) != 1:
        raise InputError(
            "<geometry> must contain exactly one known shape",
            found=f"{len(shapes)} of them",
            allowed=", ".join(known),
        )
    (shape,) = shapes
    if shape.tag == "mesh":
        name = str(shape.get("filename"))
        path = mesh_file(name, folder)
        if path is None:
            raise InputError("the mesh file is missing", where=name)
        return _hull(path, np.array(numbers_of(shape, ".", "scale", "1 1 1")))
    kind, attributes, count = _SHAPES[shape.tag]
    return kind(*_lengths(shape, attributes, count))


_SHAPES: dict[str, tuple[Any, tuple[str, ...], int]] = {
    "box": (coal.Box, ("size",), 3),
    "sphere": (coal.Sphere, ("radius",), 1),
    "cylinder": (coal.Cylinder, ("radius", "length"), 2),
    "capsule": (coal.Capsule, ("radius", "length"), 2),
}
"""For every shape except meshes: the class, the attributes that hold lengths, and the total number of lengths."""


def _lengths(shape: Element, attributes: tuple[str, ...], count: int) -> list[float]:
    """Read `count` lengths from attributes."""
    words = " ".join(shape.get(attribute, "") for attribute in attributes).split()
    try:
        lengths = [float(word) for word in words]
    except ValueError:
        lengths = []
    if len(lengths) != count or not all(0.0 < length < np.inf for length in lengths):
        raise InputError(
            f"<{shape.tag}> is wrong",
            found=" ".join(words) or "nothing",
            allowed=f"{count} numbers > 0, m, under {' and '.join(attributes)}",
        )
    return lengths


def _hull(path: Path, scale: np.ndarray) -> Geometry:
    """Return the convex hull of a mesh file."""
    if not path.is_file():
        raise InputError("the mesh file does not exist", where=str(path))
    hint = "Only the mesh's convex hull is used: reduce the mesh to fewer triangles"
    size = path.stat().st_size / 1e6
    check_most(size, _LARGEST_FILE, "MB", "the mesh file is too large", str(path), hint)
    try:
        mesh = coal.MeshLoader(coal.NODE_TYPE.BV_AABB).load(str(path), scale)
        mesh.buildConvexHull(*_HULL)
    except (ValueError, RuntimeError) as error:
        raise InputError(
            "the mesh cannot be read", where=str(path), hint="Write it as STL or OBJ"
        ) from error
    return mesh.convex
