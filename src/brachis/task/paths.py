"""Postures and paths, as a task states them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from brachis.task.fields import (
    ByForm,
    Model,
    Name,
    NonEmpty,
    Number,
    Vector,
    plain,
    refuse,
)
from brachis.task.orientation import StartPlace
from brachis.task.segments import Segment, SegmentModel, are_matrices
from brachis.task.tolerances import EACH_ONCE

JointValues = Annotated[
    NonEmpty[Number] | Annotated[dict[Name, Number], Field(min_length=1)],
    ByForm(
        "a list of numbers in the order of the chain, or a mapping of joint names to numbers"
    ),
]


class Posture(Model):
    """A configuration of the robot."""

    joints: JointValues
    """Joint positions, rad (m), in the order of the chain or by joint name."""


PathStart = Annotated[
    StartPlace,
    ByForm(
        "a list of the rows of the task space, or for a pose a mapping {position: [x, y, z], rpy_deg: [...]}"
    ),
]
FreePosture = Annotated[
    Name | Posture,
    ByForm("free, the name of a posture, or a mapping {joints: [...]}"),
]


RedundantJoints = Annotated[
    Literal["auto"] | Annotated[tuple[Name, ...], EACH_ONCE],
    ByForm("auto, or a list of joint names"),
]


PathBegin = Annotated[Number, Field(ge=0.0, lt=1.0)]


Segments = Annotated[tuple[Segment, ...], Field(min_length=1, max_length=3000)]


class PathInFrame(Model):
    """A path that is given in a named frame."""

    frame: Name
    segments: Segments


def _read_path(path: object) -> object:
    """Read one segment, or a list of points, as a list of segments."""
    if isinstance(path, SegmentModel | Mapping):
        return (path,)
    if path == ():  # not stated
        return path

    if callable(path):
        raise refuse(
            "a curve is not a segment",
            found=path,
            allowed="brachis.bspline_segment(curve, (first, last)), or the curve's points as an array",
        )
    rows = plain(path)
    if not isinstance(rows, list) or any(
        isinstance(row, SegmentModel | Mapping) for row in rows
    ):
        return path
    if are_matrices(rows):
        raise refuse(
            "poses are not segments",
            found=rows,
            allowed="brachis.Spline(through=poses), or brachis.fit_path(poses)",
        )
    if len(rows) > 1 and all(isinstance(row, list) for row in rows):
        return ({"spline": {"starts_at": rows[0], "through": rows[1:]}},)
    if all(isinstance(row, list | int | float) for row in rows):
        raise refuse(
            "these numbers do not form a path" if rows else "there is no segment",
            found=rows,
            allowed="at least one segment, such as {line: {by: [0, 0.4, 0]}}, or two points or more, [[...], ...]",
        )
    return path


StatedPath = Annotated[
    tuple[Segment, ...],
    Field(max_length=3000),
    BeforeValidator(
        _read_path,
        json_schema_input_type=Segments
        | Segment
        | Annotated[tuple[Vector, ...], Field(min_length=2)]
        | PathInFrame,
    ),
]


def split_path_in_frame(content: Mapping[str, object]) -> Mapping[str, object]:
    """Split a path that is given in a frame into the keys ``path`` and ``path_frame``."""
    path = content.get("path")
    if not isinstance(path, Mapping) or "frame" not in path:
        return content
    if set(path) != {"frame", "segments"}:
        raise refuse(
            "a path in a frame needs the keys frame and segments",
            key="path",
            found=path,
            allowed="{frame: NAME, segments: [...]}",
        )
    path_frame = content.get("path_frame")
    if path_frame not in (None, path["frame"]):
        raise refuse(
            "this frame differs from path.frame",
            key="path_frame",
            found=path_frame,
            allowed=f"{path['frame']}, or only one of the two keys",
        )
    return {**content, "path": path["segments"], "path_frame": path["frame"]}
