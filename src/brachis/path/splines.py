"""Smooth curves through waypoints.

B-spline curves that are given by knots and control points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.curves import LineCurve
from brachis.path.pose import POSITIONS, QuaternionPoseCurve
from brachis.path.rotations import quaternions_of, rotation_of
from brachis.path.site import ZERO_LENGTH, Site
from brachis.robot.plausibility import place_hint
from brachis.robot.task_map.protocol import joints_of

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

    from brachis.path.protocol import Array
    from brachis.path.site import Site
    from brachis.task import BSplineCurve, SplineThrough

START_TOLERANCE = 1e-4
"""How far a segment may start from where its waypoints expect, m and rad."""
_OF_NEXT = 0.01
"""Share of the distance to the next waypoint up to which a first waypoint is taken for the segment's start."""
_DEGREE = 5
_FEWEST_WAYPOINTS = 3


@dataclass(frozen=True, eq=False)
class SplineCurve:
    """The natural quintic spline through waypoints, C4, over their cumulative chord length.

    Of all curves through the waypoints it has the least integral of the squared third derivative; its third and fourth
    derivatives vanish at both ends. That holds from three waypoints on, where it is a parabola.

    Attributes
    ----------
    spline : BSpline
        The spline with values of shape (m,).
    length : float
        Cumulative chord length of the position rows, m (of yaw, rad, where they stand still).
    knots : ndarray
        Chord lengths of the waypoints.
    """

    spline: BSpline
    length: float
    knots: Array

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the curve and its derivatives by sigma, shape (order + 1, K, m)."""
        return np.stack([self.spline(sigma, nu=k) for k in range(order + 1)])


def spline_through(shape: SplineThrough, site: Site) -> SplineCurve | LineCurve:
    """Return the smooth curve from the segment's start through waypoints; a line where there is only one."""
    if shape.orientations is not None:
        raise PathError(
            "orientations are for task spaces of poses",
            found=f"task_space [{', '.join(site.rows)}]",
            where=f"{site.key}.orientations",
            hint="Set task_space: pose",
        )
    waypoints = waypoints_of(shape, site)
    if repeats_start(np.linalg.norm(np.diff(waypoints, axis=0), axis=1)):
        waypoints = np.delete(waypoints, 1, axis=0)
    steps = np.diff(waypoints, axis=0)
    chords = np.linalg.norm(steps[:, : len(site.positions)], axis=1)
    return interpolate(
        chord_knots(chords, np.linalg.norm(steps, axis=1), shape, site), waypoints
    )


def waypoints_of(shape: SplineThrough, site: Site) -> Array:
    """Return the segment's start and the waypoints, shape (n, m).

    Raises
    ------
    PathError
        A waypoint has the wrong number of coordinates, or the segment does not start where the waypoints expect.
    """
    points = [
        site.coordinates(point, f"through[{i}]", site.rows)
        for i, point in enumerate(shape.through)
    ]
    expected = (
        None
        if shape.starts_at is None
        else site.coordinates(shape.starts_at, "starts_at", site.rows)
    )
    if shape.relative:
        points = [
            point + site.start - (0.0 if expected is None else expected)
            for point in points
        ]
    elif expected is not None:
        off = site.start - expected
        count = len(site.positions)
        distance = float(np.linalg.norm(off[:count]))
        if distance > START_TOLERANCE:
            unit = "rad or m" if joints_of(site.rows) else "m"
            raise starts_elsewhere(
                f"{site.key}.starts_at",
                f"{site.describe()}, {distance:.4g} {unit} off",
                place_hint(site.position, expected[:count], site.positions),
            )
        if np.any(np.abs(off[count:]) > START_TOLERANCE):
            raise starts_elsewhere(
                f"{site.key}.starts_at",
                f"{site.describe()}, {abs(off[-1]):.4g} rad off",
            )
    return np.stack([site.start, *points])


def repeats_start(steps: Array) -> bool:
    """Tell whether the first waypoint is the segment's start, from the steps between it and all waypoints, (n - 1,)."""
    return len(steps) > 1 and bool(
        steps[0] < START_TOLERANCE and steps[0] <= _OF_NEXT * steps[1]
    )


def starts_elsewhere(where: str, found: str, hint: str | None = None) -> PathError:
    """Return the error that a segment does not start where its waypoints expect; `hint` says what they look like."""
    return PathError(
        "the segment starts elsewhere than its waypoints expect",
        found=found,
        allowed=f"at most {START_TOLERANCE:g} m and rad off",
        where=where,
        hint=hint
        or "Set relative: true to count from the segment's start, or begin the path there",
    )


def chord_knots(
    chords: Array, otherwise: Array, shape: SplineThrough, site: Site
) -> Array:
    """Return the cumulative chord lengths, shape (n,), of n waypoints.

    Parameters
    ----------
    chords : ndarray, shape (n - 1,)
        Distances of successive waypoints, m.
    otherwise : ndarray, shape (n - 1,)
        What to take where all positions are the same, rad.
    shape : SplineThrough
        The waypoints.
    site : Site
        Place of the segment.

    Raises
    ------
    PathError
        Nothing moves, or a waypoint repeats its predecessor.
    """
    if np.all(chords < ZERO_LENGTH):
        chords = otherwise
    if np.all(chords < ZERO_LENGTH):
        raise site.zero_length(
            key=".through", found=[list(point) for point in shape.through]
        )
    if np.any(chords < ZERO_LENGTH):
        repeated = (
            int(np.argmax(chords < ZERO_LENGTH)) + len(shape.through) - len(chords)
        )
        raise PathError(
            "a waypoint repeats its predecessor",
            found=list(shape.through[repeated]),
            allowed="waypoints that differ from their predecessors in the position rows",
            where=f"{site.key}.through[{repeated}]",
        )
    return np.concatenate([[0.0], np.cumsum(chords)])


def interpolate(knots: Array, waypoints: Array) -> SplineCurve | LineCurve:
    """Return the natural quintic spline, or the line, through waypoints of shape (n, m) at knots of shape (n,).

    Raises
    ------
    PathError
        The distances of the waypoints differ so much that no spline can be computed.
    """
    if len(waypoints) < _FEWEST_WAYPOINTS:
        return LineCurve(
            waypoints[0], (waypoints[1] - waypoints[0]) / knots[1], float(knots[1])
        )
    try:
        return SplineCurve(_natural(knots, waypoints), float(knots[-1]), knots)
    except ValueError as error:  # knots that fall together, or singular equations
        distances = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
        raise PathError(
            "no spline goes through the waypoints: their distances differ too much",
            found=f"distances from {distances.min():.3g} to {distances.max():.3g} (m or rad)",
            allowed="waypoints of like distances",
            where="path",
        ) from error


def _natural(knots: Array, waypoints: Array) -> BSpline:
    # Imported here: it takes half a second, which tasks without a spline need not wait for.
    from scipy.interpolate import make_interp_spline

    # Over a parameter in [0, 1], so that the derivatives at the ends are of the same magnitude as the values.
    unit = knots / knots[-1]
    if len(knots) == _FEWEST_WAYPOINTS:
        # The conditions at the ends leave a parabola, but as equations they lose digits where a chord is short.
        spline = make_interp_spline(unit, waypoints, k=2, t=np.repeat([0.0, 1.0], 3))
    else:
        zero = np.zeros(waypoints.shape[1])
        ends = [(3, zero), (4, zero)]
        # The stubs do not know conditions on chosen derivatives, which SciPy documents.
        spline = make_interp_spline(unit, waypoints, k=_DEGREE, bc_type=(ends, ends))  # type: ignore[arg-type]
    return type(spline)(spline.t * knots[-1], spline.c, spline.k)


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
        raise PathError(
            "the segment has zero length",
            allowed="control points that differ",
            where=site.key,
        )
    return _curve(shape, points + off)


def pose_bspline(
    shape: BSplineCurve, site: Site, rotation: Array
) -> QuaternionPoseCurve:
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
    turn = _product(
        quaternions_of(rotation_of(rotation)), first * [1.0, -1.0, -1.0, -1.0]
    )
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
            raise starts_elsewhere(
                f"{site.key}.control_points[0]",
                f"{site.describe()}, {distance:.4g} {unit} off",
                hint,
            )


def _curve(shape: BSplineCurve, points: Array) -> SplineCurve:
    """Return the curve of control points, (n, m), from sigma = 0 on."""
    from scipy.interpolate import BSpline

    spline = BSpline(np.array(shape.knots) - shape.knots[0], points, shape.degree)
    breaks = np.unique(spline.t)
    return SplineCurve(spline, float(breaks[-1]), breaks)


def _product(one: Array, other: Array) -> Array:
    """Return the products, (..., 4), of quaternions (w, x, y, z)."""
    w, v = one[..., :1], one[..., 1:]
    scalar = w * other[..., :1] - np.sum(v * other[..., 1:], axis=-1, keepdims=True)
    return np.concatenate(
        [scalar, w * other[..., 1:] + other[..., :1] * v + np.cross(v, other[..., 1:])],
        axis=-1,
    )
