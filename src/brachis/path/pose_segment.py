"""The curve of a segment in a task space of poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.bspline import POSE_COLUMNS, pose_bspline
from brachis.path.line import LineCurve
from brachis.path.orientation import orientation_along
from brachis.path.pose import POSITIONS, PoseCurve, rotations
from brachis.path.pose_spline import pose_spline
from brachis.path.shapes import curve_of
from brachis.path.site import ZERO_LENGTH, Site
from brachis.path.turns import turn_of
from brachis.robot.task_map.rows import AXES
from brachis.task import BSplineCurve, SplineThrough, TurnSegment

if TYPE_CHECKING:
    from brachis.path.protocol import Array, Curve
    from brachis.task import Segment

_TO_TURN = "A segment turn: {...} turns the tool on the spot"
_ALONG_TANGENT = "Set orientation: tangent beside it"


def pose_curve(segment: Segment, index: int, start: Array) -> Curve:
    """Return the curve of the twelve coordinates of the pose along a segment.

    Parameters
    ----------
    segment : Segment
        The segment.
    index : int
        Its index in the path, for messages.
    start : ndarray, shape (12,)
        Coordinates of the pose at its start.

    Raises
    ------
    PathError
        The segment has zero length, or position or orientation is not defined.
    """
    position, rotation = start[:POSITIONS], rotations(start)
    site = Site(f"path[{index}].{segment.kind}", position, AXES, _TO_TURN, _ALONG_TANGENT)
    if isinstance(segment, TurnSegment):
        turn = turn_of(segment.turn, rotation, site.key)
        if abs(turn.angle) < ZERO_LENGTH:
            problem = "the turn has zero length"
            raise PathError(problem, found="0 degrees", allowed="another orientation than before", where=site.key)
        still = LineCurve(position, np.zeros(POSITIONS), abs(turn.angle))
        return PoseCurve(still, turn.over(still.length))
    shape = segment.shape
    if isinstance(shape, SplineThrough) and shape.orientations is not None:
        return pose_spline(shape, shape.orientations, site, rotation)
    if isinstance(shape, BSplineCurve) and len(shape.control_points[0]) == POSE_COLUMNS:
        return pose_bspline(shape, site, rotation)
    curve = curve_of(shape, site)
    return PoseCurve(curve, orientation_along(segment.orientation, curve, rotation, f"path[{index}].orientation"))
