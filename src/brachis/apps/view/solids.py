"""Meshes of the bodies of a scene, by the joint that moves them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import coal
import numpy as np

from brachis.scene import Solid, scene_of
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    import trimesh

    Meshes = dict[int, list[trimesh.Trimesh]]

_FLOOR = 4.0
"""Length and width of what is drawn of a half-space, m."""
_THIN = 0.002
"""Its thickness, m."""


def scene_meshes(trajectory: Trajectory) -> Meshes:
    """Make the meshes of the bodies of a task's scene, without the robot's own, in the frames of their joints, m."""
    task = trajectory.task
    found = scene_of(trajectory.robot, task)
    meshes: Meshes = {}
    if found is None:
        return meshes
    for number, solid in enumerate(found.solids[found.own :], found.own):
        mesh = _mesh_of(solid)
        mesh.apply_transform(found.placements[number])
        meshes.setdefault(int(found.joints[number]), []).append(mesh)
    return meshes


def _mesh_of(solid: Solid) -> trimesh.Trimesh:
    """Make the mesh of a solid in its own axes."""
    import trimesh

    shape = solid.geometry
    make = trimesh.creation
    if isinstance(shape, coal.Box):
        return make.box(2.0 * shape.halfSide)
    if isinstance(shape, coal.Sphere):
        return make.icosphere(radius=shape.radius)
    if isinstance(shape, coal.Cylinder):
        return make.cylinder(shape.radius, height=2.0 * shape.halfLength)
    if isinstance(shape, coal.Capsule):
        mesh = make.capsule(2.0 * shape.halfLength, shape.radius)
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        return mesh
    if isinstance(shape, coal.Halfspace):
        mesh = make.box([_FLOOR, _FLOOR, _THIN])
        turn = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], shape.n)
        mesh.apply_transform(turn)
        mesh.apply_translation(shape.n * (shape.d - 0.5 * _THIN))
        return mesh
    return trimesh.Trimesh(np.array(shape.points())).convex_hull
