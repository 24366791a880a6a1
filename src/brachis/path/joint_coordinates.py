"""Paths in a space of joints, where every joint is prescribed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from brachis.errors import PathError, UnknownNameError
from brachis.path.row_coordinates import RowCoordinates
from brachis.robot.task_map.rows import joints_of
from brachis.task import BSplineCurve, BSplineSegment, LineSegment, SplineSegment, SplineThrough

if TYPE_CHECKING:
    from brachis.path.protocol import Array, Curve
    from brachis.task import Segment


@dataclass(frozen=True)
class JointCoordinates(RowCoordinates):
    """Rows of a space of joints; see `Coordinates`."""

    def checked(self, start: Array) -> Array:
        """See `Coordinates.checked`; the start is a posture of the robot, or stated as one."""
        return start

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """See `Coordinates.curve`."""
        if not isinstance(segment, LineSegment | SplineSegment | BSplineSegment):
            by = ", ".join(["1.5708", *["0"] * (len(self.rows) - 1)])
            raise PathError(
                "a path of joints cannot have this segment",
                found=segment.kind,
                allowed="line: {to: ...}, line: {by: ...}, spline, bspline, csv",
                where=f"path[{index}]",
                hint=f"A turn of one joint by 90 degrees is line: {{by: [{by}]}}",
            )
        shape = segment.shape
        names = shape.joints if isinstance(shape, SplineThrough | BSplineCurve) else None
        if names is None:
            return super().curve(segment, index, start)
        own, where = joints_of(self.rows), f"path[{index}].{segment.kind}.joints"
        unknown = [name for name in names if name not in own]
        if unknown:
            raise UnknownNameError("joint", unknown[0], own, where=where)
        if len(names) != len(own):
            raise PathError("joints are missing", found=list(names), allowed=", ".join(own), where=where)
        order = [own.index(name) for name in names]
        other = JointCoordinates(tuple(self.rows[place] for place in order))
        return Reordered(
            super(JointCoordinates, other).curve(segment, index, start[order]), [names.index(joint) for joint in own]
        )


@dataclass(frozen=True, eq=False)
class Reordered:
    """A curve whose columns stand in another order.

    Attributes
    ----------
    curve : Curve
    columns : list of int
        Columns of the curve in the order wanted.
    """

    curve: Curve
    columns: list[int]

    @property
    def length(self) -> float:
        """See `Curve`."""
        return self.curve.length

    @property
    def knots(self) -> Array:
        """See `Curve`."""
        return self.curve.knots

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """See `Curve`."""
        return self.curve.derivatives(sigma, order)[:, :, self.columns]
