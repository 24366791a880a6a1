"""Segments of the prescribed path, as the task file writes them.

A path is a list of single-key mappings, ``- line: {to: [0.5, 0]}``, each with an optional ``blend``. A segment begins
where its predecessor ends, the first one at the task coordinates of the start posture. Lengths are in metres, angles
in degrees except the yaw coordinate, which is a task coordinate and therefore in radians. Whether the number of
coordinates fits the task space is for the path to say (`brachis.path.build_path`), which knows both.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag, field_validator

from brachis.task.fields import Flag, Model, NonNegative, Number, Positive, Vector, by_key, refuse

Turning = Annotated[
    Literal["fixed", "tangent"],
    Field(description="Yaw along the segment: as at its start, or turning with the tangent (task spaces with yaw)."),
]
Normal = Annotated[
    tuple[Number, Number, Number] | None,
    Field(description="Axis of rotation, for three position rows; right-hand rule. Any length but zero."),
]
Centre = Annotated[Vector, Field(description="Centre, m: the position rows, without yaw.")]


class LineTo(Model):
    """A straight line to a point."""

    to: Vector = Field(description="End point: all rows of the task space (m, yaw in rad).")


class LineBy(Model):
    """A straight line by a displacement."""

    by: Vector = Field(description="Displacement: all rows of the task space (m, yaw in rad).")


class LineHeading(Model):
    """A straight line of given length and direction, in the plane of two position rows; yaw stays."""

    length: NonNegative = Field(description="Length, m.")
    angle_deg: Number = Field(description="Direction, degrees, from the first towards the second position row.")


class ArcCenter(Model):
    """A circular arc about a centre."""

    center: Centre
    angle_deg: Number = Field(
        description="Swept angle, degrees, signed: positive from the first towards the second position row, "
        "or about the normal."
    )
    normal: Normal = None
    yaw: Turning = "fixed"


class ArcVia(Model):
    """A circular arc through a point to another one."""

    via: Vector = Field(description="A point between start and end, m: the position rows, without yaw.")
    to: Vector = Field(description="End point, m: the position rows, without yaw.")
    yaw: Turning = "fixed"


class Circle(Model):
    """Whole or fractional turns about a centre."""

    center: Centre
    turns: Number = Field(default=1.0, description="Number of turns, signed as an arc's angle; not zero.")
    normal: Normal = None
    yaw: Turning = "fixed"

    @field_validator("turns")
    @classmethod
    def _turns_not_zero(cls, turns: float) -> float:
        if turns == 0:
            problem = "a circle without turns has zero length"
            raise refuse(problem, found=turns, allowed="a number other than 0")
        return turns


class SplineThrough(Model):
    """A smooth curve through waypoints; the segment's start is the first one, and not repeated here."""

    through: Annotated[tuple[Vector, ...], Field(min_length=1)] = Field(
        description="Waypoints: all rows of the task space each (m, yaw in rad)."
    )
    relative: Flag = Field(default=False, description="Whether the waypoints are relative to the segment's start.")


Line = Annotated[
    Annotated[LineTo, Tag("<LineTo>")]
    | Annotated[LineBy, Tag("<LineBy>")]
    | Annotated[LineHeading, Tag("<LineHeading>")],
    by_key(
        "a line needs exactly one of its forms",
        {"LineTo": ("to",), "LineBy": ("by",), "LineHeading": ("length", "angle_deg")},
    ),
]
Arc = Annotated[
    Annotated[ArcCenter, Tag("<ArcCenter>")] | Annotated[ArcVia, Tag("<ArcVia>")],
    by_key(
        "an arc needs exactly one of its forms",
        {"ArcCenter": ("center", "angle_deg"), "ArcVia": ("via", "to")},
    ),
]
Shape = LineTo | LineBy | LineHeading | ArcCenter | ArcVia | Circle | SplineThrough


class SegmentModel(Model):
    """What all segments share."""

    blend: Positive | None = Field(
        default=None,
        description="Rounds the corner at the END of this segment: metres taken from it and from the next one.",
    )

    @property
    def kind(self) -> str:
        """The key that names the segment in the task file: ``line``, ``arc``, ``circle`` or ``spline``."""
        return next(name for name in type(self).model_fields if name != "blend")

    @property
    def shape(self) -> Shape:
        """What stands below that key."""
        shape: Shape = getattr(self, self.kind)
        return shape


class LineSegment(SegmentModel):
    """A straight line."""

    line: Line


class ArcSegment(SegmentModel):
    """A circular arc."""

    arc: Arc


class CircleSegment(SegmentModel):
    """A circle."""

    circle: Circle


class SplineSegment(SegmentModel):
    """A smooth curve through waypoints."""

    spline: SplineThrough


Segment = Annotated[
    Annotated[LineSegment, Tag("<LineSegment>")]
    | Annotated[ArcSegment, Tag("<ArcSegment>")]
    | Annotated[CircleSegment, Tag("<CircleSegment>")]
    | Annotated[SplineSegment, Tag("<SplineSegment>")],
    by_key(
        "a segment needs exactly one kind",
        {
            "LineSegment": ("line",),
            "ArcSegment": ("arc",),
            "CircleSegment": ("circle",),
            "SplineSegment": ("spline",),
        },
    ),
]
