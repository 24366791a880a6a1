"""Three joints a, b, c that move a point W0 to a target W: E_a E_b E_c W0 = W.

Each recipe solves for one joint after the other. A recipe needs a property of a, b, c that holds at all positions of
the redundant joints. S is the point where two axes meet, n the normal of the plane in which two joints move, and B a
point on the axis of b. A * marks a step with two solutions.

    plane of b, c   * a: n . E_a^-1 W = n . W0 (one solution for a slide);  b and c within the plane
    plane of a, b   * c: n . E_c W0 = n . W (one solution for a slide);  a and b within the plane
    a, b meet       * c: |E_c W0 - S| = |W - S|;  * b: a . E_b E_c W0 = a . W;  a by the angle
    b, c meet       * a: |E_a^-1 W - S| = |W0 - S|;  * c: b . E_c W0 = b . E_a^-1 W;  b by the angle
    cylinder        * g = +-sqrt(|b x (W - B)|^2 - (c . (W0 - B))^2);  * c: (b x c) . (E_c W0 - B) = g;  b by the angle;
                    then the slide a along the axis of b, to which that of c is perpendicular

Within a plane, two revolute joints, or a revolute and a prismatic one, follow from a distance (*); two prismatic joints
follow from a linear system. The solutions of a step that sets a component or a distance of a position are distinguished
by the sign of the derivative of this condition (`screws`). The factors of a recipe are these derivatives, as functions
of the posture. Up to its sign, the product of the factors is the determinant of the Jacobian of the centre.

Labels follow the senses of the joint axes. Consider an industrial arm whose axes 1, 2, 3 are z, y, y, and whose first
three joints place a point (the centre of the wrist, or the tool). The label is ``front`` if the point is on the side to
which joint 1 faces, and ``up`` if joint 3 bends forwards.

Sources: D. L. Pieper, The kinematics of manipulators under computer control, PhD thesis, Stanford 1968 (the wrist's
centre first); B. Paden, Kinematics and control of robot manipulators, PhD thesis, Berkeley 1985 (subproblems);
A. J. Elias, J. T. Wen, "IK-Geo: unified robot inverse kinematics using subproblem decomposition", 2022 (axes that are
parallel or meet, beside a spherical wrist); M. Brandstoetter, A. Angerer, M. Hofbaur, "An analytical solution of the
inverse kinematics problem of industrial serial manipulators with an ortho-parallel basis and a spherical wrist", 2014.

In the family `positioning`, three joints move the tool to a position, whatever its orientation. All other joints are
redundant.

With the redundant joints held, let W0 be the tool with the three joints a, b, c at zero. They move it to the target W,

    E_a E_b E_c W0 = W,

by one of the recipes above. Redundant joints may be before, between and after these three: they place the axes and W0,
sample by sample. Seen from the tool, the equation is E_c^-1 E_b^-1 E_a^-1 W = W0: the order of the joints is reversed,
and target and tool change places. This form is used if a recipe fits only in this order.

Branches are distinguished by the signs of the two factors of the recipe.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.arm import Anchor, Arm, RemainingJoints
from brachis.ik.branches import Factor, FactoredSolver, Steps, fit
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, Screw
from brachis.ik.vectors import across, angle_about, dot
from brachis.kernel import formula
from brachis.robot import TaskMap

FRONT = 0
"""Slot of a recipe's first step."""
UP = 1
"""Slot of a recipe's second step."""

Values = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Positions of a, b, c, with one or two solutions along the slots; NaN if the target is out of reach."""


def solve_plane_of_last(arm: Arm, target: np.ndarray) -> Values:
    """Solve for joint a first; b and c then act within their plane."""
    a, b, c = arm.base
    normal = plane_normal(b, c)
    orbit = a.inverse.orbit(target)
    first = orbit.component(-normal, -dot(normal, arm.centre), FRONT)
    return first, *move_within_plane(b, c, arm.centre, orbit.at(first), UP)


def solve_plane_of_first(arm: Arm, target: np.ndarray) -> Values:
    """Solve for joint c first; a and b then act within their plane."""
    a, b, c = arm.base
    normal = plane_normal(a, b)
    orbit = c.orbit(arm.centre)
    third = orbit.component(normal, dot(normal, target), UP)
    return *move_within_plane(a, b, orbit.at(third), target, FRONT), third


def solve_meeting_of_first(arm: Arm, target: np.ndarray) -> Values:
    """Solve for joint c first, from the distance to the point where the axes of a and b meet."""
    a, b, c = arm.base
    outer = c.orbit(arm.centre)
    away = target - arm.meeting
    third = outer.distance(arm.meeting, dot(away, away), UP)
    inner = b.orbit(outer.at(third))
    second = inner.component(a.axis, dot(a.axis, target), FRONT)
    return angle_about(a.axis, inner.at(second) - arm.meeting, away), second, third


def solve_meeting_of_last(arm: Arm, target: np.ndarray) -> Values:
    """Solve for joint a first, from the distance to the point where the axes of b and c meet."""
    a, b, c = arm.base
    outer = a.inverse.orbit(target)
    away = arm.centre - arm.meeting
    first = outer.distance(arm.meeting, dot(away, away), UP)
    end = outer.at(first)
    inner = c.orbit(arm.centre)
    third = inner.component(b.axis, dot(b.axis, end), FRONT)
    start = inner.at(third) - arm.meeting
    return first, angle_about(b.axis, start, end - arm.meeting), third


def solve_cylinder(arm: Arm, target: np.ndarray) -> Values:
    """Solve for the centre's distance in front of, or behind, the common direction of a and b; then for joint c."""
    a, b, c = arm.base
    front = cross(b.axis, c.axis)
    away = target - b.point
    radius = across(b.axis, away)
    side = dot(c.axis, arm.centre - b.point)
    reach = formula.sqrt(dot(radius, radius) - side * side)
    orbit = c.orbit(arm.centre)
    level = np.concatenate([reach, -reach], axis=FRONT) + dot(front, b.point)
    third = orbit.component(front, level, UP)
    start = orbit.at(third)
    second = angle_about(b.axis, start - b.point, away)
    return dot(a.axis, target - start), second, third


def plane_normal(first: Screw, second: Screw) -> np.ndarray:
    """Return the normal of the plane in which two joints move positions."""
    if first.revolute:
        return first.axis
    return second.axis if second.revolute else cross(first.axis, second.axis)


def move_within_plane(
    first: Screw, second: Screw, start: np.ndarray, end: np.ndarray, slot: int
) -> tuple[np.ndarray, np.ndarray]:
    """Solve for two joints that move `start` to `end` within their common plane.

    The two solutions follow each other along the axis `slot`; for two slides, there is only one solution.
    """
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
    displacement = end - start
    size = dot(normal, normal)
    outer = dot(cross(displacement, second.axis), normal) / size
    return outer, dot(cross(first.axis, displacement), normal) / size


def _across(arm: Arm, joint: int, plane: tuple[int, int]) -> np.ndarray:
    """Return the velocity of the centre, caused by a joint, normal to the plane of two other joints."""
    normal = plane_normal(*(arm.screws[i] for i in plane))
    return dot(normal, arm.screws[joint].velocity(arm.centre))


def _area(arm: Arm, plane: tuple[int, int]) -> np.ndarray:
    """Return the area spanned by the velocities of the centre due to two joints of one plane, up to its sign.

    For two slides, this area is the length of `plane_normal`.
    """
    first, second = (arm.screws[i] for i in plane)
    if first.revolute:
        return dot(first.point - arm.centre, second.velocity(arm.centre))
    if second.revolute:
        return dot(arm.centre - second.point, first.axis)
    return dot(first.axis, first.axis)


def _along(arm: Arm, joint: int, axis: int) -> np.ndarray:
    """Return the velocity of the centre, caused by a joint, along the axis of another joint."""
    return dot(arm.screws[axis].axis, arm.screws[joint].velocity(arm.centre))


def _approach(arm: Arm, joint: int, sign: float) -> np.ndarray:
    """Return the velocity of the centre to or from the meeting point of two other axes, times the distance."""
    direction = sign * (arm.meeting - arm.centre)
    return dot(direction, arm.screws[joint].velocity(arm.centre))


def _in_front(arm: Arm) -> np.ndarray:
    """Return how far the centre is in front of the axis of b, as seen along the axis of c."""
    _, b, c = arm.base
    return dot(cross(b.axis, c.axis), arm.centre - b.point)


def _to_front(arm: Arm) -> np.ndarray:
    """Return the velocity of the centre to the front, caused by joint c."""
    _, b, c = arm.base
    return dot(cross(b.axis, c.axis), c.velocity(arm.centre))


@dataclass(frozen=True)
class Recipe:
    """A way to solve for three joints.

    Attributes
    ----------
    fits : callable or None
        Function that tells whether the recipe fits joints; None if axes must meet.
    meets : tuple of int
        Two joints whose axes must meet, in the point `Arm.meeting`; empty if no axes need to meet.
    solve : callable
        Function that returns the positions of a, b, c from the screws at zero and the target of the centre.
    factors : tuple of Factor
        Factors of the slots `FRONT` and `UP`.
    """

    fits: Callable[[RemainingJoints], bool] | None
    meets: tuple[int, ...]
    solve: Callable[[Arm, np.ndarray], Values]
    factors: tuple[Factor, Factor]


def _are_coplanar(joints: RemainingJoints, i: int, j: int) -> bool:
    """Tell whether two joints move positions in parallel planes."""
    if joints.revolute[i] and joints.revolute[j]:
        return joints.are_parallel(i, j)
    if joints.revolute[i] or joints.revolute[j]:
        return joints.are_perpendicular(i, j)
    return not joints.are_parallel(i, j)


def _are_cylindrical(joints: RemainingJoints) -> bool:
    """Tell whether the first joint slides along the axis of the second, and the third axis is perpendicular."""
    return (
        joints.revolute[:3].tolist() == [False, True, True]
        and joints.are_parallel(0, 1)
        and joints.are_perpendicular(1, 2)
    )


_FRONT = ("front", "back")
_UP = ("up", "down")

RECIPES = (
    Recipe(
        partial(_are_coplanar, i=1, j=2),
        (),
        solve_plane_of_last,
        (
            Factor(partial(_across, joint=0, plane=(1, 2)), _FRONT, (0,)),
            Factor(partial(_area, plane=(1, 2)), _UP, (1, 2)),
        ),
    ),
    Recipe(
        partial(_are_coplanar, i=0, j=1),
        (),
        solve_plane_of_first,
        (
            Factor(partial(_area, plane=(0, 1)), _FRONT, (0, 1)),
            Factor(partial(_across, joint=2, plane=(0, 1)), _UP, (2,)),
        ),
    ),
    Recipe(
        None,
        (0, 1),
        solve_meeting_of_first,
        (
            Factor(partial(_along, joint=1, axis=0), _FRONT),
            Factor(partial(_approach, joint=2, sign=1.0), _UP),
        ),
    ),
    Recipe(
        None,
        (1, 2),
        solve_meeting_of_last,
        (
            Factor(partial(_along, joint=2, axis=1), _FRONT),
            Factor(partial(_approach, joint=0, sign=-1.0), _UP),
        ),
    ),
    Recipe(
        _are_cylindrical,
        (),
        solve_cylinder,
        (Factor(_in_front, _FRONT), Factor(_to_front, _UP)),
    ),
)
"""All recipes; the first one that fits is used."""


def choose_recipe(point: str, joints: RemainingJoints) -> tuple[Recipe, Anchor | None]:
    """Find the recipe by which the first three joints place a point; `point` names this point in messages.

    Returns
    -------
    recipe : Recipe
    meeting : Anchor or None
        Point where two of the axes meet, if the recipe needs it.

    Raises
    ------
    NotApplicableError
        No recipe fits.
    """
    for recipe in RECIPES:
        meeting = joints.meeting(*recipe.meets) if recipe.meets else None
        if meeting or (recipe.fits and recipe.fits(joints)):
            return recipe, meeting
    in_order = sorted(zip(joints.joints[:3], joints.names[:3], strict=True))
    names = ", ".join(name for _, name in in_order)
    raise NotApplicableError(
        f"no closed form moves {point} by {names}: no two neighbours among them move in one plane or have axes that "
        "meet in a fixed point"
    )


class PositioningSolver(FactoredSolver):
    """Closed form of three joints for the position of the tool; see the formulas in the docstring of the module.

    Parameters
    ----------
    geometry : ChainGeometry
    redundant : tuple of int
    joints : RemainingJoints
        The joints, in the order in which the solver solves for them.
    rows : sequence of int
        Indices of the world axes (0, 1, 2) of the target's coordinates.

    Raises
    ------
    NotApplicableError
        No recipe fits.
    """

    def __init__(
        self,
        geometry: ChainGeometry,
        redundant: tuple[int, ...],
        joints: RemainingJoints,
        rows: Sequence[int],
    ) -> None:
        self.recipe, self._meeting = choose_recipe("the tool", joints)
        self._order = np.argsort(rows)
        super().__init__(geometry, redundant, joints, self.recipe.factors)

    def _arm(self, screws: tuple[Screw, ...], tool: np.ndarray) -> Arm:
        return Arm(screws, tool, self._meeting.at(screws) if self._meeting else tool)

    def _steps(self, targets: np.ndarray, q_r: np.ndarray) -> Steps:
        screws = self._geometry.screws_with(self._redundant, q_r)
        start = screws.tool_position[:, None, None]
        end = targets.T[self._order, None, None]
        if self._joints.mirrored:
            start, end = (end, start)
        arm = self._arm(self._joints.screws(screws, alternatives=2), start)
        return arm, self.recipe.solve(arm, end)


@ik_family(
    "positioning", source="Pieper 1968; Paden 1985; IK-Geo 2022; `point_recipes`"
)
def positioning(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PositioningSolver:
    """Fit the family: only the position of the tool is prescribed, and three joints remain."""
    if task_map.angles or len(task_map.axes) != 3:
        raise NotApplicableError("this family solves only for the position: x, y and z")
    three = RemainingJoints.of(geometry, redundant, 3)
    return fit(PositioningSolver, geometry, redundant, three, task_map.axes)
