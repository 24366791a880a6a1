"""B-spline curves that are given by knots and control points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.pose import POSITIONS, QuaternionPoseCurve
from brachis.path.rotations import quaternions_of, rotation_of
from brachis.path.spline import START_TOLERANCE, SplineCurve, starts_elsewhere
from brachis.plausibility import place_hint

if TYPE_CHECKING:
    from brachis.path.protocol import Array
    from brachis.path.site import Site
    from brachis.task import BSplineCurve

POSE_COLUMNS = 7
"""Of control points with quaternions."""


def bspline_curve(shape: BSplineCurve, site: Site) -> SplineCurve:
    """Return the curve, moved to the segment's start: it keeps its form to the last digit of the start.

    Raises
    ------
    PathError
        Control points are all the same or have the wrong number of coordinates, or the curve starts elsewhere than the
        segment.
    """
    first = site.coordinates(shape.control_points[0], "control_points[0]", site.rows)
    points, off = np.array(shape.control_points), site.start - first
    if not shape.relative:
        _check_start(off[: len(site.positions)], off[len(site.positions) :], site)
    if not np.ptp(points, axis=0).any():
        raise PathError("the segment has zero length", allowed="control points that differ", where=site.key)
    return _curve(shape, points + off)


def pose_bspline(shape: BSplineCurve, site: Site, rotation: Array) -> QuaternionPoseCurve:
    """Return the curve of poses, moved and turned to the segment's start.

    Parameters
    ----------
    shape : BSplineCurve
        Control points with quaternions.
    site : Site
        Place of the segment, in three position rows.
    rotation : ndarray, shape (3, 3)
        Rotation matrix of the tool at the segment's start.

    Raises
    ------
    PathError
        The curve starts elsewhere than the segment.
    """
    points = np.array(shape.control_points)
    first = points[0, POSITIONS:] / np.linalg.norm(points[0, POSITIONS:])
    turn = _product(quaternions_of(rotation_of(rotation)), first * [1.0, -1.0, -1.0, -1.0])
    off = site.start - points[0, :POSITIONS]
    if not shape.relative:
        _check_start(off, 2.0 * turn[1:], site)
    points[:, :POSITIONS] += off
    points[:, POSITIONS:] = _product(turn, points[:, POSITIONS:])
    return QuaternionPoseCurve(_curve(shape, points))


def _check_start(off: Array, turned: Array, site: Site) -> None:
    hints = place_hint(site.position, site.position - off, site.positions), None
    for away, unit, hint in zip((off, turned), ("m", "rad"), hints, strict=True):
        distance = float(np.linalg.norm(away))
        if distance > START_TOLERANCE:
            where = f"{site.key}.control_points[0]"
            raise starts_elsewhere(where, f"{site.describe()}, {distance:.4g} {unit} off", hint)


def _curve(shape: BSplineCurve, points: Array) -> SplineCurve:
    """Return the curve of control points, (n, m), from sigma = 0 on."""
    from scipy.interpolate import BSpline  # noqa: PLC0415  (imports in half a second)

    spline = BSpline(np.array(shape.knots) - shape.knots[0], points, shape.degree)
    breaks = np.unique(spline.t)
    return SplineCurve(spline, float(breaks[-1]), breaks)


def _product(one: Array, other: Array) -> Array:
    """Return the products, (..., 4), of quaternions (w, x, y, z)."""
    w, v = one[..., :1], one[..., 1:]
    scalar = w * other[..., :1] - np.sum(v * other[..., 1:], axis=-1, keepdims=True)
    return np.concatenate([scalar, w * other[..., 1:] + other[..., :1] * v + np.cross(v, other[..., 1:])], axis=-1)
