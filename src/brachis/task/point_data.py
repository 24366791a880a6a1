"""Points of a path from files, as the task file writes them, and the smooth curves that are fitted to them."""

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
    """Units of the numbers in a file; a header such as ``x_mm`` states them too."""

    length: Literal["m", "cm", "mm", "um", "in", "inch"] | None = None
    """Unit of positions. Null: the header's unit, or m."""
    angle: Literal["rad", "mrad", "deg"] | None = None
    """Unit of yaw and orientations. Null: the header's unit, or rad; required for roll, pitch, yaw and angles of KUKA,
    Staubli and Fanuc."""
    speed: Literal["m/s", "mm/s", "m/min", "mm/min", "in/min", "inch/min"] | None = None
    """Unit of feed rates. Null: the header's unit, which is then required."""


class FitTolerance(Model):
    """How far points may be from the path; numbers with their unit (0.05 mm, 0.1 deg), or in m and rad."""

    position: Length
    """Largest distance of a point from the path."""
    orientation: Angle = ANGLES["deg"] / 10.0
    """Largest angle between a given orientation or yaw and the path's; by default 0.1 deg."""
    corner: Length | None = None
    """The same at a rounded corner. Null: as position."""

    @property
    def at_corners(self) -> float:
        """The largest distance where a corner is rounded, m."""
        return self.corner or self.position


CornerMode = Literal["blend", "refuse", "stop"]


class PointFile(Model):
    """Points from a CSV file or from G-code; `brachis.task.load_task` reads it and makes a smooth curve of it."""

    file: Name
    """CSV or G-code file (.nc, .ngc, .gcode, .tap)."""
    relative: Flag = False
    """Whether points are moved so that the first one is at the segment's start, as in a spline."""
    orientation: OrientationWord | None = Field(
        default=None,
        description="Convention of the orientation columns, if their names do not define it: "
        f"{', '.join(CONVENTIONS)}.",
    )
    units: FileUnits = Field(default_factory=FileUnits)
    """Units of the numbers in the file."""
    tolerance: FitTolerance | None = None
    """Largest distances of the points from the path: {position: 0.1 mm, orientation: 0.5 deg}. Null: the path passes
    through all points."""
    corner: CornerMode = "blend"
    """What happens at corners. blend: they are rounded within the tolerance. stop: the tool stops. refuse: an error
    lists them. Without a tolerance only stop finds corners."""


class FoundCorner(Model):
    """A corner of the points."""

    row: Count
    """Line of the file, or index, of the nearest point."""
    angle: Number
    """Change of direction, rad."""
    distance: Number
    """Along the path from its first point, m."""
    blend: NonNegative
    """What its blend takes from either side, m; 0 where the tool stops."""

    def __str__(self) -> str:
        """Say how sharp it is, and where."""
        return f"{degrees(self.angle):.3g} deg at row {self.row}"


class FitReport(Model):
    """Where a curve comes from, and how near it is to the points; written by brachis."""

    source: Name
    """File, or what the points were given as."""
    points: Count
    """Number of points."""
    length: NonNegative
    """Length of the path, m."""
    position_error: NonNegative = 0.0
    """Largest distance of a point from the path, m, beside corners."""
    position_rms: NonNegative = 0.0
    """Root mean square of the distances, m."""
    position_tolerance: NonNegative = 0.0
    """What was allowed, m; 0 where all points are passed."""
    orientation_error: NonNegative = 0.0
    """Largest angle between given and fitted orientation, rad."""
    orientation_tolerance: NonNegative = 0.0
    """What was allowed, rad."""
    intervals: Count
    """Number of knot intervals of all curves of these points."""
    corners: tuple[FoundCorner, ...] = ()
    """Corners, in order."""
    told: tuple[str, ...] = ()
    """What was found out about the data."""
    doubt: str | None = None
    """What looks implausible in the data."""
    profile: tuple[tuple[Number, Number, Number], ...] = ()
    """Along the path, m: the largest distance, m, and angle, rad, of the points there."""

    @property
    def listed_corners(self) -> str:
        """The first ten corners."""
        return name_first([str(corner) for corner in self.corners], ", ", count=10)

    def __str__(self) -> str:
        """Say it in one line, lengths in mm."""
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
        """Return plain data for JSON, without the profile."""
        return self.model_dump(mode="json", exclude={"profile"})
