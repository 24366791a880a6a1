"""Segments of the prescribed path, as the task file writes them.

A path is a list of mappings, ``- line: {to: [0.5, 0]}``, each with an optional ``blend`` and, in task spaces of poses,
an optional ``orientation``. A segment begins where its predecessor ends, the first one at the task coordinates of the
start posture. Lengths are in metres, angles in degrees except the yaw coordinate, which is a task coordinate and
therefore in radians. Coordinates are those of all rows of the task space; of a pose they are x, y, z. Whether their
number fits the task space is for the path to say (`brachis.path.build_path`), which knows both.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, Tag, model_validator

from brachis.task.bspline_curve import BSplineCurve
from brachis.task.fields import Model, Positive, by_key, refuse
from brachis.task.orientation import OrientationMode, ToolPose, Turning
from brachis.task.point_data import PointFile
from brachis.task.shapes import Arc, Circle, Helix, Line, Shape, SplineThrough

_POSE_COLUMNS = 7
_POSITIONS = 3


class SegmentModel(Model):
    """What all segments share."""

    blend: Positive | None = Field(
        default=None,
        description="Rounds the corner at the END of this segment: metres taken from it and from the next one.",
    )

    def __add__(self, other: SegmentModel | tuple[SegmentModel, ...]) -> tuple[SegmentModel, ...]:
        """Join a segment, or a path, to the end of this segment."""
        if isinstance(other, SegmentModel):
            return (self, other)
        return (self, *other) if isinstance(other, tuple) else NotImplemented

    def __radd__(self, other: tuple[SegmentModel, ...]) -> tuple[SegmentModel, ...]:
        """Join this segment to the end of a path."""
        return (*other, self) if isinstance(other, tuple) else NotImplemented

    def __repr__(self) -> str:
        """Show it as a program makes it."""
        shape = getattr(self, self.kind)
        rest = [(name, value) for name, value in self.__repr_args__() if name != self.kind]
        given = ", ".join(f"{name}={value!r}" for name, value in (*shape.__repr_args__(), *rest))
        return f"{type(self).__name__.removesuffix('Segment')}({given})"

    def start_place(self, *, of_poses: bool) -> tuple[float, ...] | ToolPose | None:  # noqa: ARG002  (others ask)
        """Where the segment says that it begins, as ``path_start`` of a task; None where it leaves that open.

        Without relative waypoints and another word on it, that is the first waypoint.
        """
        return None

    @property
    def kind(self) -> str:
        """The key that names the segment in the task file: ``line``, ``arc``, ``circle``, ``spline``, ..."""
        return next(name for name in type(self).model_fields if name not in {"blend", "orientation"})


class MovingSegment(SegmentModel):
    """What all segments share along which the position moves."""

    orientation: OrientationMode = Field(
        default=None,
        description="How the tool turns along the segment (task spaces of poses): fixed, tangent, {rotate: ...}, "
        "{to: ...} or {tangent: ...}. Null: fixed, or as a spline's `orientations` say.",
    )

    @property
    def shape(self) -> Shape:
        """What stands below the key that names the segment."""
        shape: Shape = getattr(self, self.kind)
        return shape


class LineSegment(MovingSegment):
    """A straight line."""

    line: Line


class ArcSegment(MovingSegment):
    """A circular arc."""

    arc: Arc


class CircleSegment(MovingSegment):
    """A circle."""

    circle: Circle


class HelixSegment(MovingSegment):
    """A helix."""

    helix: Helix


class SplineSegment(MovingSegment):
    """A smooth curve through waypoints."""

    spline: SplineThrough

    def start_place(self, *, of_poses: bool) -> tuple[float, ...] | ToolPose | None:
        """See `SegmentModel.start_place`."""
        spline = self.spline
        if spline.relative:
            return None
        place, oriented = spline.starts_at, spline.starts_oriented
        if place is None:
            place, oriented = spline.through[0], spline.orientations[0] if spline.orientations else None
        if oriented is None or not of_poses or len(place) != _POSITIONS:
            return place
        return ToolPose.model_validate({"position": place, **oriented.model_dump()})

    @model_validator(mode="after")
    def _one_word_on_orientation(self) -> SplineSegment:
        if self.orientation is not None and self.spline.orientations is not None:
            problem = "the spline's orientations say already how the tool turns"
            raise refuse(problem, key=".orientation", allowed="orientation or spline.orientations, not both")
        return self


class TurnSegment(SegmentModel):
    """A turn of the tool on the spot, in task spaces of poses."""

    turn: Turning


class BSplineSegment(MovingSegment):
    """A B-spline curve."""

    bspline: BSplineCurve

    def start_place(self, *, of_poses: bool) -> tuple[float, ...] | ToolPose | None:
        """See `SegmentModel.start_place`."""
        first = self.bspline.control_points[0]
        if self.bspline.relative or not of_poses or len(first) != _POSE_COLUMNS:
            return None if self.bspline.relative else first
        length = math.hypot(*first[_POSITIONS:]) or 1.0
        turn = [number / length for number in first[_POSITIONS:]]
        return ToolPose.model_validate({"position": first[:_POSITIONS], "quaternion_wxyz": turn})

    @model_validator(mode="after")
    def _one_word_on_orientation(self) -> BSplineSegment:
        if self.orientation is not None and len(self.bspline.control_points[0]) == _POSE_COLUMNS:
            problem = "the curve's quaternions say already how the tool turns"
            raise refuse(
                problem, key=".orientation", allowed="orientation or control points with quaternions, not both"
            )
        return self


class CsvSegment(MovingSegment):
    """A smooth curve along points from a file."""

    csv: PointFile


Segment = Annotated[
    Annotated[LineSegment, Tag("<LineSegment>")]
    | Annotated[ArcSegment, Tag("<ArcSegment>")]
    | Annotated[CircleSegment, Tag("<CircleSegment>")]
    | Annotated[HelixSegment, Tag("<HelixSegment>")]
    | Annotated[SplineSegment, Tag("<SplineSegment>")]
    | Annotated[BSplineSegment, Tag("<BSplineSegment>")]
    | Annotated[TurnSegment, Tag("<TurnSegment>")]
    | Annotated[CsvSegment, Tag("<CsvSegment>")],
    by_key(
        "a segment needs exactly one kind",
        {
            "LineSegment": ("line",),
            "ArcSegment": ("arc",),
            "CircleSegment": ("circle",),
            "HelixSegment": ("helix",),
            "SplineSegment": ("spline",),
            "BSplineSegment": ("bspline",),
            "TurnSegment": ("turn",),
            "CsvSegment": ("csv",),
        },
    ),
]
