"""Blends: septic polynomials that round the corner between two curves, of rows or of poses."""

from __future__ import annotations

from itertools import combinations
from math import floor

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import with_like_signs
from brachis.path.context import stands_still
from brachis.path.curves import SplineCurve
from brachis.path.joins import Join
from brachis.path.pose import LEAST_QUALITY, least_quality, quaternion_curve, rotations
from brachis.path.protocol import Array, Curve
from brachis.path.rotations import quaternion_derivatives, rotation_of
from brachis.robot.plausibility import position_hint
from brachis.task.points.units import quaternions_of


def septic(start: Array, end: Array, length: float) -> SplineCurve:
    """Return the septic polynomial with given values and three derivatives at both ends.

    Parameters
    ----------
    start, end : ndarray, shape (4, m)
        Value, first, second and third derivative by sigma.
    length : float
        Range of sigma.
    """
    from scipy.interpolate import BPoly, BSpline

    ends = np.array([0.0, length])
    polynomial = BPoly.from_derivatives(ends, [start, end])
    # As a spline without inner knots it has the same control points, and is evaluated faster.
    spline = BSpline(np.repeat(ends, 8), polynomial.c[:, 0], 7)
    return SplineCurve(spline, length, ends)


def blend_rows(join: Join, size: float) -> Curve:
    """Return the blend that replaces the last `size` of one curve and the first `size` of the next.

    Parameters
    ----------
    join : Join
        Where the curves meet.
    size : float
        Replaced range of sigma on either side, m.

    Raises
    ------
    PathError
        The blend is longer than half of a neighbour, or (nearly) stops or reverses; or an angle alone moves.
    """
    _check_neighbours(join, size)
    return _blend(join, *join.sides(size))


def blend_poses(join: Join, size: float) -> Curve:
    """Return the blend that replaces the last `size` of one curve of poses and the first `size` of the next.

    It is the polynomial of the position and the quaternion, which is then divided by its length; see `blend_rows`.

    Raises
    ------
    PathError
        As for rows; or the tool turns too much in the blend.
    """
    _check_neighbours(join, size)
    start, end = map(_with_quaternion, join.sides(size))
    end[:, -4:] *= _sign(join, size)
    columns = _blend(join, start, end)
    _, least = least_quality(columns)
    if least < LEAST_QUALITY:
        raise join.wrong_blend(
            "the tool turns too much in the blend",
            f"quaternions interpolated with a quality of {least:.2g} out of 1",
            f"{LEAST_QUALITY} or more",
            "Shorten the blend, or turn the tool along longer segments",
        )
    return quaternion_curve(columns)


def _check_neighbours(join: Join, size: float) -> None:
    """Refuse a blend where the position stands still, or that is too long.

    Raises
    ------
    PathError
    """
    found = f"{size:g} {join.unit}"
    if any(stands_still(curve, join.positions) for curve in (join.first, join.second)):
        raise join.wrong_blend(
            "a blend needs motion of the position on both sides, and on one the tool turns on the spot",
            found,
            "no blend here",
            "Turn the tool along a line, or stop there, with stop: true instead of the blend",
        )
    longest = join.shorter / 2 * (1.0 + tolerances.ROUNDING)
    if size > longest:
        raise join.wrong_blend(
            "the blend is longer than half of a neighbouring segment",
            found,
            # Rounded down, to micrometres, so that the blend that the message names is accepted.
            f"at most {floor(longest * 1e6) / 1e6:.10g} {join.unit}",
            position_hint(size, 0.0, longest, join.unit),
        )


def _blend(join: Join, start: Array, end: Array) -> SplineCurve:
    """Return the septic polynomial between derivatives (4, m), after a check that its position keeps going.

    Its length is the mean of the chord and of the polygon over the corner, which keeps its speed near 1.

    Raises
    ------
    PathError
    """
    rows = join.positions
    corners = [start[0, :rows], join.point[:rows], end[0, :rows]]
    before, chord, after = (
        float(np.linalg.norm(one - other)) for one, other in combinations(corners, 2)
    )
    curve = septic(start, end, (chord + (before + after)) / 2)
    velocity = curve.derivatives(np.linspace(0.0, curve.length, 201), 1)[1]
    speed = np.linalg.norm(velocity[:, :rows], axis=1).min()
    slowest = 0.2  # it is 1 on a line
    if not speed > slowest:
        raise join.wrong_blend(
            "the corner is too sharp for a blend: the tool would almost stop and reverse",
            f"a smallest speed of {speed:.3g} relative to the segments",
            f"more than {slowest}",
            "Turn in two corners, or by an arc; or stop at the corner, with stop: true instead of the blend",
        )
    return curve


def _with_quaternion(pose: Array) -> Array:
    """Return the derivatives of position and quaternion, (4, p + 4), from those of a pose, (4, p + 9)."""
    return np.concatenate([pose[:, :-9], quaternion_derivatives(pose)], axis=1)


def _sign(join: Join, size: float) -> float:
    """Return the sign of the end's quaternion that continues the start's along both curves."""
    steps = np.linspace(0.0, size, 9)
    poses = [
        join.first.derivatives(join.first.length - size + steps, 0)[0],
        join.second.derivatives(steps, 0)[0],
    ]
    quaternions = quaternions_of(rotation_of(rotations(np.concatenate(poses))))
    return float(np.sign(with_like_signs(quaternions)[-1] @ quaternions[-1]))
