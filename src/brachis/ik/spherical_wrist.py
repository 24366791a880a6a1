"""Six joints of which the last three, or the first three, have axes that meet in one point.

Let W0 be this point while the six joints are at zero. Then E_1 ... E_6 = D (`displacement`) moves it to

    W = E_a E_b E_c W0 = D W0,

for the last three, u, v, w, turn about it: equations for the first three, a, b, c, alone (`positioning`). What is left
is a rotation R_u R_v R_w = (R_a R_b R_c)^-1 R_D =: R, for axes u, v, w at any angles:

    v    u . R_v w = u . R w, two answers
    u    turns R_v w to R w
    w    turns R^-1 u to R_v^-1 u

If the first three meet instead (an arm with a spherical shoulder), the reverse equation E_6^-1 ... E_1^-1 = D^-1 is of
the same form. Redundant joints may stand anywhere, even between axes that meet, if the point where they do stays at its
place on one of them.

Branches are told apart by the signs of the two factors of a recipe (`position_recipes`) and of u . (w x v). Divided by
their largest size these are the branch margins. Their product is det J_nr up to a constant, so that a branch ends
exactly where J_nr is singular.

Source: D. L. Pieper, The kinematics of manipulators under computer control, PhD thesis, Stanford 1968; for the first
three joints see `positioning`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from brachis.ik.displacement import Displacement
from brachis.ik.geometry import ChainGeometry, PosedScrews
from brachis.ik.pose_joints import PoseJoints, largest_determinant, random_postures
from brachis.ik.position_recipes import RECIPES, WRIST, Factor, Recipe, reason_against, reason_singular
from brachis.ik.positioning import FLIP
from brachis.ik.protocol import Kind, NotApplicableError, ik_family
from brachis.ik.screws import Circle, Screw
from brachis.ik.spherical_arm import Anchor, Arm, meeting, miss
from brachis.ik.vectors import angle_about, apply, apply_inverse, dot, wrap
from brachis.robot import TaskSpace

_VANISHES = 1e-9
_WRIST = (3, 4, 5)
_LEFT = ("left", "right")


@dataclass(frozen=True)
class Structure:
    """Six joints, in one order or the other, and the recipe that fits them.

    Attributes
    ----------
    six : PoseJoints
    recipe : Recipe
    centre, meeting : Anchor
        See `Arm`.
    """

    six: PoseJoints
    recipe: Recipe
    centre: Anchor
    meeting: Anchor

    @classmethod
    def of(cls, six: PoseJoints) -> Structure:
        """Find the recipe.

        Raises
        ------
        NotApplicableError
            The last three axes do not meet, or no recipe fits.
        """
        centre = meeting(six, *_WRIST)
        if centre is None:
            raise NotApplicableError(_reason_against_centre(six))
        for recipe in RECIPES:
            if recipe.fits(six):
                point = meeting(six, *recipe.meets) if recipe.meets else None
                return cls(six, recipe, centre, point or centre)
        raise NotApplicableError(reason_against(six))

    @property
    def factors(self) -> tuple[Factor, Factor, Factor]:
        """Factors of det J_nr, of the slots `FRONT`, `UP`, `FLIP`."""
        return *self.recipe.factors, WRIST

    def arm(self, screws: tuple[Screw, ...]) -> Arm:
        """Put in the points."""
        return Arm(screws, self.centre.at(screws), self.meeting.at(screws))

    def held(self, equation: Displacement) -> Arm:
        """Screws while the six joints are at zero: (3, 1, 1, 1, K), a slot for each step."""
        axes, points = (array[:, :, None, None, None] for array in (equation.axes, equation.points))
        return self.arm(tuple(Screw(axes[:, i], points[:, i], bool(equation.revolute[i])) for i in range(6)))

    def posed(self, posed: PosedScrews) -> Arm:
        """Screws at postures, (3, K)."""
        axes = -posed.axes if self.six.mirrored else posed.axes
        return self.arm(tuple(Screw(axes[:, i], posed.points[:, i], bool(posed.revolute[i])) for i in self.six.joints))


def _reason_against_centre(six: PoseJoints) -> str:
    """Say why the last three joints have no centre."""
    names = ", ".join(six.names[3:])
    sliding = [six.names[i] for i in _WRIST if not six.revolute[i]]
    if sliding:
        return f"{' and '.join(sliding)} among {names} slides"
    return f"the axes of {names} do not meet in a point (they miss it by {miss(six, *_WRIST):.2g} m)"


class SphericalWristSolver:
    """Closed form of six joints with a spherical wrist or shoulder; see the module's formulas."""

    kind: Kind = "closed_form"

    def __init__(self, geometry: ChainGeometry, redundant: tuple[int, ...], structure: Structure) -> None:
        self._geometry = geometry
        self._redundant = redundant
        self._structure = structure
        posed = random_postures(geometry)
        values = [factor.value(structure.posed(posed)) for factor in structure.factors]
        self._scales = [float(np.abs(value).max()) for value in values]
        self._bounds = [slot for slot, value in enumerate(values) if np.ptp(value) > _VANISHES * self._scales[slot]]
        linear = [factor.linear(structure.six) for factor in structure.factors]
        self._signs = [_signs(value, one_answer=one) for value, one in zip(values, linear, strict=True)]
        self._choices = list(itertools.product(*self._signs))
        words = [_LEFT if one else factor.words for factor, one in zip(structure.factors, linear, strict=True)]
        named = [slot for slot in range(3) if len(self._signs[slot]) > 1]
        # Linear steps of which either side exists, but not for the same redundant joints.
        self._sided = [slot for slot in named if linear[slot]]
        self.branches: tuple[str, ...] = tuple(
            "_".join(words[slot][int(signs[slot] < 0.0)] for slot in named) for signs in self._choices
        )

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        structure = self._structure
        equation = Displacement.of(self._geometry, self._redundant, targets, q_r)
        if structure.six.mirrored:
            equation = equation.reversed()
        rotation, translation = equation.rotation[:, :, None, None, None], equation.translation[:, None, None, None]
        arm = structure.held(equation)
        with np.errstate(invalid="ignore", divide="ignore"):
            base = structure.recipe.solve(arm, apply(rotation, arm.centre) + translation)
            joints = self._collected((*base, *_wrist(arm, base, rotation)))
        for slot in self._sided:
            side = np.expand_dims(self._signs[slot], [axis for axis in range(4) if axis != slot])
            joints = np.where(side * structure.factors[slot].value(arm) > 0.0, joints, np.nan)
        ordered = joints[::-1] if structure.six.mirrored else joints
        return ordered.reshape(6, len(self.branches), len(targets)).T

    def _collected(self, values: tuple[np.ndarray, ...]) -> np.ndarray:
        """Positions of the six joints, (6, slots, K), all NaN where one of them is; angles in (-pi, pi]."""
        joints = np.empty((6, *(len(signs) for signs in self._signs), values[-1].shape[-1]))
        for place, value in enumerate(values):
            joints[place] = value
        revolute = self._structure.six.revolute
        turning = slice(None) if revolute.all() else revolute
        joints[turning] = wrap(joints[turning])
        return joints + 0.0 * joints.sum(axis=0)

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """See `IKSolver.branch_margins`: the factors of det J_nr that are not constant."""
        arm, signs = self._structure.posed(self._geometry.posed(q)), self._choices[branch]
        margins = np.empty((len(q), len(self._bounds)), dtype=q.dtype)
        for place, slot in enumerate(self._bounds):
            margins[:, place] = self._structure.factors[slot].value(arm) * (signs[slot] / self._scales[slot])
        return margins


def _signs(values: np.ndarray, *, one_answer: bool) -> np.ndarray:
    """Signs of a factor by which the branches of its step differ; its only one where nothing is to be told apart."""
    if one_answer and np.all(values[0] * values > 0.0):
        return np.sign(values[:1])
    return np.array([1.0, -1.0])


def _wrist(arm: Arm, base: tuple[np.ndarray, ...], rotation: np.ndarray) -> tuple[np.ndarray, ...]:
    """Solve R_u R_v R_w = (R_a R_b R_c)^-1 R_D for the angles of u, v, w."""
    u, v, w = arm.wrist
    turns = [(joint.axis, np.cos(q), np.sin(q)) for joint, q in zip(arm.base, base, strict=True) if joint.revolute]
    end = apply(rotation, w.axis)
    for axis, cos, sin in turns:
        end = Circle.of(axis, end).turned(cos, -sin)
    start = u.axis
    for axis, cos, sin in turns[::-1]:
        start = Circle.of(axis, start).turned(cos, sin)
    start = apply_inverse(rotation, start)
    orbit = Circle.of(v.axis, w.axis)
    bend = orbit.component(-u.axis, -dot(u.axis, end), FLIP)
    cos, sin = np.cos(bend), np.sin(bend)
    first = angle_about(u.axis, orbit.turned(cos, sin), end)
    last = angle_about(w.axis, start, Circle.of(v.axis, u.axis).turned(cos, -sin))
    return first, bend, last


@ik_family("spherical_wrist", source="Pieper 1968; Paden 1985; Brandstoetter et al. 2014; IK-Geo 2022; `positioning`")
def spherical_wrist(geometry: ChainGeometry, task_space: TaskSpace, redundant: tuple[int, ...]) -> SphericalWristSolver:
    """Fit the family: a pose, and six joints left over of which the last or the first three axes meet in a point."""
    six = PoseJoints.of(geometry, task_space, redundant)
    structure, reasons = None, []
    for order in (six, six.reversed()):
        try:
            structure = Structure.of(order)
        except NotApplicableError as reason:
            reasons.append(str(reason))
        else:
            break
    posed = random_postures(geometry)
    try:
        largest_determinant(posed, six.joints)
    except NotApplicableError as singular:
        raise NotApplicableError(f"{singular}{_reason_singular(structure, posed)}") from None
    if structure is None:
        raise NotApplicableError("; ".join(reasons))
    return SphericalWristSolver(geometry, redundant, structure)


def _reason_singular(structure: Structure | None, posed: PosedScrews) -> str:
    """Say why J_nr is singular everywhere, as far as it is known."""
    if structure is not None:
        arm = structure.posed(posed)
        for factor in structure.factors:
            if np.abs(factor.value(arm)).max() < _VANISHES:
                return f": {reason_singular(structure.six, factor)}"
    return ""
