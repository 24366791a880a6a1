"""Smooth curves through poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.arrays import with_like_signs
from brachis.errors import PathError
from brachis.path.line import LineCurve
from brachis.path.pose import LEAST_QUALITY, PoseCurve, QuaternionPoseCurve
from brachis.path.rotations import quaternions_of, rotation_from, rotation_of
from brachis.path.sampling import smallest
from brachis.path.spline import START_TOLERANCE, chord_knots, interpolate, repeats_start, starts_elsewhere, waypoints_of
from brachis.path.turns import AMBIGUOUS, half_turn, turn_between
from brachis.plausibility import turn_hint

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.spatial.transform import Rotation

    from brachis.path.protocol import Array
    from brachis.path.site import Site
    from brachis.task import Attitude, SplineThrough


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
        chords, angles = np.linalg.norm(np.diff(points, axis=0), axis=1), _angles(turned)
    for i in np.flatnonzero(angles > np.pi - AMBIGUOUS):
        raise half_turn(f"{site.key}.orientations[{i + len(attitudes) - len(angles)}]")
    knots = chord_knots(chords, angles, shape, site)
    if len(points) == 2:  # noqa: PLR2004 - the start and one waypoint
        turn = turn_between(rotation, turned[1], f"{site.key}.orientations[{len(attitudes) - 1}]")
        position = LineCurve(points[0], (points[1] - points[0]) / knots[1], float(knots[1]))
        return PoseCurve(position, turn.over(position.length))
    quaternions = with_like_signs(quaternions_of(turned))
    curve = QuaternionPoseCurve(interpolate(knots, np.concatenate([points, quaternions], axis=1)))
    _check_quaternions(curve, site)
    return curve


def _angles(turned: Rotation) -> Array:
    """Return the angles, (n - 1,), rad, between n successive rotations."""
    return np.asarray((turned[:-1].inv() * turned[1:]).magnitude())


def _rotations(shape: SplineThrough, attitudes: Sequence[Attitude], site: Site, matrix: Array) -> Rotation:
    """Return the n rotations at the start and the waypoints."""
    start, given = rotation_of(matrix), [rotation_from(attitude) for attitude in attitudes]
    expected = None if shape.starts_oriented is None else rotation_from(shape.starts_oriented)
    if shape.relative:
        change = start if expected is None else start * expected.inv()
        given = [change * one for one in given]
    elif expected is not None and (angle := (start.inv() * expected).magnitude()) > START_TOLERANCE:
        hint = turn_hint(matrix, expected.as_matrix())
        raise starts_elsewhere(f"{site.key}.starts_oriented", f"an orientation that is {angle:.4g} rad off", hint)
    return start.concatenate([start, *given])


def _check_quaternions(curve: QuaternionPoseCurve, site: Site) -> None:
    sigma, least = smallest(curve.quality, curve.knots)
    if least < LEAST_QUALITY:
        near = int(np.searchsorted(curve.knots, sigma)) - 1
        problem = "the orientations differ too much, over too short a distance, for a smooth curve through them"
        raise PathError(
            problem,
            found=f"quaternions interpolated with a quality of {least:.2g} out of 1",
            allowed=f"{LEAST_QUALITY} or more",
            where=f"{site.key}.orientations[{max(near, 0)}]",
            hint="Give more waypoints, or orientations that are closer to each other",
        )
