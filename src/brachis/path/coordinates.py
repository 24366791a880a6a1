"""What the coordinates along a path are, to those who build it.

Paths of rows of a task space, where the tool's orientation is not prescribed.

Paths in a space of joints, where every joint is prescribed.

Paths of poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from brachis.errors import PathError, UnknownNameError
from brachis.path.blends import blend_poses, blend_rows
from brachis.path.joins import pose_corner, row_corner
from brachis.path.pose import POSITIONS, PosePath, rotations
from brachis.path.pose_segment import pose_curve
from brachis.path.rotations import matrices, quaternions_of, rotation_of
from brachis.path.shapes import curve_of
from brachis.path.site import Site
from brachis.robot.task_map.protocol import AXES, POSE_COORDINATES, ROWS, YAW, joints_of
from brachis.task import (
    BSplineCurve,
    BSplineSegment,
    LineSegment,
    SplineSegment,
    SplineThrough,
    TurnSegment,
)

if TYPE_CHECKING:
    from brachis.path.joins import Corner, Join
    from brachis.path.protocol import Array, Curve, Path
    from brachis.path.sequence import SequencePath
    from brachis.task import Segment


class Coordinates(Protocol):
    """Rows of a task space, or the coordinates of poses."""

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the first coordinates, those of the position before others."""
        ...

    def checked(self, start: Array) -> Array:
        """Return the coordinates of the path's start after a check, freed of rounding.

        Raises
        ------
        PathError, UnknownNameError
        """
        ...

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of the segment with this index in the path, from its start on.

        Raises
        ------
        PathError
            The segment has zero length, or does not fit these coordinates.
        """
        ...

    def corner(self, join: Join, first: Curve, second: Curve) -> Corner | None:
        """Return what jumps from one curve to the next, or None where three derivatives continue."""
        ...

    def blend(self, first: Curve, second: Curve, size: float, join: Join) -> Curve:
        """Return the curve that replaces the last `size` (sigma) of one curve and the first `size` of the next.

        Raises
        ------
        PathError
            The blend does not fit.
        """
        ...

    def path(self, sequence: SequencePath) -> Path:
        """Return the path of the task velocity along the coordinates."""
        ...


@dataclass(frozen=True)
class RowCoordinates:
    """Rows of a task space; see `Coordinates`."""

    rows: tuple[str, ...]
    corner = staticmethod(row_corner)
    blend = staticmethod(blend_rows)

    def checked(self, start: Array) -> Array:
        """See `Coordinates.checked`."""
        for row in self.rows:
            if row not in ROWS:
                raise UnknownNameError(
                    kind="row of the task space",
                    name=row,
                    valid=ROWS,
                    where="task_space",
                )
        if start.shape != (len(self.rows),) or not np.all(np.isfinite(start)):
            raise PathError(
                "the start of the path needs one finite coordinate for each row of the task space",
                found=start.tolist(),
                allowed=f"[{', '.join(self.rows)}]",
                where="start",
            )
        return start

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """See `Coordinates.curve`."""
        found, hint = f"task_space [{', '.join(self.rows)}]", "Set task_space: pose"
        if isinstance(segment, TurnSegment):
            problem = "a turn is for task spaces of poses"
            if YAW in self.rows:
                hint = "Use line: {by: [0, 0, ...]} to turn yaw"
            raise PathError(
                problem, found=found, where=f"path[{index}].turn", hint=hint
            )
        if segment.orientation is not None:
            raise PathError(
                "an orientation along a segment is for task spaces of poses",
                found=found,
                where=f"path[{index}].orientation",
                hint=hint,
            )
        return curve_of(
            segment.shape, Site(f"path[{index}].{segment.kind}", start, self.rows)
        )

    def path(self, sequence: SequencePath) -> SequencePath:
        """See `Coordinates.path`: the task velocity is the coordinates' own derivative."""
        return sequence


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
        names = (
            shape.joints if isinstance(shape, SplineThrough | BSplineCurve) else None
        )
        if names is None:
            return super().curve(segment, index, start)
        own, where = joints_of(self.rows), f"path[{index}].{segment.kind}.joints"
        unknown = [name for name in names if name not in own]
        if unknown:
            raise UnknownNameError("joint", unknown[0], own, where=where)
        if len(names) != len(own):
            raise PathError(
                "joints are missing",
                found=list(names),
                allowed=", ".join(own),
                where=where,
            )
        order = [own.index(name) for name in names]
        other = JointCoordinates(tuple(self.rows[place] for place in order))
        return Reordered(
            super(JointCoordinates, other).curve(segment, index, start[order]),
            [names.index(joint) for joint in own],
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


_ROTATION_TOLERANCE = 1e-6


@dataclass(frozen=True)
class PoseCoordinates:
    """The twelve coordinates of poses; see `Coordinates`."""

    rows: tuple[str, ...] = AXES
    curve = staticmethod(pose_curve)
    corner = staticmethod(pose_corner)
    blend = staticmethod(blend_poses)
    path = staticmethod(PosePath)

    def checked(self, start: Array) -> Array:
        """See `Coordinates.checked`."""
        allowed = "the position (3), then a rotation matrix row by row (9)"
        if start.shape != (POSE_COORDINATES,) or not np.all(np.isfinite(start)):
            raise PathError(
                "the start of a path of poses needs 12 finite coordinates",
                found=start.tolist(),
                allowed=allowed,
                where="start",
            )
        rotation = rotations(start)
        stretch = np.abs(rotation @ rotation.T - np.eye(3)).max()
        if stretch > 2.0 * _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0.0:
            raise PathError(
                "the start of the path has no rotation matrix",
                found=rotation.tolist(),
                allowed=allowed,
                where="start",
            )
        nearest = matrices(quaternions_of(rotation_of(rotation))[None])[0]
        return np.concatenate([start[:POSITIONS], nearest.ravel()])
