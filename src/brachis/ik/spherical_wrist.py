"""Six joints; the axes of the last three, or of the first three, meet in one point.

Let W0 be this point with the six joints at zero. Then E_1 ... E_6 = D (`FactoredSolver`) moves it to

    W = E_a E_b E_c W0 = D W0.

The last three joints u, v, w turn about this point, so these equations contain only the first three joints a, b, c
(`point_recipes`). What remains is a rotation R_u R_v R_w = (R_a R_b R_c)^-1 R_D =: R, for axes u, v, w at any angles:

    v    u . R_v w = u . R w, two solutions
    u    turns R_v w to R w
    w    turns R^-1 u to R_v^-1 u

If the first three axes meet instead (an arm with a spherical shoulder), the reverse equation E_6^-1 ... E_1^-1 = D^-1
has the same form. Redundant joints may be anywhere, even between axes that meet, if the meeting point is fixed on one
of these axes.

Branches are distinguished by the signs of the two factors of a recipe and of u . (w x v).

Source: D. L. Pieper, The kinematics of manipulators under computer control, PhD thesis, Stanford 1968; for the first
three joints see `point_recipes`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.arm import Arm, RemainingJoints
from brachis.ik.branches import Factor, FactoredSolver, Steps, fit
from brachis.ik.point_recipes import choose_recipe
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, Circle, Screw, rotate
from brachis.ik.vectors import angle_about, apply, apply_inverse, dot
from brachis.robot import TaskMap

_FLIP = 2
"""Slot of the two solutions of the wrist, after the slots of the recipe."""


def _wrist_factor(arm: Arm) -> np.ndarray:
    """Return the volume spanned by the axes of u, w, v."""
    u, v, w = arm.screws[3:]
    return dot(u.axis, cross(w.axis, v.axis))


_WRIST = Factor(_wrist_factor, ("noflip", "flip"))


class SphericalWristSolver(FactoredSolver):
    """Closed form of six joints with a spherical wrist or shoulder; see the formulas in the docstring of the module.

    Parameters
    ----------
    geometry : ChainGeometry
    redundant : tuple of int
    six : RemainingJoints
        The six joints; the axes of the last three meet.

    Raises
    ------
    NotApplicableError
        The last three axes do not meet, or no recipe fits.
    """

    def __init__(
        self, geometry: ChainGeometry, redundant: tuple[int, ...], six: RemainingJoints
    ) -> None:
        names = ", ".join(six.names[3:])
        centre = six.meeting(3, 4, 5)
        if centre is None:
            reason = "one of the joints is prismatic"
            if six.revolute[3:].all():
                reason = f"they miss a common point by {six.miss(3, 4, 5):.2g} m"
            raise NotApplicableError(
                f"the axes of {names} do not meet in a point: {reason}"
            )
        self._centre = centre
        point = f"the point where the axes of {names} meet"
        self.recipe, self._meeting = choose_recipe(point, six)
        super().__init__(geometry, redundant, six, (*self.recipe.factors, _WRIST))

    def _arm(self, screws: tuple[Screw, ...], _tool: np.ndarray | None = None) -> Arm:
        centre = self._centre.at(screws)
        return Arm(
            screws, centre, self._meeting.at(screws) if self._meeting else centre
        )

    def _steps(self, targets: np.ndarray, q_r: np.ndarray) -> Steps:
        screws, motion = self._displacement(targets, q_r)
        arm = self._arm(screws)
        base = self.recipe.solve(arm, motion.move(arm.centre))
        return arm, (*base, *_solve_wrist(arm, base, motion.rotation))


def _solve_wrist(
    arm: Arm, base: Sequence[np.ndarray], rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve R_u R_v R_w = (R_a R_b R_c)^-1 R_D for the angles of u, v, w."""
    u, v, w = arm.screws[3:]
    turns = [
        (joint.axis, q)
        for joint, q in zip(arm.base, base, strict=True)
        if joint.revolute
    ]
    end = apply(rotation, w.axis)
    for axis, q in turns:
        end = rotate(-axis, q, end)
    start = u.axis
    for axis, q in turns[::-1]:
        start = rotate(axis, q, start)
    start = apply_inverse(rotation, start)
    orbit = Circle.of(v.axis, w.axis)
    bend = orbit.component(-u.axis, -dot(u.axis, end), _FLIP)
    first = angle_about(u.axis, orbit.at(bend), end)
    last = angle_about(w.axis, start, rotate(-v.axis, bend, u.axis))
    return first, bend, last


@ik_family(
    "spherical_wrist",
    source="Pieper 1968; Paden 1985; Brandstoetter et al. 2014; IK-Geo 2022; `point_recipes`",
)
def spherical_wrist(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> SphericalWristSolver:
    """Fit the family: a pose is prescribed, and six joints remain, whose last or first three axes meet in a point."""
    six = RemainingJoints.of_pose(geometry, task_map, redundant)
    return fit(SphericalWristSolver, geometry, redundant, six)
