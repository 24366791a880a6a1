"""The scene of a task: bodies around the robot or carried by it, scene files, and the clearance between bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from brachis.common.files import absolute_path, read_text
from brachis.task.fields import (
    CheckedModel,
    Flag,
    Mistake,
    Model,
    Name,
    NonNegative,
    Number,
    Positive,
    Version,
    refuse,
)
from brachis.task.messages import validate
from brachis.task.orientation import Direction, Vector3
from brachis.task.settings import Placement
from brachis.task.yaml_reader import read_yaml

SHAPES = ("box", "sphere", "cylinder", "capsule", "half_space", "mesh", "urdf")
"""Keys of the shapes. A body has exactly one of these keys."""


class Round(Model):
    """A cylinder about the z axis, centred at the origin, or the cylindrical part of a capsule."""

    radius: Positive
    """Radius, m."""
    length: Positive
    """Length, m; that of a capsule excludes its caps."""


class HalfSpaceShape(Model):
    """The space behind a plane."""

    normal: Direction
    """Direction out of the half-space."""
    offset: Number = 0.0
    """Distance of the plane from the origin along the normal, m."""


class SceneBody(CheckedModel):
    """A body that the robot must not touch: one shape, fixed to the world or to a link of the robot."""

    name: Name | None = None
    """Unique name. Null: shape and number of the body."""
    box: tuple[Positive, Positive, Positive] | None = None
    """Lengths along x, y and z, m."""
    sphere: Positive | None = None
    """Radius, m."""
    cylinder: Round | None = None
    """Cylinder about z, centred at the origin: {radius: ..., length: ...}, m."""
    capsule: Round | None = None
    """Capsule about z: like cylinder, with round caps added to the length, m."""
    half_space: HalfSpaceShape | None = None
    """Space behind a plane: {normal: [x, y, z], offset: 0}. The normal points out of the body; offset is the distance
    from the origin along the normal, m."""
    mesh: Name | None = None
    """Mesh file; its convex hull is used."""
    urdf: Name | None = None
    """URDF file of a cell without moving joints; its collision geometry is used."""
    scale: Positive = 1.0
    """Factor from the mesh unit to m."""
    link: Name | None = None
    """Link of the robot that carries the body. Null: the body is fixed to the world."""
    frame: Name | None = None
    """Frame in which the body is placed. Null: the world."""
    position: Vector3 = (0.0, 0.0, 0.0)
    """Position of the body origin in the world, frame or link, m."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw, degrees."""
    since: Name | None = None
    """In a program, name of the part at whose start the body appears. Null: it is there from the beginning."""
    until: Name | None = None
    """In a program, name of the part at whose start the body disappears. Null: it stays."""

    @property
    def shape(self) -> str:
        """Key of the shape that the body has."""
        return next(key for key in SHAPES if getattr(self, key) is not None)

    @property
    def size(self) -> float:
        """Largest length stated for the shape, m; 0 for a mesh or a URDF."""
        shape = getattr(self, self.shape)
        if isinstance(shape, Round):
            return max(shape.radius, shape.length)
        if isinstance(shape, HalfSpaceShape):
            return abs(shape.offset)
        return 0.0 if isinstance(shape, str) else float(np.max(shape))

    @property
    def placement(self) -> Placement:
        """Placement of the body in the world, in its frame, or in the frame of its link."""
        return Placement(xyz=self.position, rpy_deg=self.rpy_deg)

    def _mistakes(self) -> Iterator[Mistake]:
        shapes = [key for key in SHAPES if getattr(self, key) is not None]
        if len(shapes) != 1:
            raise refuse(
                "a body has exactly one shape",
                found=shapes or "none",
                allowed=f"one of {', '.join(SHAPES)}",
            )
        if self.link is not None and self.frame is not None:
            yield (
                "frame",
                "a body is placed in the frame of its link",
                "either link or frame",
            )
        if self.half_space is None:
            return
        if self.link is not None:
            yield "link", "a half-space is fixed to the world", "null"
        for key in ("position", "rpy_deg"):
            if any(getattr(self, key)):
                yield (
                    key,
                    "the position of a half-space is given only by its plane",
                    "normal and offset in half_space",
                )


class CollisionSettings(Model):
    """The clearance, and the pairs of bodies to which it applies."""

    clearance: NonNegative = 0.01
    """Minimum distance between bodies, m."""
    mode: Literal["auto", "avoid", "check", "off"] = "auto"
    """avoid: the plan keeps the clearance; without a scene, only between links of the robot. check: only the
    verification checks it. off: distances are ignored. auto: avoid if there is a scene, otherwise off."""
    self_collision: Flag = True
    """Whether the clearance also applies between links of the robot."""
    disable: tuple[tuple[Name, Name], ...] = ()
    """Pairs of links or bodies that may touch."""
    srdf: Name | None = None
    """SRDF file; the pairs that it disables may also touch."""
    padding: dict[Name, NonNegative] = Field(default={})
    """Margin added to the bodies of each link, by link name, m."""
    capsules: Literal["none", "auto"] = "none"
    """auto: links are covered with capsules if the robot has no collision geometry."""


def name_bodies(scene: tuple[SceneBody, ...]) -> tuple[SceneBody, ...]:
    """Name unnamed bodies by shape and number, and refuse bodies with the same name."""
    named = tuple(
        body.model_copy(update={"name": body.name or f"{body.shape} {number}"})
        for number, body in enumerate(scene)
    )
    names = [body.name for body in named]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise refuse(
            "two bodies have the same name", found=twice[0], allowed="each name once"
        )
    return named


class SceneSource(Model):
    """A scene whose bodies are in a separate file."""

    file: Name
    """Scene file, relative to the task file."""
    frame: Name | None = None
    """Frame of all bodies that state neither frame nor link. Null: the world."""


class SceneFile(Model):
    """The content of a scene file."""

    brachis_scene: Version
    """Version of the format."""
    bodies: tuple[SceneBody, ...]
    """Bodies as in scene. File names are relative to this file. Frames are those of the task."""


def with_scene_of_file(
    content: Mapping[str, Any], source: str, folder: Path
) -> Mapping[str, Any]:
    """Return the content of a task, with ``scene: {file: ...}`` replaced by the bodies in the file.

    Parameters
    ----------
    content : mapping
        A task, not checked yet.
    source : str
        File name or other origin of the task, for messages.
    folder : Path
        Folder to which the path of the file is relative.
    """
    scene = content.get("scene")
    if not isinstance(scene, Mapping) or "file" not in scene:
        return content
    where = f"{source}: scene"
    settings = validate(SceneSource, scene, where)
    path = folder / settings.file
    text = read_text(path, where=f"{where}.file", folder=folder, found=settings.file)
    file = validate(SceneFile, read_yaml(text, str(path)), str(path))
    frame = {"frame": settings.frame}
    bodies = tuple(
        body if body.link or body.frame else body.model_copy(update=frame)
        for body in with_paths(file.bodies, path.absolute().parent)
    )
    return {**content, "scene": bodies}


def with_paths(bodies: tuple[SceneBody, ...], folder: Path) -> tuple[SceneBody, ...]:
    """Return bodies in which the paths of meshes and URDFs, relative to `folder`, are absolute."""
    return tuple(
        body.model_copy(
            update={
                key: absolute_path(file, folder)
                for key in ("mesh", "urdf")
                if (file := getattr(body, key)) is not None
            }
        )
        for body in bodies
    )
