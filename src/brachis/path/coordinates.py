"""What the coordinates along a path are, to those who build it: rows of a task space, positions of joints, or poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from brachis.common import tolerances
from brachis.errors import PathError, check_names
from brachis.path.blends import blend_poses, blend_rows
from brachis.path.context import SegmentContext
from brachis.path.curves import (
    LineCurve,
    arc_center,
    arc_via,
    circle,
    helix,
    line_by,
    line_heading,
    line_to,
)
from brachis.path.joins import pose_corner, row_corner
from brachis.path.orientation import orientation_along, turn_of
from brachis.path.pose import pose_curve, rotations
from brachis.path.protocol import Array, Curve, MappedCurve
from brachis.path.splines import (
    bspline_curve,
    pose_bspline,
    pose_spline,
    spline_through,
)
from brachis.robot.task_map.protocol import joints_of
from brachis.task.orientation import AlongTangent
from brachis.task.point_data import PointFile
from brachis.task.segments import (
    ArcCenter,
    ArcVia,
    BSplineCurve,
    BSplineSegment,
    CircleTurns,
    HelixTurns,
    LineBy,
    LineHeading,
    LineSegment,
    LineTo,
    Segment,
    SplineSegment,
    SplineThrough,
    TurnSegment,
)


def _unread(shape: PointFile, context: SegmentContext) -> Curve:
    raise context.wrong(
        "the file has not been read",
        ".file",
        found=shape.file,
        allowed="a curve",
        hint="brachis.load_task reads it and makes a curve of it",
    )


BUILDERS: Final[dict[type, Callable[[Any, SegmentContext], Curve]]] = {
    LineTo: line_to,
    LineBy: line_by,
    LineHeading: line_heading,
    ArcCenter: arc_center,
    ArcVia: arc_via,
    CircleTurns: circle,
    HelixTurns: helix,
    SplineThrough: spline_through,
    BSplineCurve: bspline_curve,
    PointFile: _unread,
}
"""For every form of segment, the function that makes the curve of its rows, or of a pose's position."""


@dataclass(frozen=True)
class RowCoordinates:
    """Rows of a task space; the task velocity is their own derivative.

    Attributes
    ----------
    rows : tuple of str
        Names of the first coordinates, those of the position before others.
    """

    rows: tuple[str, ...]
    corner = staticmethod(row_corner)
    blend = staticmethod(blend_rows)

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of the segment with this index in the path, from its start on.

        Raises
        ------
        PathError
            The segment has zero length, or does not fit these coordinates.
        """
        context = SegmentContext(f"path[{index}].{segment.kind}", start, self.rows)
        if isinstance(segment, TurnSegment) or segment.orientation is not None:
            key = "turn" if isinstance(segment, TurnSegment) else "orientation"
            raise PathError(
                f"this {key} needs a task space of poses",
                found=f"task_space [{', '.join(self.rows)}]",
                where=f"path[{index}].{key}",
                hint="Set task_space: pose, or turn yaw by line: {by: [..., angle]}",
            )
        return BUILDERS[type(segment.shape)](segment.shape, context)


@dataclass(frozen=True)
class JointCoordinates(RowCoordinates):
    """The positions of all joints."""

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of a segment, whose coordinates may be in another order of the joints."""
        if not isinstance(segment, LineSegment | SplineSegment | BSplineSegment):
            by = ", ".join(["1.5708", *["0"] * (len(self.rows) - 1)])
            raise PathError(
                "a path of joints cannot have this segment",
                found=segment.kind,
                allowed="line: {to: ...}, line: {by: ...}, spline, bspline, csv",
                where=f"path[{index}]",
                hint=f"A turn of one joint by 90 degrees is line: {{by: [{by}]}}",
            )
        names = getattr(segment.shape, "joints", None)
        if names is None:
            return super().curve(segment, index, start)
        own = joints_of(self.rows)
        where = f"path[{index}].{segment.kind}.joints"
        check_names("joint", names, own, where)
        if len(names) != len(own):
            raise PathError(
                "joints are missing",
                found=list(names),
                allowed=", ".join(own),
                where=where,
            )
        order = [own.index(name) for name in names]
        permuted = RowCoordinates(tuple(self.rows[column] for column in order))
        columns = np.argsort(order)
        curve = permuted.curve(segment, index, start[order])
        return MappedCurve(curve, partial(_permute, columns))


def _permute(columns: np.ndarray, _sigma: Array, derivatives: Array) -> Array:
    return derivatives[:, :, columns]


@dataclass(frozen=True)
class PoseCoordinates(RowCoordinates):
    """Rows of the position, then the rotation matrix row by row; `rows` are those of the position."""

    corner = staticmethod(pose_corner)
    blend = staticmethod(blend_poses)

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of position and orientation along a segment."""
        position = start[: len(self.rows)]
        rotation = rotations(start)
        context = SegmentContext(f"path[{index}].{segment.kind}", position, self.rows)
        if isinstance(segment, TurnSegment):
            turn = turn_of(segment.turn, rotation, context.key)
            if abs(turn.angle) < tolerances.LENGTH:
                raise context.wrong(
                    "the turn has zero length",
                    found="0 degrees",
                    allowed="an orientation that differs from the one before",
                )
            still = LineCurve(position, np.zeros_like(position), abs(turn.angle))
            return pose_curve(still, turn.over(still.length))
        if not self.rows:
            raise context.wrong(
                "this segment moves the position, which is not in the task space",
                found=segment.kind,
                allowed="turn: {rotate: ...} or turn: {to: ...}",
            )
        shape = segment.shape
        if isinstance(shape, SplineThrough) and shape.orientations is not None:
            return pose_spline(shape, context, rotation)
        columns = len(self.rows) + 4
        if isinstance(shape, BSplineCurve) and len(shape.control_points[0]) == columns:
            return pose_bspline(shape, context, rotation)
        curve = BUILDERS[type(shape)](shape, context)
        key = f"path[{index}].orientation"
        turns = segment.orientation
        if turns == "tangent" or isinstance(turns, AlongTangent):
            context.need_rows("an orientation along the tangent", 3)
        turning = orientation_along(segment.orientation, curve, rotation, key)
        return pose_curve(curve, turning)
