"""Curves: lines, arcs, helices and splines; and the functions that build lines, arcs and helices from segments."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.kernel import Spline
from brachis.path.context import SegmentContext
from brachis.path.protocol import Array
from brachis.robot.task_map.protocol import ANGLES, AXES
from brachis.task.segments import (
    ArcCenter,
    ArcVia,
    CircleTurns,
    HelixTurns,
    LineBy,
    LineHeading,
    LineTo,
)

_MOST_TURNS = 1000
"""Maximum number of turns of an arc.

Each turn has four knots: planning 100 turns takes half a minute and 1.1 GB of memory.
"""


@dataclass(frozen=True, eq=False)
class SplineCurve:
    """A spline over sigma in [0, length].

    Attributes
    ----------
    spline : Spline
        Spline with values of shape (m,).
    length : float
        Range of sigma. For waypoints, it is the cumulative chord length of the position rows, m, or of the angle, rad,
        if the position stands still.
    knots : ndarray
        Values of sigma between which the spline is a polynomial; for waypoints, the cumulative chord lengths.
    """

    spline: Spline
    length: float
    knots: Array

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the curve and its derivatives with respect to sigma, shape (order + 1, K, m)."""
        return self.spline.derivatives(sigma, order)


def septic(start: Array, end: Array, length: float) -> SplineCurve:
    """Return the septic polynomial with the given values and first three derivatives at both ends.

    Parameters
    ----------
    start, end : ndarray, shape (4, m)
        Value and first, second and third derivatives with respect to sigma.
    length : float
        Range of sigma over which the polynomial extends.
    """
    from scipy.interpolate import BPoly

    ends = np.array([0.0, length])
    polynomial = BPoly.from_derivatives(ends, [start, end])
    # A spline without inner knots has the same control points as a Bernstein polynomial, and is evaluated faster.
    spline = Spline(np.repeat(ends, 8), polynomial.c[:, 0], 7)
    return SplineCurve(spline, length, ends)


@dataclass(frozen=True, eq=False)
class LineCurve:
    """A straight line ``start + slope sigma``.

    Attributes
    ----------
    start : ndarray, shape (m,)
        Task coordinates at the start of the line.
    slope : ndarray, shape (m,)
        Task coordinates per unit sigma. The norm is 1 in the position rows, or in the angle if the position stands
        still.
    length : float
        Range of sigma, m (rad if the position stands still).
    """

    start: Array
    slope: Array
    length: float

    @property
    def knots(self) -> Array:
        """Start and end of the line, which is analytic in between."""
        return np.array([0.0, self.length])

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the line and its derivatives with respect to sigma, shape (order + 1, K, m)."""
        result = np.zeros((order + 1, sigma.size, self.start.size))
        result[0] = self.start + sigma[:, None] * self.slope
        result[1:2] = self.slope
        return result


def line_to(shape: LineTo, context: SegmentContext) -> LineCurve:
    """Return the line to a point."""
    end = context.coordinates(shape.to, "to", context.rows)
    return _line(end - context.start, context, ".to", list(shape.to))


def line_by(shape: LineBy, context: SegmentContext) -> LineCurve:
    """Return the line given by a displacement."""
    displacement = context.coordinates(shape.by, "by", context.rows)
    return _line(displacement, context, ".by", list(shape.by))


def line_heading(shape: LineHeading, context: SegmentContext) -> LineCurve:
    """Return the line given by its length and direction in the plane of the two position rows."""
    context.need_rows("a line by length and angle_deg", 2)
    angle = np.deg2rad(shape.angle_deg)
    displacement = np.zeros_like(context.start)
    displacement[:2] = shape.length * np.array([np.cos(angle), np.sin(angle)])
    return _line(displacement, context, ".length", shape.length)


def _line(
    displacement: Array, context: SegmentContext, key: str, found: object
) -> LineCurve:
    length = float(np.linalg.norm(displacement[: len(context.positions)]))
    if length < tolerances.LENGTH:
        length = float(np.linalg.norm(displacement))
    if length < tolerances.LENGTH:
        raise context.zero_length(key, found)
    return LineCurve(context.start, displacement / length, length)


@dataclass(frozen=True, eq=False)
class ArcCurve:
    """An arc, or a helix, ``center + cos(turn sigma) outward + sin(turn sigma) forward + slope sigma``.

    Attributes
    ----------
    center : ndarray, shape (m,)
        Centre, m; in the row of an angle, the value at the start, rad.
    outward, forward : ndarray, shape (m,)
        Vectors from the centre to the start, and in the direction of the turn there. Both vectors have the length of
        the radius, m.
    length : float
        Length of the curve, m.
    turn : float
        Angle by which the curve turns per unit sigma, rad/m.
    slope : ndarray, shape (m,)
        Climb along the axis per unit sigma; in the row of an angle, the slope of the angle, rad/m.
    """

    center: Array
    outward: Array
    forward: Array
    length: float
    turn: float
    slope: Array

    @property
    def normal(self) -> Array:
        """Unit vector of the axis about which the curve turns, for three position rows."""
        normal = np.cross(self.outward, self.forward)
        return normal / np.linalg.norm(normal)

    @property
    def knots(self) -> Array:
        """Values of sigma at every quarter turn.

        The arc is analytic, but a quadrature over many turns needs several intervals.
        """
        quarters = int(np.ceil(self.length * self.turn / (np.pi / 2)))
        return np.linspace(0.0, self.length, max(quarters, 1) + 1)

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the curve and its derivatives with respect to sigma, shape (order + 1, K, m)."""
        # Each derivative turns the position vector by a quarter turn and multiplies it by the angle per unit sigma.
        orders = np.arange(order + 1)[:, None, None]
        angle = self.turn * sigma[:, None] + orders * np.pi / 2
        result = np.cos(angle) * self.outward + np.sin(angle) * self.forward
        result *= self.turn**orders
        result[0] += self.center + sigma[:, None] * self.slope
        result[1:2] += self.slope
        return result


def _arc(center: Array, outward: Array, forward: Array, angle: float) -> ArcCurve:
    """Return the arc that turns by an angle, rad, without climb and without a row for an angle."""
    radius = float(np.linalg.norm(outward))
    nothing = np.zeros_like(center)
    return ArcCurve(center, outward, forward, radius * angle, 1.0 / radius, nothing)


def arc_center(shape: ArcCenter, context: SegmentContext) -> ArcCurve:
    """Return the arc that turns about a centre by an angle."""
    angle = float(np.deg2rad(shape.angle_deg))
    if abs(angle) < tolerances.LENGTH:
        raise context.zero_length(".angle_deg", shape.angle_deg)
    return _with_angle(_about_center(shape, angle, context), shape.yaw, context)


def circle(shape: CircleTurns, context: SegmentContext) -> ArcCurve:
    """Return whole or partial turns about a centre."""
    arc = _about_center(shape, 2 * np.pi * shape.turns, context)
    return _with_angle(arc, shape.yaw, context)


def arc_via(shape: ArcVia, context: SegmentContext) -> ArcCurve:
    """Return the arc that passes through one point and ends at another.

    The centre c is as far from the start p as from the two points p + a and p + b: ``a.(c - p) = a.a / 2``, and the
    same with b. For any number of rows, c - p is a linear combination of a and b.
    """
    context.need_rows("an arc", 2, 3)
    start = context.position
    to_via = context.coordinates(shape.via, "via", context.positions) - start
    to_end = context.coordinates(shape.to, "to", context.positions) - start
    if np.linalg.norm(to_end) < tolerances.LENGTH:
        raise context.zero_length(".to", list(shape.to))
    sides = np.stack([to_via, to_end])
    gram = sides @ sides.T
    collinear = tolerances.WRITTEN
    if np.linalg.det(gram) <= collinear**2 * gram[0, 0] * gram[1, 1]:
        raise context.wrong(
            "start, via and end of the arc lie on a line",
            ".via",
            found=f"start {start.tolist()}, via {list(shape.via)}, to {list(shape.to)}",
            allowed="three different points that are not collinear",
            hint="Use line: {to: [...]} for a straight segment",
        )
    to_center = np.linalg.solve(gram, np.diag(gram) / 2) @ sides
    outward = -to_center
    radius = np.linalg.norm(outward)
    # An inversion about the start turns the circle into a line. Along this line, via comes before the end.
    forward = to_via / gram[0, 0] - to_end / gram[1, 1]
    forward -= (forward @ outward) / radius**2 * outward
    forward *= radius / np.linalg.norm(forward)
    end = to_end - to_center
    angle = float(np.arctan2(end @ forward, end @ outward) % (2 * np.pi))
    arc = _arc(start + to_center, outward, forward, angle)
    return _with_angle(arc, shape.yaw, context)


def _about_center(
    shape: ArcCenter | CircleTurns | HelixTurns, angle: float, context: SegmentContext
) -> ArcCurve:
    """Return the arc that turns by a signed angle, rad, about the centre of a shape, without a row for an angle."""
    context.need_rows("an arc", 2, 3)
    center = context.coordinates(shape.center, "center", context.positions)
    outward = context.position - center
    if abs(angle) > 2.0 * np.pi * _MOST_TURNS:
        raise context.wrong(
            "the arc has too many turns for one path",
            found=f"{abs(angle) / (2.0 * np.pi):g} turns",
            allowed=f"at most {_MOST_TURNS}",
            hint="Plan a few turns, and repeat them (boundary.periodic)",
        )
    if np.linalg.norm(outward) < tolerances.LENGTH:
        raise context.wrong(
            "the arc has zero length: its centre is at its start",
            ".center",
            found=list(shape.center),
            allowed="another point",
        )
    if center.size == 2:
        if shape.normal is not None:
            raise context.wrong(
                "a normal needs three position rows; here the task space defines the plane",
                ".normal",
                found=list(shape.normal),
                allowed="no normal",
            )
        forward = np.array([-outward[1], outward[0]])
    else:
        normal = _normal(shape.normal, outward, context)
        # The plane contains the start: a centre given with few digits is moved into it.
        center = center + (normal @ outward) * normal
        outward = context.position - center
        forward = np.cross(normal, outward)
    return _arc(center, outward, np.sign(angle) * forward, abs(angle))


def _normal(
    normal: tuple[float, float, float] | None, outward: Array, context: SegmentContext
) -> Array:
    """Return the unit normal of an arc in three rows."""
    if normal is None:
        raise context.wrong(
            "with three position rows a centre does not determine the plane of the arc",
            ".normal",
            found="no normal",
            allowed="the axis of rotation, [nx, ny, nz]",
            hint="Or define the arc with via and to",
        )
    unit = np.asarray(normal) / np.linalg.norm(normal)
    slope = unit @ outward / np.linalg.norm(outward)
    largest = 1e-3  # coordinates are given with only a few digits
    if abs(slope) > largest:
        raise context.wrong(
            "the normal is not perpendicular to the radius from the centre to the segment's start",
            ".normal",
            found=f"{np.rad2deg(np.arccos(np.clip(slope, -1, 1))):.6g} degrees between them",
            allowed=f"90 degrees to within {np.rad2deg(largest):.2g}",
            hint=f"Move the centre by {unit @ outward:.6g} m along the normal, or define the arc with via and to",
        )
    return unit


def _with_angle(arc: ArcCurve, turning: str, context: SegmentContext) -> ArcCurve:
    """Add the row of the angle that the segment asks for, if the task space has an angle."""
    tangent = turning == "tangent"
    angle = context.rows[-1]
    if angle in ANGLES:
        sense = 0.0
        if tangent:
            sides = np.zeros((2, 3))
            sides[:, [AXES.index(row) for row in context.positions]] = [
                arc.outward,
                arc.forward,
            ]
            sense = float(np.cross(*sides)[ANGLES.index(angle)] * arc.turn**2)
            if abs(sense) < 1.0 - tolerances.WRITTEN:
                raise context.wrong(
                    f"the arc is not in the plane in which {angle} turns",
                    ".yaw",
                    found="tangent",
                    allowed="fixed",
                )
        return replace(
            arc,
            center=np.append(arc.center, context.start[-1]),
            outward=np.append(arc.outward, 0.0),
            forward=np.append(arc.forward, 0.0),
            slope=np.append(arc.slope, sense * arc.turn),
        )
    if tangent:
        raise context.wrong(
            "the task space has no angle",
            ".yaw",
            found="tangent",
            allowed="fixed",
            hint="Add an angle to task_space, or with task_space: pose set orientation: tangent in the segment",
        )
    return arc


def helix(shape: HelixTurns, context: SegmentContext) -> ArcCurve:
    """Return climbing turns about an axis."""
    context.need_rows("a helix", 3)
    arc = _about_center(shape, 2 * np.pi * shape.turns, context)
    # The sign of the turns determines the sign of the arc's normal.
    rise = shape.turns * shape.pitch * arc.normal
    length = float(np.hypot(arc.length, np.linalg.norm(rise)))
    turn = arc.turn * arc.length / length
    climbing = replace(arc, length=length, turn=turn, slope=rise / length)
    return _with_angle(climbing, "fixed", context)
