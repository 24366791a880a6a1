"""Six joints of which the last three, or the first three, have axes that meet in one point.

Let W0 be this point while the six joints are at zero. Then E_1 ... E_6 = D (`displacement`) moves it to

    W = E_a E_b E_c W0 = D W0,

for the last three, u, v, w, turn about it: equations for the first three, a, b, c, alone (`placing`). What is left
is a rotation R_u R_v R_w = (R_a R_b R_c)^-1 R_D =: R, for axes u, v, w at any angles:

    v    u . R_v w = u . R w, two answers
    u    turns R_v w to R w
    w    turns R^-1 u to R_v^-1 u

If the first three meet instead (an arm with a spherical shoulder), the reverse equation E_6^-1 ... E_1^-1 = D^-1 is of
the same form. Redundant joints may stand anywhere, even between axes that meet, if the point where they do stays at its
place on one of them.

Branches are told apart by the signs of the two factors of a recipe (`position_recipes`) and of u . (w x v); see
`factors`.

Source: D. L. Pieper, The kinematics of manipulators under computer control, PhD thesis, Stanford 1968; for the first
three joints see `placing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.arm import Anchor, Arm, PoseJoints, RemainingJoints, meeting, miss
from brachis.ik.displacement import Displacement
from brachis.ik.factored_solver import (
    Factor,
    FactoredSolver,
    PlacingStructure,
    fitted,
    recipe_for,
)
from brachis.ik.placing import FLIP
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, Circle, PosedScrews, Screw
from brachis.ik.vectors import angle_about, apply, apply_inverse, dot
from brachis.robot import TaskMap

_WRIST = (3, 4, 5)


def wrist_factor(arm: Arm) -> np.ndarray:
    """Volume spanned by the axes of u, w, v."""
    u, v, w = arm.wrist
    return dot(u.axis, cross(w.axis, v.axis))


WRIST = Factor(
    wrist_factor,
    "the axes of {u}, {v}, {w} always are parallel to one plane",
    ("noflip", "flip"),
)


@dataclass(frozen=True)
class WristStructure(PlacingStructure):
    """Six joints of which the last three have axes that meet.

    Attributes
    ----------
    joints, recipe, meeting
        See `PlacingStructure`.
    centre : Anchor
        The point where they do.
    """

    centre: Anchor

    @classmethod
    def of(cls, six: RemainingJoints) -> WristStructure:
        """Find the centre and the recipe.

        Raises
        ------
        NotApplicableError
            The last three axes do not meet, or no recipe fits.
        """
        centre = meeting(six, *_WRIST)
        if centre is None:
            raise NotApplicableError(_reason_against_centre(six))
        return cls(six, *recipe_for(six, _point(six)), centre)

    @classmethod
    def backwards(cls, six: RemainingJoints) -> WristStructure:
        """See the joints from the tool: the axes of the first three have to meet."""
        return cls.of(six.reversed())

    @property
    def factors(self) -> tuple[Factor, ...]:
        """See `Structure.factors`; of the alternatives `FRONT`, `UP`, `FLIP`."""
        return *self.recipe.factors, WRIST

    def words(self) -> dict[str, str]:
        """See `Structure.words`."""
        return {
            **dict(zip("abcuvw", self.joints.names, strict=True)),
            "point": _point(self.joints),
        }

    def posed(self, posed: PosedScrews) -> Arm:
        """See `Structure.posed`."""
        return self.arm(self.joints.screws(posed))

    def arm(self, screws: tuple[Screw, ...]) -> Arm:
        """Put in the points."""
        centre = self.centre.at(screws)
        return Arm(screws, centre, self.meeting.at(screws) if self.meeting else centre)


def _point(six: RemainingJoints) -> str:
    """Put the centre into words."""
    return f"the point where the axes of {', '.join(six.names[3:])} meet"


def _reason_against_centre(six: RemainingJoints) -> str:
    """Say why the last three joints have no centre."""
    names = ", ".join(six.names[3:])
    sliding = [six.names[i] for i in _WRIST if not six.revolute[i]]
    if sliding:
        return f"{' and '.join(sliding)} among {names} slides"
    return f"the axes of {names} do not meet in a point (they miss it by {miss(six, *_WRIST):.2g} m)"


class SphericalWristSolver(FactoredSolver[WristStructure]):
    """Closed form of six joints with a spherical wrist or shoulder; see the module's formulas."""

    def steps(
        self, targets: np.ndarray, q_r: np.ndarray
    ) -> tuple[Arm, Sequence[np.ndarray]]:
        """See `FactoredSolver.steps`."""
        mirrored = self._structure.joints.mirrored
        equation = Displacement.of(
            self._geometry, self._redundant, targets, q_r, mirrored=mirrored
        )
        rotation = equation.rotation[:, :, None, None, None]
        translation = equation.translation[:, None, None, None]
        arm = self._structure.arm(equation.screws())
        base = self._structure.recipe.solve(
            arm, apply(rotation, arm.centre) + translation
        )
        return arm, (*base, *_wrist(arm, base, rotation))


def _wrist(
    arm: Arm, base: tuple[np.ndarray, ...], rotation: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Solve R_u R_v R_w = (R_a R_b R_c)^-1 R_D for the angles of u, v, w."""
    u, v, w = arm.wrist
    turns = [
        (joint.axis, np.cos(q), np.sin(q))
        for joint, q in zip(arm.base, base, strict=True)
        if joint.revolute
    ]
    end = apply(rotation, w.axis)
    for axis, cos, sin in turns:
        end = Circle.of(axis, end).turned(cos, -sin)
    start = u.axis
    for axis, cos, sin in turns[::-1]:
        start = Circle.of(axis, start).turned(cos, sin)
    start = apply_inverse(rotation, start)
    orbit = Circle.of(v.axis, w.axis)
    bend = orbit.component(-u.axis, -dot(u.axis, end), FLIP)
    cos = np.cos(bend)
    sin = np.sin(bend)
    first = angle_about(u.axis, orbit.turned(cos, sin), end)
    last = angle_about(w.axis, start, Circle.of(v.axis, u.axis).turned(cos, -sin))
    return first, bend, last


@ik_family(
    "spherical_wrist",
    source="Pieper 1968; Paden 1985; Brandstoetter et al. 2014; IK-Geo 2022; `placing`",
)
def spherical_wrist(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> SphericalWristSolver:
    """Fit the family: a pose, and six joints left over of which the last or the first three axes meet in a point."""
    six = PoseJoints.of(geometry, task_map, redundant)
    return SphericalWristSolver(
        geometry,
        redundant,
        fitted(geometry, six, (WristStructure.of, WristStructure.backwards)),
    )
