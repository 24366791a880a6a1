"""Three joints a, b, c that bring a point W0 to a target W: E_a E_b E_c W0 = W.

Each recipe solves for one joint after the other, and fits where something holds of a, b, c at all positions of the
redundant joints. S is the point where two axes meet, n the normal of the plane in which two joints move; B is a point
on the axis of b. Steps that have two answers are marked by *.

    plane of b, c   * a: n . E_a^-1 W = n . W0 (one answer for a slide);  b and c within the plane
    plane of a, b   * c: n . E_c W0 = n . W (one answer for a slide);  a and b within the plane
    a, b meet       * c: |E_c W0 - S| = |W - S|;  * b: a . E_b E_c W0 = a . W;  a by the angle
    b, c meet       * a: |E_a^-1 W - S| = |W0 - S|;  * c: b . E_c W0 = b . E_a^-1 W;  b by the angle
    cylinder        * g = +-sqrt(|b x (W - B)|^2 - (c . (W0 - B))^2);  * c: (b x c) . (E_c W0 - B) = g;  b by the angle;
                    then the slide a along the axis of b, to which that of c is perpendicular

Within a plane two joints that turn, or one that turns and one that slides, meet at a distance (*); two that slide are
a linear system. A step that brings a position to a component or a distance tells its answers apart by the sign of that
condition's derivative (`screws`). The functions ``..._factor`` are these derivatives, as functions of the posture:
their product is the determinant of the centre's Jacobian, up to its sign.

Sources: D. L. Pieper, The kinematics of manipulators under computer control, PhD thesis, Stanford 1968 (the wrist's
centre first); B. Paden, Kinematics and control of robot manipulators, PhD thesis, Berkeley 1985 (subproblems);
A. J. Elias, J. T. Wen, "IK-Geo: unified robot inverse kinematics using subproblem decomposition", 2022 (axes that are
parallel or meet, beside a spherical wrist); M. Brandstoetter, A. Angerer, M. Hofbaur, "An analytical solution of the
inverse kinematics problem of industrial serial manipulators with an ortho-parallel basis and a spherical wrist", 2014.
"""

from __future__ import annotations

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.arm import Arm
from brachis.ik.screws import Screw
from brachis.ik.vectors import across, angle_about, dot

FRONT = 0
UP = 1
FLIP = 2
"""Slots of the two steps of a recipe, and of the wrist's."""

Values = tuple[np.ndarray, np.ndarray, np.ndarray]


def plane_of_last(arm: Arm, target: np.ndarray) -> Values:
    """Solve for a, so that b and c have to act within their plane alone."""
    a, b, c = arm.base
    normal = _normal(b, c)
    orbit = a.inverse.orbit(target)
    first = orbit.component(-normal, -dot(normal, arm.centre), FRONT)
    return first, *within_plane(b, c, arm.centre, orbit.at(first), UP)


def out_of_last_factor(arm: Arm) -> np.ndarray:
    """Velocity that a gives the centre across the plane of b and c."""
    a, b, c = arm.base
    return dot(_normal(b, c), a.velocity(arm.centre))


def within_last_factor(arm: Arm) -> np.ndarray:
    """Area spanned by the velocities that b and c give the centre."""
    return _area(arm.base[1], arm.base[2], arm.centre)


def plane_of_first(arm: Arm, target: np.ndarray) -> Values:
    """Solve for c, so that a and b have to act within their plane alone."""
    a, b, c = arm.base
    normal = _normal(a, b)
    orbit = c.orbit(arm.centre)
    third = orbit.component(normal, dot(normal, target), UP)
    return *within_plane(a, b, orbit.at(third), target, FRONT), third


def out_of_first_factor(arm: Arm) -> np.ndarray:
    """Velocity that c gives the centre across the plane of a and b."""
    a, b, c = arm.base
    return dot(_normal(a, b), c.velocity(arm.centre))


def within_first_factor(arm: Arm) -> np.ndarray:
    """Area spanned by the velocities that a and b give the centre."""
    return _area(arm.base[0], arm.base[1], arm.centre)


def meeting_of_first(arm: Arm, target: np.ndarray) -> Values:
    """Solve for c by the distance from the point where a and b meet."""
    a, b, c = arm.base
    outer = c.orbit(arm.centre)
    away = target - arm.meeting
    third = outer.distance(arm.meeting, dot(away, away), UP)
    inner = b.orbit(outer.at(third))
    second = inner.component(a.axis, dot(a.axis, target), FRONT)
    return angle_about(a.axis, inner.at(second) - arm.meeting, away), second, third


def approach_of_last_factor(arm: Arm) -> np.ndarray:
    """Velocity that c gives the centre towards the point where a and b meet, times its distance."""
    return dot(arm.meeting - arm.centre, arm.base[2].velocity(arm.centre))


def along_first_factor(arm: Arm) -> np.ndarray:
    """Velocity that b gives the centre along the axis of a."""
    return dot(arm.base[0].axis, arm.base[1].velocity(arm.centre))


def meeting_of_last(arm: Arm, target: np.ndarray) -> Values:
    """Solve for a by the distance from the point where b and c meet."""
    a, b, c = arm.base
    outer = a.inverse.orbit(target)
    away = arm.centre - arm.meeting
    first = outer.distance(arm.meeting, dot(away, away), UP)
    end = outer.at(first)
    inner = c.orbit(arm.centre)
    third = inner.component(b.axis, dot(b.axis, end), FRONT)
    return (
        first,
        angle_about(b.axis, inner.at(third) - arm.meeting, end - arm.meeting),
        third,
    )


def approach_of_first_factor(arm: Arm) -> np.ndarray:
    """Velocity that a gives the centre away from the point where b and c meet, times its distance."""
    return dot(arm.centre - arm.meeting, arm.base[0].velocity(arm.centre))


def along_second_factor(arm: Arm) -> np.ndarray:
    """Velocity that c gives the centre along the axis of b."""
    return dot(arm.base[1].axis, arm.base[2].velocity(arm.centre))


def cylinder(arm: Arm, target: np.ndarray) -> Values:
    """Solve for the centre's place in front of, or behind, the common direction of a and b; then for c."""
    a, b, c = arm.base
    front = cross(b.axis, c.axis)
    away = target - b.point
    radius = across(b.axis, away)
    side = dot(c.axis, arm.centre - b.point)
    reach = np.sqrt(dot(radius, radius) - side * side)
    orbit = c.orbit(arm.centre)
    third = orbit.component(
        front, np.concatenate([reach, -reach], axis=FRONT) + dot(front, b.point), UP
    )
    start = orbit.at(third)
    return (
        dot(a.axis, target - start),
        angle_about(b.axis, start - b.point, away),
        third,
    )


def in_front_factor(arm: Arm) -> np.ndarray:
    """How far the centre is in front of the axis of b, as that of c sees it."""
    _, b, c = arm.base
    return dot(cross(b.axis, c.axis), arm.centre - b.point)


def to_front_factor(arm: Arm) -> np.ndarray:
    """Velocity that c gives the centre to the front."""
    _, b, c = arm.base
    return dot(cross(b.axis, c.axis), c.velocity(arm.centre))


def _normal(first: Screw, second: Screw) -> np.ndarray:
    """Return the normal of the plane in which two joints move positions."""
    if first.revolute:
        return first.axis
    return second.axis if second.revolute else cross(first.axis, second.axis)


def within_plane(
    first: Screw, second: Screw, start: np.ndarray, end: np.ndarray, slot: int
) -> tuple[np.ndarray, np.ndarray]:
    """Two joints that bring `start` to `end` within the plane in which both move."""
    if first.revolute:
        orbit = second.orbit(start)
        away = end - first.point
        inner = orbit.distance(first.point, dot(away, away), slot)
        return angle_about(first.axis, orbit.at(inner) - first.point, away), inner
    if second.revolute:
        orbit = first.inverse.orbit(end)
        away = start - second.point
        outer = orbit.distance(second.point, dot(away, away), slot)
        return outer, angle_about(second.axis, away, orbit.at(outer) - second.point)
    normal = cross(first.axis, second.axis)
    way = end - start
    size = dot(normal, normal)
    return dot(cross(way, second.axis), normal) / size, dot(
        cross(first.axis, way), normal
    ) / size


def _area(first: Screw, second: Screw, position: np.ndarray) -> np.ndarray:
    """Area spanned by the velocities that two joints which move in one plane give a position, up to its sign.

    For two slides it is the length of `_normal`, and counted there.
    """
    if first.revolute:
        return dot(first.point - position, second.velocity(position))
    if second.revolute:
        return dot(position - second.point, first.axis)
    return dot(first.axis, first.axis)
