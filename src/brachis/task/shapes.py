"""The curves that segments of a path are made of, as the task file writes them; see `brachis.task.segments`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, Tag, model_validator

from brachis.task.bspline_curve import BSplineCurve, JointOrder
from brachis.task.fields import Flag, Model, NonNegative, Number, Vector, by_key, refuse
from brachis.task.orientation import Attitude, Direction
from brachis.task.point_data import FitReport, PointFile

Yaw = Annotated[
    Literal["fixed", "tangent"],
    Field(description="Yaw along the segment: as at its start, or turning with the tangent (task spaces with yaw)."),
]
Normal = Annotated[
    tuple[Number, Number, Number] | None,
    Field(description="Axis of rotation, for three position rows; right-hand rule. Any length but zero."),
]
Centre = Annotated[Vector, Field(description="Centre, m: the position rows, without yaw.")]


def _not_zero(turns: float) -> float:
    if turns == 0:
        problem = "a circle without turns has zero length"
        raise refuse(problem, found=turns, allowed="a number other than 0")
    return turns


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
    yaw: Yaw = "fixed"


class ArcVia(Model):
    """A circular arc through a point to another one."""

    via: Vector = Field(description="A point between start and end, m: the position rows, without yaw.")
    to: Vector = Field(description="End point, m: the position rows, without yaw.")
    yaw: Yaw = "fixed"


class Circle(Model):
    """Whole or fractional turns about a centre."""

    center: Centre
    turns: Annotated[Number, AfterValidator(_not_zero)] = Field(
        default=1.0, description="Number of turns, signed as an arc's angle; not zero."
    )
    normal: Normal = None
    yaw: Yaw = "fixed"


class Helix(Model):
    """Turns about an axis that climb along it, in three position rows."""

    center: Centre
    turns: Annotated[Number, AfterValidator(_not_zero)] = Field(
        default=1.0, description="Number of turns, signed about the normal; not zero."
    )
    pitch: Number = Field(description="Climb of each turn along the normal, m; negative: against it.")
    normal: Direction = Field(description="Axis of rotation; right-hand rule. Any length but zero.")


class SplineThrough(Model):
    """A smooth curve from the segment's start through waypoints; a first one that equals the start is the start."""

    through: Annotated[tuple[Vector, ...], Field(min_length=1)] = Field(
        description="Waypoints: all rows of the task space each (m, yaw in rad)."
    )
    orientations: tuple[Attitude, ...] | None = Field(
        default=None,
        description="Orientation of the tool at each waypoint (task spaces of poses). Null: the segment's "
        "`orientation` says how the tool turns.",
    )
    relative: Flag = Field(
        default=False,
        description="Whether the waypoints are relative to the segment's start: displacements along the axes of the "
        "path's frame, rotations in the tool frame.",
    )
    starts_at: Vector | None = Field(
        default=None,
        description="Where the waypoints expect the segment to start: all rows of the task space. A start that is "
        "elsewhere (by more than 1e-4 m or rad) is refused; with `relative` it is what the waypoints are relative to.",
    )
    starts_oriented: Attitude | None = Field(
        default=None, description="As `starts_at`, the orientation of the tool; beside `orientations`."
    )
    fit: FitReport | None = Field(default=None, description="Where the waypoints come from; written by brachis.")
    joints: JointOrder = None

    @model_validator(mode="after")
    def _orientations_fit(self) -> SplineThrough:
        if self.orientations is None:
            if self.starts_oriented is not None:
                problem = "the orientation at the start stands beside the orientations at the waypoints"
                raise refuse(problem, key=".starts_oriented", allowed="orientations as well")
        elif len(self.orientations) != len(self.through):
            problem = "a spline needs an orientation for each of its waypoints, or none"
            allowed = f"{len(self.through)}, as there are waypoints in through"
            raise refuse(problem, key=".orientations", found=len(self.orientations), allowed=allowed)
        return self


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
Shape = LineTo | LineBy | LineHeading | ArcCenter | ArcVia | Circle | Helix | SplineThrough | BSplineCurve | PointFile
