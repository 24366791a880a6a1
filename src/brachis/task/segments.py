"""Segments of the prescribed path, as the task file writes them.

A path is a list of mappings such as ``- line: {to: [0.5, 0]}``, each with an optional ``blend`` and, in task spaces of
poses, an optional ``orientation``. A segment begins where its predecessor ends; the first one begins at the task
coordinates of the start posture. Lengths are in metres and angles in degrees, but yaw, pitch and roll as task
coordinates are in radians. Points have the coordinates of all rows of the task space; for a pose these are x, y, z.
`brachis.path.build_path` checks whether the number of coordinates fits the task space.

A kind of segment consists of a model in this module, which belongs to the union `Segment`, and a function in
`brachis.path` that makes its curve.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from brachis.task.fields import (
    POSITION,
    ByKey,
    CheckedModel,
    Count,
    Flag,
    Mistake,
    Model,
    Name,
    NonEmpty,
    NonNegative,
    Number,
    Positive,
    Vector,
    must,
    refuse,
    required_keys,
    show_arguments,
)
from brachis.task.orientation import (
    Attitude,
    Direction,
    OrientationMode,
    Turning,
    poses_of,
)
from brachis.task.point_data import FitReport, PointFile

JointOrder = Annotated[
    tuple[Name, ...] | None,
    Field(
        description="With task_space: joints, the joint that each coordinate belongs to. Null: chain order."
    ),
]
SMOOTHNESS = 3
"""Number of continuous derivatives that a path must have."""


class BSplineCurve(CheckedModel):
    """A clamped, three times continuously differentiable B-spline. `brachis.bspline_segment` makes one from a curve."""

    degree: Annotated[Count, Field(ge=SMOOTHNESS + 1, le=15)] = 5
    """Degree of the spline."""
    knots: Vector
    """Ascending knots: the first and the last are repeated degree + 1 times, inner ones up to degree - 3 times. Blends
    and speeds are in m only if the knots are lengths along the curve in m."""
    control_points: Annotated[tuple[Vector, ...], Field(min_length=SMOOTHNESS + 2)]
    """Control points with all task coordinates (m, rad). For poses: x, y, z, or x, y, z, qw, qx, qy, qz; the curve of
    the quaternion is normalised."""
    relative: Flag = False
    """Whether the curve is moved to the start of the segment."""
    joints: JointOrder = None
    speeds: tuple[tuple[tuple[Number, Positive], ...], ...] = ()
    """Tables of the maximum tool speed along sections of the curve: pairs [distance (m), speed (m/s)], interpolated
    linearly."""
    fit: FitReport | None = None
    """Origin of the points; written by brachis."""

    @property
    def has_orientations(self) -> bool:
        """Whether the control points include orientations of the tool."""
        return len(self.control_points[0]) == 7

    def _mistakes(self) -> Iterator[Mistake]:
        knots = self.knots
        outer = self.degree + 1
        needed = len(self.control_points) + outer
        if len(knots) != needed:
            raise refuse(
                "the number of knots is wrong",
                key="knots",
                found=len(knots),
                allowed=f"{needed}: control points + degree + 1",
            )
        if len({len(point) for point in self.control_points}) > 1:
            yield (
                "control_points",
                "control points have different numbers of coordinates",
                "the same number for all",
            )
        ends = (knots[0], knots[-1])
        clamped = ends == (knots[outer - 1], knots[-outer]) and ends[0] < ends[1]
        if not clamped or list(knots) != sorted(knots):
            yield (
                "knots",
                "the B-spline is not clamped, or its knots descend",
                "ascending knots, the first and the last one degree + 1 times",
            )
        allowed = self.degree - SMOOTHNESS
        often = [
            count
            for knot, count in Counter(knots).items()
            if count > (outer if knot in ends else allowed)
        ]
        if often:
            yield (
                "knots",
                f"a knot occurs {max(often)} times, so that a derivative up to the third jumps",
                f"at most {allowed}",
            )


Yaw = Annotated[
    Literal["fixed", "tangent"],
    Field(
        description="Course of the angle row (yaw, pitch or roll): fixed, or tangent (turns with the tangent)."
    ),
]
Normal = Annotated[
    Direction | None,
    Field(
        description="Axis of rotation (right-hand rule), as a vector x, y, z of any length."
    ),
]
Centre = Annotated[
    Vector, Field(description="Centre, m: only the position coordinates.")
]


Coordinates = Annotated[
    Vector,
    BeforeValidator(lambda value: [value] if isinstance(value, int | float) else value),
]
"""A single number is read as a list of one coordinate."""


Turns = Annotated[
    Number,
    must(bool, "a circle with zero turns has zero length", "a number other than 0"),
]


class LineTo(Model):
    """A straight line to a point."""

    to: Coordinates
    """End point: all task coordinates (m, angles in rad)."""


class LineBy(Model):
    """A straight line given by a displacement."""

    by: Coordinates
    """Displacement: all task coordinates (m, angles in rad)."""


class LineToPosture(Model):
    """A straight line to the tool position, in task spaces of poses also to the orientation, of a named posture."""

    to_posture: Name
    """Posture whose tool position (for poses also orientation) is the end of the line."""
    has_orientations: ClassVar[bool] = True


class LineHeading(Model):
    """A straight line of given length and direction in the plane of two position rows; an angle row stays constant."""

    length: NonNegative
    """Length, m."""
    angle_deg: Number
    """Direction, degrees, from the first towards the second position coordinate."""


class ArcCenter(Model):
    """A circular arc about a centre."""

    center: Centre
    angle_deg: Number
    """Swept angle, degrees. Positive: about the normal, or from the first towards the second position coordinate."""
    normal: Normal = None
    yaw: Yaw = "fixed"


class ArcVia(Model):
    """A circular arc through one point to another."""

    via: Vector
    """Point on the arc, m: only the position coordinates."""
    to: Vector
    """End point, m: only the position coordinates."""
    yaw: Yaw = "fixed"


class CircleTurns(Model):
    """Whole or fractional turns about a centre."""

    center: Centre
    turns: Turns = 1.0
    """Number of turns, not zero, with the sign convention of an arc's angle."""
    normal: Normal = None
    yaw: Yaw = "fixed"


class HelixTurns(Model):
    """Turns about an axis, climbing along it, in three position rows."""

    center: Centre
    turns: Turns = 1.0
    """Number of turns, not zero, positive about the normal."""
    pitch: Number
    """Distance along the normal per turn, m."""
    normal: Direction = (0.0, 0.0, 1.0)
    """Axis of rotation (right-hand rule), of any length."""


class SplineThrough(CheckedModel):
    """A smooth curve from the start of the segment through waypoints. The first waypoint may equal the start."""

    through: NonEmpty[Coordinates]
    """Waypoints, each with all task coordinates (m, angles in rad)."""
    orientations: tuple[Attitude, ...] | None = None
    """For poses, orientation of the tool at each waypoint. Null: as in the segment's orientation."""
    relative: Flag = False
    """Whether waypoints are relative to the start of the segment. If so, displacements are in the frame of the path and
    rotations in the tool frame."""
    starts_at: Vector | None = None
    """Expected start of the segment to within 1e-4 m or rad, all task coordinates. With relative, waypoints are
    relative to this point."""
    starts_oriented: Attitude | None = None
    """Expected orientation at the start; requires orientations."""
    fit: FitReport | None = None
    """Origin of the points; written by brachis."""
    joints: JointOrder = None

    @property
    def has_orientations(self) -> bool:
        """Whether the waypoints include orientations of the tool."""
        return self.orientations is not None

    @model_validator(mode="before")
    @classmethod
    def _of_poses(cls, content: object) -> object:
        if not isinstance(content, Mapping):
            return content
        through = content.get("through")
        orientations = content.get("orientations")
        if not (are_matrices(through) or are_matrices(orientations)):
            return content
        poses = poses_of(through, "spline.through", orientations)
        places, turns = zip(*poses, strict=True)
        return {**content, "through": places, "orientations": turns}

    def _mistakes(self) -> Iterator[Mistake]:
        count = len(self.through)
        if self.orientations is not None and len(self.orientations) != count:
            raise refuse(
                "the numbers of waypoints and of orientations differ",
                key="orientations",
                found=len(self.orientations),
                allowed=f"{count}, one for each waypoint in through",
            )
        if self.orientations is None and self.starts_oriented is not None:
            yield (
                "starts_oriented",
                "an orientation at the start requires orientations at the waypoints",
                "orientations as well",
            )


def are_matrices(values: Any) -> bool:
    """Return whether values are transforms, rotations or their matrices, rather than content of a task file."""
    first = values[0] if isinstance(values, list) and values else values
    return any(hasattr(first, name) for name in ("homogeneous", "as_matrix")) or (
        isinstance(first, list) and isinstance(first[0] if first else None, list)
    )


LineForm = Annotated[
    LineTo | LineBy | LineHeading | LineToPosture,
    ByKey("a line needs exactly one of its forms"),
]
ArcForm = Annotated[ArcCenter | ArcVia, ByKey("an arc needs exactly one of its forms")]
_Start = tuple[tuple[float, ...], Attitude | None]


class SegmentModel(CheckedModel):
    """Keys that are common to all segments."""

    blend: Positive | None = None
    """Rounding of the corner at the END of the segment: length cut from this segment and from the next, m."""
    stop: Flag = False
    """Whether the tool stops at the end of this segment. All joints are then at rest there, and the path may have a
    corner.
    """
    dwell: NonNegative = 0.0
    """Time at rest at the end of the segment, s."""

    @model_validator(mode="before")
    @classmethod
    def _dwell_is_a_stop(cls, content: object) -> object:
        if isinstance(content, Mapping) and content.get("dwell"):
            return {"stop": True, **content}
        return content

    def _mistakes(self) -> Iterator[Mistake]:
        if 0.0 < self.dwell < 1e-3:
            yield (
                "dwell",
                "the dwell is shorter than a cycle of a robot controller",
                "0, or at least 0.001 s",
            )
        if self.dwell and not self.stop:
            yield "stop", "a dwell needs a stop", "true, or no dwell"
        if self.stop and self.blend is not None:
            yield (
                "blend",
                "the tool stops at the end of this segment, so the corner there is not rounded",
                "either blend, or stop (or dwell)",
            )

    def __add__(
        self, following: SegmentModel | tuple[SegmentModel, ...]
    ) -> tuple[SegmentModel, ...]:
        """Append a segment or a path to this segment."""
        if isinstance(following, SegmentModel):
            return (self, following)
        return (self, *following) if isinstance(following, tuple) else NotImplemented

    def __radd__(self, path: tuple[SegmentModel, ...]) -> tuple[SegmentModel, ...]:
        """Append this segment to a path."""
        return (*path, self) if isinstance(path, tuple) else NotImplemented

    def __repr__(self) -> str:
        """Return the call that creates the segment in a program."""
        arguments = show_arguments(self.shape) + show_arguments(self, self.kind)
        name = type(self).__name__.removesuffix("Segment")
        return f"{name}({', '.join(arguments)})"

    @property
    def start(self) -> _Start | None:
        """Start that the segment states, as coordinates and tool orientation; None if it states none."""
        return None

    @property
    def kind(self) -> str:
        """The key for this kind of segment in the task file: ``line``, ``arc``, ``circle``, ``spline``, ..."""
        return required_keys(type(self))[0]

    @property
    def shape(self) -> Any:
        """The value of this key: a `LineTo`, an `ArcCenter`, ..."""
        return getattr(self, self.kind)


class MovingSegment(SegmentModel):
    """The keys shared by all segments along which the position changes."""

    orientation: OrientationMode = None
    """For poses, turning of the tool along the segment: fixed, tangent, {rotate: ...}, {to: ...} or {tangent: ...}.
    Null: to the orientations of a spline or of the posture, otherwise fixed."""
    speed: Positive | None = None
    """Process speed: constant speed of the tool along the segment except its blends, m/s, as in
    tool_limits.process_speed. It replaces feed rates of points. To hold the speed over the whole segment, put
    a short line without a speed before the segment (run-in), and another one after it (run-out)."""

    def _mistakes(self) -> Iterator[Mistake]:
        yield from super()._mistakes()
        has_orientations = getattr(self.shape, "has_orientations", False)
        if self.orientation is not None and has_orientations:
            yield (
                "orientation",
                f"the {self.kind} already has orientations",
                f"either orientation, or the orientations of the {self.kind} itself",
            )


class LineSegment(MovingSegment):
    """A straight line `to` a point, `by` a displacement, of a `length` in a direction, or to a named posture."""

    line: LineForm

    @model_validator(mode="before")
    @classmethod
    def _to_transform(cls, content: object) -> object:
        if not isinstance(content, Mapping):
            return content
        line = content.get("line")
        if not isinstance(line, Mapping) or not hasattr(line.get("to"), "homogeneous"):
            return content
        ((position, turn),) = poses_of([line["to"]], "line.to")
        return {
            "orientation": {"to": turn},
            **content,
            "line": {**line, "to": position},
        }


class ArcSegment(MovingSegment):
    """A circular arc about a `center` by an angle, or `via` one point `to` another."""

    arc: ArcForm


class CircleSegment(MovingSegment):
    """Whole or fractional turns about a centre."""

    circle: CircleTurns


class HelixSegment(MovingSegment):
    """Turns about an axis, climbing along it, in three position rows."""

    helix: HelixTurns


class SplineSegment(MovingSegment):
    """A smooth curve through waypoints, from the end of the previous segment or the start of the path."""

    spline: SplineThrough

    @property
    def start(self) -> _Start | None:
        """`starts_at`, or else the first waypoint; None if the waypoints are relative."""
        spline = self.spline
        if spline.relative:
            return None
        if spline.starts_at is not None:
            return spline.starts_at, spline.starts_oriented
        turn = spline.orientations[0] if spline.orientations else None
        return spline.through[0], turn


class TurnSegment(SegmentModel):
    """A turn of the tool on the spot; only in task spaces of poses."""

    turn: Turning


class BSplineSegment(MovingSegment):
    """A B-spline curve."""

    bspline: BSplineCurve

    @property
    def start(self) -> _Start | None:
        """The first control point; None if the curve is relative."""
        if self.bspline.relative:
            return None
        first = self.bspline.control_points[0]
        quaternion = first[len(POSITION) :]
        if not self.bspline.has_orientations:
            return first, None
        length = math.hypot(*quaternion) or 1.0
        turn = tuple(number / length for number in quaternion)
        return first, Attitude.model_construct(quaternion_wxyz=turn)


class CsvSegment(MovingSegment):
    """A smooth curve along the points in a file."""

    csv: PointFile


Segment = Annotated[
    LineSegment
    | ArcSegment
    | CircleSegment
    | HelixSegment
    | SplineSegment
    | BSplineSegment
    | TurnSegment
    | CsvSegment,
    ByKey("a segment needs exactly one kind"),
]
