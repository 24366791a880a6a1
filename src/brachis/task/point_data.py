"""Files of points as stated in the task file, and reports on the smooth curves fitted to the points."""

from __future__ import annotations

from math import degrees
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, WithJsonSchema

from brachis.common.words import name_first, write_count
from brachis.task.fields import (
    Count,
    Flag,
    Model,
    Name,
    NonNegative,
    Number,
    WithUnit,
    must,
)
from brachis.task.points.units import ANGLES, CONVENTIONS, LENGTHS, choices

Length = Annotated[
    float, Strict(), Field(ge=1e-7, le=1.0), WithUnit(LENGTHS, "0.05 mm")
]
Angle = Annotated[float, Strict(), Field(ge=1e-7, le=0.5), WithUnit(ANGLES, "0.1 deg")]
OrientationWord = Annotated[
    Name,
    must(
        CONVENTIONS.__contains__,
        "this orientation convention is unknown",
        choices(),
    ),
    WithJsonSchema({"enum": list(CONVENTIONS)}),
]


class FileUnits(Model):
    """Units of the numbers in a file, unless a header such as ``x_mm`` states them."""

    length: Literal["m", "cm", "mm", "um", "in", "inch"] | None = None
    """Unit of positions. Null: the unit in the header, or m."""
    angle: Literal["rad", "mrad", "deg"] | None = None
    """Unit of yaw and orientations. Null: the unit in the header, or rad. Required for roll, pitch, yaw and for angles
    of KUKA, Staubli and Fanuc."""
    speed: Literal["m/s", "mm/s", "m/min", "mm/min", "in/min", "inch/min"] | None = None
    """Unit of feed rates. Null: the unit in the header, which is then required."""


class FitTolerance(Model):
    """Maximum deviations of points from the path, with a unit (0.05 mm, 0.1 deg) or in m and rad."""

    position: Length
    """Maximum distance of a point from the path."""
    orientation: Angle = ANGLES["deg"] / 10.0
    """Maximum angle between a given orientation or yaw and that of the path; by default 0.1 deg."""
    corner: Length | None = None
    """Maximum distance at a rounded corner. Null: as position."""

    @property
    def at_corners(self) -> float:
        """Maximum distance of a point from the path where a corner is rounded, m."""
        return self.corner or self.position


CornerMode = Literal["blend", "refuse", "stop"]


class PointFile(Model):
    """Points in a CSV or G-code file; `brachis.task.load_task` reads them and turns them into a smooth curve."""

    file: Name
    """CSV or G-code file (.nc, .ngc, .gcode, .tap)."""
    relative: Flag = False
    """Whether all points are moved so that the first one is at the start of the segment."""
    orientation: OrientationWord | None = Field(
        default=None,
        description="Convention of the orientation columns, if their names do not state it:  "
        f"{', '.join(CONVENTIONS)}.",
    )
    units: FileUnits = Field(default_factory=FileUnits)
    """Units of the numbers in the file."""
    tolerance: FitTolerance | None = None
    """Maximum deviations of the points from the path: {position: 0.1 mm, orientation: 0.5 deg}. Null: the path passes
    through all points."""
    corner: CornerMode = "blend"
    """blend: corners are rounded within the tolerance. stop: the tool stops at corners. refuse: an error lists them.
    Without a tolerance, corners are found only with stop."""


class FoundCorner(Model):
    """A corner found in the points."""

    row: Count
    """Line of the nearest point in the file, or its index in the array."""
    angle: Number
    """Change of direction at the corner, rad."""
    distance: Number
    """Distance of the corner from the first point, along the path, m."""
    blend: NonNegative
    """Length that the blend cuts from either side, m; 0 if the tool stops."""

    def __str__(self) -> str:
        """Return the angle and the row of the corner, as text."""
        return f"{degrees(self.angle):.3g} deg at row {self.row}"


class FitReport(Model):
    """The source of a fitted curve and its distances from the points; written by brachis."""

    source: Name
    """File of the points, or name of the argument that contains them."""
    points: Count
    """Number of points."""
    length: NonNegative
    """Length of the path, m."""
    position_error: NonNegative = 0.0
    """Largest distance of a point from the path, except at corners, m."""
    position_rms: NonNegative = 0.0
    """Root mean square of the distances of the points, m."""
    position_tolerance: NonNegative = 0.0
    """Maximum allowed distance, m; 0 if the path passes through all points."""
    orientation_error: NonNegative = 0.0
    """Largest angle between a given orientation and the fitted one, rad."""
    orientation_tolerance: NonNegative = 0.0
    """Maximum allowed angle, rad."""
    intervals: Count
    """Number of knot intervals of all curves fitted to these points."""
    corners: tuple[FoundCorner, ...] = ()
    """Corners, in the order of the path."""
    told: tuple[str, ...] = ()
    """Findings about the data, such as units and repeated rows."""
    doubt: str | None = None
    """Remark on implausible data."""
    profile: tuple[tuple[Number, Number, Number], ...] = ()
    """Rows [distance along the path (m), largest distance (m) and largest angle (rad) of the points there]."""

    @property
    def listed_corners(self) -> str:
        """Text that lists the first ten corners."""
        return name_first([str(corner) for corner in self.corners], ", ", count=10)

    def __str__(self) -> str:
        """Return the report as one line of text, with lengths in mm."""
        corners = "no corners"
        if self.corners:
            is_blended = any(corner.blend for corner in self.corners)
            what = "blended" if is_blended else "at which the tool stops"
            count = write_count(len(self.corners), "corner")
            corners = f"{count} {what}: {self.listed_corners}"
        allowed = 1e3 * self.position_tolerance
        rms = 1e3 * self.position_rms
        intervals = write_count(self.intervals, "knot interval")
        statements = [
            f"{self.source}: {self.points} points along {1e3 * self.length:.5g} mm, {intervals}",
            f"at most {1e3 * self.position_error:.3g} mm off (allowed {allowed:.3g} mm), rms {rms:.3g} mm",
        ]
        if self.orientation_error:
            statements.append(
                f"orientation at most {degrees(self.orientation_error):.2g} deg off "
                f"(allowed {degrees(self.orientation_tolerance):.3g} deg)"
            )
        return "; ".join([*statements, corners, *self.told])

    def to_dict(self) -> dict[str, Any]:
        """Return the report as plain data for JSON, without the profile."""
        return self.model_dump(mode="json", exclude={"profile"})
