"""The curve of a segment in a task space of poses.

Smooth curves through poses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.common.arrays import with_like_signs
from brachis.errors import PathError
from brachis.path.curves import LineCurve
from brachis.path.joins import smallest
from brachis.path.orientation import (
    AMBIGUOUS,
    half_turn,
    orientation_along,
    turn_between,
    turn_of,
)
from brachis.path.pose import (
    LEAST_QUALITY,
    POSITIONS,
    PoseCurve,
    QuaternionPoseCurve,
    rotations,
)
from brachis.path.rotations import quaternions_of, rotation_from, rotation_of
from brachis.path.shapes import curve_of
from brachis.path.site import ZERO_LENGTH, Site
from brachis.path.splines import (
    POSE_COLUMNS,
    START_TOLERANCE,
    chord_knots,
    interpolate,
    pose_bspline,
    repeats_start,
    starts_elsewhere,
    waypoints_of,
)
from brachis.robot.plausibility import turn_hint
from brachis.robot.task_map.protocol import AXES
from brachis.task import BSplineCurve, SplineThrough, TurnSegment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.spatial.transform import Rotation

    from brachis.path.protocol import Array, Curve
    from brachis.path.site import Site
    from brachis.task import Attitude, Segment, SplineThrough


def pose_spline(
    shape: SplineThrough, attitudes: Sequence[Attitude], site: Site, rotation: Array
) -> PoseCurve | QuaternionPoseCurve:
    """Return the smooth curve through poses; where there is only one, the line with a uniform turn.

    Position and quaternion are one natural quintic spline over the chord lengths of the positions (the angles between
    the orientations, where the position stands still). The quaternions' signs are such that neighbours are close.

    Parameters
    ----------
    shape : SplineThrough
        The waypoints.
    attitudes : sequence of Attitude
        The orientations at the waypoints.
    site : Site
        Place of the segment, in three position rows.
    rotation : ndarray, shape (3, 3)
        Rotation matrix of the tool at the segment's start.

    Raises
    ------
    PathError
        The segment starts elsewhere than its waypoints expect, or a waypoint repeats another one, or orientations are
        half a turn apart or turn back and forth too much.
    """
    points = waypoints_of(shape, site)
    turned = _rotations(shape, attitudes, site, rotation)
    chords, angles = np.linalg.norm(np.diff(points, axis=0), axis=1), _angles(turned)
    if repeats_start(np.hypot(chords, angles)):
        kept = np.delete(np.arange(len(points)), 1)
        points, turned = points[kept], turned[kept]
        chords, angles = (
            np.linalg.norm(np.diff(points, axis=0), axis=1),
            _angles(turned),
        )
    for i in np.flatnonzero(angles > np.pi - AMBIGUOUS):
        raise half_turn(f"{site.key}.orientations[{i + len(attitudes) - len(angles)}]")
    knots = chord_knots(chords, angles, shape, site)
    if len(points) == 2:
        turn = turn_between(
            rotation, turned[1], f"{site.key}.orientations[{len(attitudes) - 1}]"
        )
        position = LineCurve(
            points[0], (points[1] - points[0]) / knots[1], float(knots[1])
        )
        return PoseCurve(position, turn.over(position.length))
    quaternions = with_like_signs(quaternions_of(turned))
    curve = QuaternionPoseCurve(
        interpolate(knots, np.concatenate([points, quaternions], axis=1))
    )
    _check_quaternions(curve, site)
    return curve


def _angles(turned: Rotation) -> Array:
    """Return the angles, (n - 1,), rad, between n successive rotations."""
    return np.asarray((turned[:-1].inv() * turned[1:]).magnitude())


def _rotations(
    shape: SplineThrough, attitudes: Sequence[Attitude], site: Site, matrix: Array
) -> Rotation:
    """Return the n rotations at the start and the waypoints."""
    start, given = (
        rotation_of(matrix),
        [rotation_from(attitude) for attitude in attitudes],
    )
    expected = (
        None if shape.starts_oriented is None else rotation_from(shape.starts_oriented)
    )
    if shape.relative:
        change = start if expected is None else start * expected.inv()
        given = [change * one for one in given]
    elif (
        expected is not None
        and (angle := (start.inv() * expected).magnitude()) > START_TOLERANCE
    ):
        raise starts_elsewhere(
            f"{site.key}.starts_oriented",
            f"an orientation that is {angle:.4g} rad off",
            turn_hint(matrix, expected.as_matrix()),
        )
    return start.concatenate([start, *given])


def _check_quaternions(curve: QuaternionPoseCurve, site: Site) -> None:
    sigma, least = smallest(curve.quality, curve.knots)
    if least < LEAST_QUALITY:
        near = int(np.searchsorted(curve.knots, sigma)) - 1
        raise PathError(
            "the orientations differ too much, over too short a distance, for a smooth curve through them",
            found=f"quaternions interpolated with a quality of {least:.2g} out of 1",
            allowed=f"{LEAST_QUALITY} or more",
            where=f"{site.key}.orientations[{max(near, 0)}]",
            hint="Give more waypoints, or orientations that are closer to each other",
        )


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
    site = Site(
        f"path[{index}].{segment.kind}", position, AXES, _TO_TURN, _ALONG_TANGENT
    )
    if isinstance(segment, TurnSegment):
        turn = turn_of(segment.turn, rotation, site.key)
        if abs(turn.angle) < ZERO_LENGTH:
            raise PathError(
                "the turn has zero length",
                found="0 degrees",
                allowed="another orientation than before",
                where=site.key,
            )
        still = LineCurve(position, np.zeros(POSITIONS), abs(turn.angle))
        return PoseCurve(still, turn.over(still.length))
    shape = segment.shape
    if isinstance(shape, SplineThrough) and shape.orientations is not None:
        return pose_spline(shape, shape.orientations, site, rotation)
    if isinstance(shape, BSplineCurve) and len(shape.control_points[0]) == POSE_COLUMNS:
        return pose_bspline(shape, site, rotation)
    curve = curve_of(shape, site)
    return PoseCurve(
        curve,
        orientation_along(
            segment.orientation, curve, rotation, f"path[{index}].orientation"
        ),
    )
