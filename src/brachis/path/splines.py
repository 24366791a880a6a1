"""Smooth curves through waypoints, and B-splines given by knots and control points, for rows or poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import with_like_signs
from brachis.errors import PathError
from brachis.kernel import Spline
from brachis.path.context import SegmentContext, place
from brachis.path.curves import LineCurve, SplineCurve
from brachis.path.orientation import AMBIGUOUS, half_turn, turn_between
from brachis.path.pose import LEAST_QUALITY, least_quality, pose_curve, quaternion_curve
from brachis.path.protocol import Array, MappedCurve
from brachis.path.rotations import quaternion_product, rotation_of
from brachis.robot.plausibility import place_hint, turn_hint
from brachis.robot.task_map.protocol import joints_of
from brachis.task.points.points import is_repeated, steps_of, sum_up
from brachis.task.points.units import quaternions_of
from brachis.task.segments import BSplineCurve, SplineThrough

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

START_TOLERANCE = 1e-4
"""Maximum distance between the start of a segment and the start that its waypoints expect, m and rad."""


def spline_through(
    shape: SplineThrough, context: SegmentContext
) -> SplineCurve | LineCurve:
    """Return the smooth curve from the segment's start through waypoints; for a single waypoint, it is a line."""
    if shape.orientations is not None:
        raise context.wrong(
            "orientations need a task space of poses",
            ".orientations",
            found=f"task_space [{', '.join(context.rows)}]",
            hint="Set task_space: pose",
        )
    waypoints = _waypoints_of(shape, context)
    if _repeats_start(steps_of(waypoints)):
        waypoints = np.delete(waypoints, 1, axis=0)
    chords = steps_of(waypoints[:, : len(context.positions)])
    knots = _chord_knots(chords, steps_of(waypoints), shape, context)
    return _interpolate(knots, waypoints)


def pose_spline(
    shape: SplineThrough, context: SegmentContext, rotation: Array
) -> MappedCurve:
    """Return the smooth curve through poses; for a single pose, it is a line with a uniform turn.

    Position and quaternion form one natural quintic spline over the chord lengths of the positions, or over the angles
    between the orientations if the position stands still. The signs of the quaternions are chosen so that successive
    quaternions are close.

    Parameters
    ----------
    shape : SplineThrough
        The waypoints of the segment, with orientations.
    context : SegmentContext
        Context of the segment, in position rows.
    rotation : ndarray, shape (3, 3)
        Rotation matrix of the tool at the segment's start.

    Raises
    ------
    PathError
        The segment does not start where its waypoints expect, a waypoint repeats another one, orientations are half a
        turn apart, or they turn back and forth too much.
    """
    points = _waypoints_of(shape, context)
    turned = _rotations(shape, context, rotation)
    if _repeats_start(np.hypot(steps_of(points), _angles(turned))):
        distinct = np.delete(np.arange(len(points)), 1)
        points = points[distinct]
        turned = turned[distinct]
    angles = _angles(turned)
    for i in np.flatnonzero(angles > np.pi - AMBIGUOUS):
        raise half_turn(
            f"{context.key}.orientations[{i + len(shape.through) - len(angles)}]"
        )
    knots = _chord_knots(steps_of(points), angles, shape, context)
    if len(points) == 2:
        last = f"{context.key}.orientations[{len(shape.through) - 1}]"
        turn = turn_between(rotation, turned[1], last)
        position = _interpolate(knots, points)
        return pose_curve(position, turn.over(position.length))
    quaternions = with_like_signs(quaternions_of(turned))
    columns = _interpolate(knots, np.concatenate([points, quaternions], axis=1))
    sigma, least = least_quality(columns)
    if least < LEAST_QUALITY:
        near = int(np.searchsorted(columns.knots, sigma)) - 1
        raise context.wrong(
            "the orientations differ too much over too short a distance for a smooth curve through them",
            f".orientations[{max(near, 0)}]",
            found=f"quaternions interpolated with a quality of {least:.2g} out of 1",
            allowed=f"{LEAST_QUALITY} or more",
            hint="Give more waypoints, or orientations that are closer to each other",
        )
    return quaternion_curve(columns)


def _angles(turned: Rotation) -> Array:
    """Return the angles between n successive rotations, (n - 1,), rad."""
    return np.asarray((turned[:-1].inv() * turned[1:]).magnitude())


def _rotations(
    shape: SplineThrough, context: SegmentContext, matrix: Array
) -> Rotation:
    """Return the n rotations at the start and at the waypoints."""
    start = rotation_of(matrix)
    waypoints = [attitude.rotation for attitude in shape.orientations or ()]
    expected = start
    if shape.starts_oriented is not None:
        expected = shape.starts_oriented.rotation
        angle = (start.inv() * expected).magnitude()
        if not shape.relative and angle > START_TOLERANCE:
            raise _starts_elsewhere(
                context,
                ".starts_oriented",
                f"an orientation that is {angle:.4g} rad off",
                turn_hint(matrix, expected.as_matrix()),
            )
    if shape.relative:
        change = start if shape.starts_oriented is None else start * expected.inv()
        waypoints = [change * waypoint for waypoint in waypoints]
    return start.concatenate([start, *waypoints])


def _waypoints_of(shape: SplineThrough, context: SegmentContext) -> Array:
    """Return the segment's start and the waypoints, shape (n, m).

    Raises
    ------
    PathError
        A waypoint has the wrong number of coordinates, or the segment does not start where its waypoints expect.
    """
    start = context.start
    points = [
        context.coordinates(point, f"through[{i}]", context.rows)
        for i, point in enumerate(shape.through)
    ]
    expected = None
    if shape.starts_at is not None:
        expected = context.coordinates(shape.starts_at, "starts_at", context.rows)
    if shape.relative:
        origin = 0.0 if expected is None else expected
        points = [point + start - origin for point in points]
    elif expected is not None:
        _check_start(".starts_at", start - expected, context)
    return np.stack([start, *points])


def _repeats_start(steps: Array) -> bool:
    """Tell from the steps between the start and the waypoints, (n - 1,), whether the first waypoint is the start.

    The waypoint counts as the start if its distance from the start is within the tolerance, and within 1 % of the
    distance to the next waypoint.
    """
    return len(steps) > 1 and bool(is_repeated(steps, START_TOLERANCE)[0])


def _check_start(key: str, off: Array, context: SegmentContext) -> None:
    """Reject a segment whose start differs from the expected start by `off`, m in position rows and rad in other rows.

    Raises
    ------
    PathError
    """
    moved, turned = np.split(off, [len(context.positions)])
    hint = place_hint(context.position, context.position - moved, context.positions)
    unit = "rad or m" if joints_of(context.rows) else "m"
    for away, of, looks in ((moved, unit, hint), (turned, "rad", None)):
        distance = np.linalg.norm(away)
        if distance > START_TOLERANCE:
            raise _starts_elsewhere(
                context,
                key,
                f"{place(context.rows, context.start)}, {distance:.4g} {of} off",
                looks,
            )


def _starts_elsewhere(
    context: SegmentContext, key: str, found: str, hint: str | None
) -> PathError:
    """Return the error for a segment that does not start where its waypoints expect, with an optional hint."""
    return context.wrong(
        "the segment does not start where its waypoints expect",
        key,
        found=found,
        allowed=f"at most {START_TOLERANCE:g} m and rad off",
        hint=hint
        or "Set relative: true to count from the segment's start, or begin the path there",
    )


def _chord_knots(
    chords: Array, otherwise: Array, shape: SplineThrough, context: SegmentContext
) -> Array:
    """Return the cumulative chord lengths, shape (n,), of n waypoints.

    Parameters
    ----------
    chords : ndarray, shape (n - 1,)
        Distances between successive waypoints, m.
    otherwise : ndarray, shape (n - 1,)
        Distances to use if all positions are the same, rad.
    shape : SplineThrough
        The waypoints of the segment.
    context : SegmentContext
        Context of the segment.

    Raises
    ------
    PathError
        Nothing moves, or a waypoint repeats the previous one.
    """
    if np.all(chords < tolerances.LENGTH):
        chords = otherwise
    if np.all(chords < tolerances.LENGTH):
        raise context.zero_length(
            ".through", [list(waypoint) for waypoint in shape.through]
        )
    repeats = is_repeated(chords)
    if repeats.any():
        i = int(np.argmax(repeats))
        repeated = i + len(shape.through) - len(chords)
        raise context.wrong(
            "a waypoint repeats the previous one",
            f".through[{repeated}]",
            found=f"{list(shape.through[repeated])}, {chords[i]:.3g} (m or rad) away",
            allowed="waypoints that differ from their predecessors in the position rows",
            hint="Remove one of the two",
        )
    return sum_up(chords)


def _interpolate(knots: Array, waypoints: Array) -> SplineCurve | LineCurve:
    """Return the natural quintic spline, or the line, through waypoints of shape (n, m) at knots of shape (n,).

    The spline is C4. Of all curves through the waypoints, the spline has the least integral of the squared third
    derivative. The third and fourth derivatives of the spline vanish at both ends. Through three waypoints, the spline
    is a parabola.

    Raises
    ------
    PathError
        The distances between the waypoints differ so much that no spline can be computed.
    """
    if len(waypoints) == 2:
        slope = (waypoints[1] - waypoints[0]) / knots[1]
        return LineCurve(waypoints[0], slope, float(knots[1]))
    try:
        return SplineCurve(_natural(knots, waypoints), float(knots[-1]), knots)
    except ValueError as error:  # coincident knots, or singular equations
        distances = steps_of(waypoints)
        raise PathError(
            "no spline goes through the waypoints: their distances differ too much",
            found=f"distances from {distances.min():.3g} to {distances.max():.3g} (m or rad)",
            allowed="waypoints at similar distances",
            where="path",
        ) from error


def _natural(knots: Array, waypoints: Array) -> Spline:
    # Imported here because it takes half a second, and tasks without a spline do not need it.
    from scipy.interpolate import make_interp_spline

    # With a parameter in [0, 1], derivatives at the ends have the same magnitude as the values.
    unit = knots / knots[-1]
    if len(knots) == 3:
        # The end conditions define a parabola, but solving them as equations loses digits if a chord is short.
        spline = make_interp_spline(unit, waypoints, k=2, t=np.repeat([0.0, 1.0], 3))
    else:
        zero = np.zeros(waypoints.shape[1])
        ends = [(3, zero), (4, zero)]
        # SciPy documents conditions on chosen derivatives, but its type stubs lack them.
        spline = make_interp_spline(unit, waypoints, k=5, bc_type=(ends, ends))  # type: ignore[arg-type]
    return Spline(spline.t * knots[-1], spline.c, spline.k)


def bspline_curve(shape: BSplineCurve, context: SegmentContext) -> SplineCurve:
    """Return the curve of a segment, moved to the segment's start without a change of shape.

    Raises
    ------
    PathError
        All control points are the same, they have the wrong number of coordinates, or the curve does not start where
        the segment starts.
    """
    key = "control_points[0]"
    first = context.coordinates(shape.control_points[0], key, context.rows)
    points = np.array(shape.control_points)
    off = context.start - first
    if not shape.relative:
        _check_start(f".{key}", off, context)
    if not np.ptp(points, axis=0).any():
        raise context.wrong(
            "the segment has zero length", allowed="control points that differ"
        )
    return _of_control_points(shape, points + off)


def pose_bspline(
    shape: BSplineCurve, context: SegmentContext, rotation: Array
) -> MappedCurve:
    """Return the curve of poses, moved and turned to the segment's start.

    Parameters
    ----------
    shape : BSplineCurve
        The curve's control points, with quaternions.
    context : SegmentContext
        Context of the segment, in position rows.
    rotation : ndarray, shape (3, 3)
        Rotation matrix of the tool at the segment's start.

    Raises
    ------
    PathError
        The curve does not start where the segment starts.
    """
    points = np.array(shape.control_points)
    first = points[0, -4:] / np.linalg.norm(points[0, -4:])
    start = quaternions_of(rotation_of(rotation))
    turn = quaternion_product(start, first * [1.0, -1.0, -1.0, -1.0])
    off = context.start - points[0, :-4]
    if not shape.relative:
        all_off = np.concatenate([off, 2.0 * turn[1:]])
        _check_start(".control_points[0]", all_off, context)
    points[:, :-4] += off
    points[:, -4:] = quaternion_product(turn, points[:, -4:])
    return quaternion_curve(_of_control_points(shape, points))


def _of_control_points(shape: BSplineCurve, points: Array) -> SplineCurve:
    """Return the curve with these control points, (n, m), beginning at sigma = 0."""
    spline = Spline(np.array(shape.knots) - shape.knots[0], points, shape.degree)
    breaks = np.unique(spline.knots)
    return SplineCurve(spline, float(breaks[-1]), breaks)
