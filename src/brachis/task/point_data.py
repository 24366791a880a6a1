"""Files of points, as the task file states them, and reports of the smooth curves fitted to the points."""

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
        "this convention of an orientation is unknown",
        choices(),
    ),
    WithJsonSchema({"enum": list(CONVENTIONS)}),
]


class FileUnits(Model):
    """Units of the numbers in a file, unless a header such as ``x_mm`` states them."""

    length: Literal["m", "cm", "mm", "um", "in", "inch"] | None = None
    """Unit of positions. Null: the header's unit, or m."""
    angle: Literal["rad", "mrad", "deg"] | None = None
    """Unit of yaw and orientations. Null: the header's unit, or rad; required for roll, pitch, yaw and angles of KUKA,
    Staubli and Fanuc."""
    speed: Literal["m/s", "mm/s", "m/min", "mm/min", "in/min", "inch/min"] | None = None
    """Unit of feed rates. Null: the header's unit, which is then required."""


class FitTolerance(Model):
    """Largest distances of points from the path, with a unit (0.05 mm, 0.1 deg) or in m and rad."""

    position: Length
    """Largest distance of a point from the path."""
    orientation: Angle = ANGLES["deg"] / 10.0
    """Largest angle between a given orientation or yaw and that of the path; by default 0.1 deg."""
    corner: Length | None = None
    """Largest distance at a rounded corner. Null: as position."""

    @property
    def at_corners(self) -> float:
        """Largest distance of a point from the path where a corner is rounded, m."""
        return self.corner or self.position


CornerMode = Literal["blend", "refuse", "stop"]


class PointFile(Model):
    """Points in a CSV or G-code file, which `brachis.task.load_task` reads and turns into a smooth curve."""

    file: Name
    """CSV or G-code file (.nc, .ngc, .gcode, .tap)."""
    relative: Flag = False
    """Whether points are moved so that the first one is at the start of the segment."""
    orientation: OrientationWord | None = Field(
        default=None,
        description="Convention of the orientation columns, if their names leave it open: "
        f"{', '.join(CONVENTIONS)}.",
    )
    units: FileUnits = Field(default_factory=FileUnits)
    """Units of the numbers in the file."""
    tolerance: FitTolerance | None = None
    """Largest distances of the points from the path: {position: 0.1 mm, orientation: 0.5 deg}. Null: the path passes
    through all points."""
    corner: CornerMode = "blend"
    """blend: corners are rounded within the tolerance. stop: the tool stops there. refuse: an error lists them. Only
    stop finds corners without a tolerance."""


class FoundCorner(Model):
    """A corner found in the points."""

    row: Count
    """Line in the file, or index in the array, of the nearest point."""
    angle: Number
    """Change of direction, rad."""
    distance: Number
    """Distance along the path from its first point, m."""
    blend: NonNegative
    """Length that its blend takes from either side, m; 0 if the tool stops."""

    def __str__(self) -> str:
        """Return its angle and its row."""
        return f"{degrees(self.angle):.3g} deg at row {self.row}"


class FitReport(Model):
    """The source of a curve and its distances from the points; written by brachis."""

    source: Name
    """File, or name of the argument with the points."""
    points: Count
    """Number of points."""
    length: NonNegative
    """Length of the path, m."""
    position_error: NonNegative = 0.0
    """Largest distance of a point from the path, corners left out, m."""
    position_rms: NonNegative = 0.0
    """Root mean square of the distances, m."""
    position_tolerance: NonNegative = 0.0
    """Allowed distance, m; 0 if the path passes through all points."""
    orientation_error: NonNegative = 0.0
    """Largest angle between a given and the fitted orientation, rad."""
    orientation_tolerance: NonNegative = 0.0
    """Allowed angle, rad."""
    intervals: Count
    """Number of knot intervals of all curves fitted to these points."""
    corners: tuple[FoundCorner, ...] = ()
    """Corners, in order."""
    told: tuple[str, ...] = ()
    """Findings about the data, such as units and repeated rows."""
    doubt: str | None = None
    """Remark on data that look implausible."""
    profile: tuple[tuple[Number, Number, Number], ...] = ()
    """Rows [distance along the path, m, largest distance, m, and largest angle, rad, of the points there]."""

    @property
    def listed_corners(self) -> str:
        """List of the first ten corners."""
        return name_first([str(corner) for corner in self.corners], ", ", count=10)

    def __str__(self) -> str:
        """Return the report in one line, with lengths in mm."""
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
