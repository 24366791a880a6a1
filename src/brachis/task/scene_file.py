"""Scenes from a file of their own, and the files that a scene names."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from brachis.common.files import locate_urdf, read_text
from brachis.errors import TaskError
from brachis.task.fields import Model, Version
from brachis.task.messages import show, validate
from brachis.task.models import Task
from brachis.task.scene import SceneBody
from brachis.task.yaml_reader import read_yaml


class SceneFile(Model):
    """What a scene file says."""

    brachis_scene: Version
    """Version of the format."""
    bodies: tuple[SceneBody, ...]
    """Bodies as in scene; files are relative to this file."""


def with_scene_of_file(
    content: Mapping[str, Any], source: str, folder: Path
) -> Mapping[str, Any]:
    """Return a task as it is written with the bodies of the file that its ``scene`` names.

    Parameters
    ----------
    content : mapping
        A task, not checked yet.
    source : str
        File name, or what else the task came from, for messages.
    folder : Path
        What the file's path is relative to.
    """
    scene = content.get("scene")
    if not isinstance(scene, Mapping):
        return content
    if set(scene) != {"file"}:
        raise TaskError(
            "scene must be a list of bodies or a file",
            where=f"{source}: scene",
            found=show(scene),
            allowed="[{box: [...], position: [...]}, ...] or {file: cell.yaml}",
        )
    name = str(scene["file"])
    path = folder / name
    where = f"{source}: scene.file"
    text = read_text(path, where=where, folder=folder, found=name)
    file = validate(SceneFile, read_yaml(text, str(path)), str(path))
    return {**content, "scene": _with_paths(file.bodies, path.absolute().parent)}


def with_absolute_files(task: Task, folder: Path) -> Task:
    """Return the task with the paths of a URDF, an SRDF and meshes, relative to `folder`, made absolute."""
    changes: dict[str, object] = {}
    if task.robot.urdf is not None:
        urdf = {"urdf": locate_urdf(task.robot.urdf, folder)}
        changes["robot"] = task.robot.model_copy(update=urdf)
    if task.scene:
        changes["scene"] = _with_paths(task.scene, folder)
    if task.collisions.srdf is not None:
        srdf = {"srdf": _absolute(task.collisions.srdf, folder)}
        changes["collisions"] = task.collisions.model_copy(update=srdf)
    return task.model_copy(update=changes) if changes else task


def _with_paths(bodies: tuple[SceneBody, ...], folder: Path) -> tuple[SceneBody, ...]:
    return tuple(
        body.model_copy(
            update={
                key: _absolute(file, folder)
                for key in ("mesh", "urdf")
                if (file := getattr(body, key)) is not None
            }
        )
        for body in bodies
    )


def _absolute(name: str, folder: Path) -> str:
    # Not Path.resolve: a linked folder keeps its name, beside which the URDF's meshes may be.
    return os.path.abspath(folder / name)  # noqa: PTH100
