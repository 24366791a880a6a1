"""Six joints of which three in succession have parallel axes: UR arms and their like, also on a rail.

The joints are E_1 ... E_6 = D (`displacement`), the parallel axes b, c, d run along n, and what is left of D between
the joints before and after them is a planar motion G about n: it keeps n, and distances along n,

    G = E_pre^-1 D E_post^-1 = E_b E_c E_d,    R_pre n = R_D R_post^T n,    n . (G x - x) = 0.

Let P be a point that all joints after the parallel ones leave in place, and A one on the axis a.

    a | b c d | e f     Axes e and f meet at P.      shoulder   n . (E_a^-1 D P) = n . P             for a (2)
                        With y = R_D^T R_a n,        wrist      e . (R_f y) = e . n                  for f (2),
                                                                R_e R_f y = n                        for e
    p | b c d | e f     The same with y = R_D^T n;              n . (D P - s p) = n . P              for p
    p a | b c d | w     P is on the axis w.          wrist      a . (R_D R_w^T n) = a . n            for w (2),
                                                                R_a n = R_D R_w^T n                  for a,
                                                                n . E_a^-1 (D P - s p) = n . P       for p
    a p | b c d | w     The same with                           n . (E_a^-1 D P - s p) = n . P       for p

Here p slides along s, and a letter's motion R is a rotation. Then, for all of them, G turns by theta = b + c + d:

    theta    turns e to R_G e about n,                  G D0 = G P + R_n(theta) (D0 - P)
    elbow    |E_c D0 - B| = |G D0 - B|   for c (2),     b turns E_c D0 to G D0

with B, D0 on the axes b, d, and w in the place of e where there is no e; d follows from theta. Chains whose last joints
do what the first ones do above are solved in the reverse order, E_6^-1 ... E_1^-1 = D^-1.

Branches are told apart by the signs of these factors, of which det J_nr is the product:

    shoulder  front, back    n . (a x (P - A))                       rail   left, right   n . s
    elbow     up, down       (D0 - B) . (c x (D0 - C))
    wrist     noflip, flip   (e x f) . n,  with one joint after the parallel ones (a x w) . n

all at the posture; the first word is that of the positive sign. Each is, up to sign, the derivative of the left side of
the equation that has two solutions, so that the rising and the falling solution are the two branches.

The case without a rail is in K. P. Hawkins, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms",
2013, and in A. J. Elias, J. T. Wen, "IK-Geo: unified robot inverse kinematics using subproblem decomposition", 2022,
without an order of the solutions; the cases with a rail are ours.

What the six joints around three parallel axes are to each other; see `parallel_axes` for the formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.arm import Arm, PoseJoints
from brachis.ik.displacement import Displacement
from brachis.ik.factored_solver import Factor, FactoredSolver, Structure, fitted
from brachis.ik.placing import within_plane
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, Circle, PosedScrews, Screw
from brachis.ik.vectors import (
    angle_about,
    apply,
    apply_inverse,
    dot,
    meeting_point,
    rotate,
)
from brachis.robot import TaskMap

_LAST_FIRST = {1: 4, 2: 5}
"""Joints before the parallel ones, and the place of the first joint after them."""


@dataclass(frozen=True)
class ParallelStructure(Structure):
    """Roles of six joints, as places in their order.

    Attributes
    ----------
    joints
        See `Structure`.
    first : int
        Place of the first parallel joint, b; c and d follow it.
    turn, slide : int or None
        The revolute and the prismatic joint before them, a and p.
    """

    first: int
    turn: int | None
    slide: int | None

    @classmethod
    def of(cls, six: PoseJoints) -> ParallelStructure:
        """Find the roles, from the base to the tool or the other way round.

        Raises
        ------
        NotApplicableError
            The joints have not this structure; says what is missing.
        """
        triples = [
            first for first in range(4) if six.parallel(first, first + 1, first + 2)
        ]
        if not triples:
            raise NotApplicableError("no three successive joints have parallel axes")
        found = [
            structure
            for order in (six, six.reversed())
            for structure in _arrangements(order)
        ]
        if found:
            return found[0]
        names = ", ".join(six.names[triples[0] : triples[0] + 3])
        raise NotApplicableError(
            f"{names} are parallel, but the others are neither one joint before and two after whose axes meet, "
            "nor a slide and a revolute joint before and one after, in this or the reverse order"
        )

    @property
    def factors(self) -> tuple[Factor, ...]:
        """See `Structure.factors`; of the alternatives shoulder, elbow, wrist, or of elbow, wrist, rail."""
        elbow = Factor(
            self._elbow, "the axes of two of {b}, {c}, {d} coincide", ("up", "down")
        )
        wrist = Factor(
            self._wrist,
            "the axes of {x}, {f}, {b} always are parallel to one plane",
            ("noflip", "flip"),
        )
        if self.slide is None:
            way = "{a} does not move the point where the axes of {x} and {f} meet along the parallel axes"
            return Factor(self._shoulder, way, ("front", "back")), elbow, wrist
        rail = Factor(
            self._rail,
            "{p} never moves the arm along the parallel axes",
            ("left", "right"),
            (self.slide,),
        )
        return elbow, wrist, rail

    @property
    def parallel(self) -> tuple[int, int, int]:
        """Places of b, c and d."""
        return self.first, self.first + 1, self.first + 2

    @property
    def elbow(self) -> int:
        """Slot of the elbow; that of the wrist follows."""
        return int(self.slide is None)

    @property
    def beside(self) -> int:
        """Place of the joint that spans the wrist's factor with the last one: e, or a where there is none."""
        return 4 if self.first == 1 or self.turn is None else self.turn

    def words(self) -> dict[str, str]:
        """See `Structure.words`; x is e or a."""
        places = {"a": self.turn, "p": self.slide, "f": 5, "x": self.beside}
        places |= zip("bcd", self.parallel, strict=True)
        return {
            letter: self.joints.names[place]
            for letter, place in places.items()
            if place is not None
        }

    def posed(self, posed: PosedScrews) -> Arm:
        """See `Structure.posed`."""
        return self.arm(self.joints.screws(posed))

    def arm(self, screws: tuple[Screw, ...]) -> Arm:
        """Put in P, as the centre."""
        e, f = screws[4:]
        centre = (
            meeting_point(e.axis, e.point, f.axis, f.point)
            if self.first == 1
            else f.point
        )
        return Arm(screws, centre, centre)

    def _shoulder(self, arm: Arm) -> np.ndarray:
        """Velocity that a gives P along the parallel axes."""
        return dot(
            arm.screws[self.first].axis, arm.screws[self.turn or 0].velocity(arm.centre)
        )

    def _elbow(self, arm: Arm) -> np.ndarray:
        """Velocity that c gives the axis of d away from that of b, times its distance."""
        b, c, d = (arm.screws[place] for place in self.parallel)
        return dot(d.point - b.point, c.velocity(d.point))

    def _wrist(self, arm: Arm) -> np.ndarray:
        """Volume spanned by two axes and n."""
        return dot(
            cross(arm.screws[self.beside].axis, arm.screws[5].axis),
            arm.screws[self.first].axis,
        )

    def _rail(self, arm: Arm) -> np.ndarray:
        """Velocity that p gives the arm along the parallel axes."""
        return dot(arm.screws[self.first].axis, arm.screws[self.slide or 0].axis)


def _arrangements(six: PoseJoints) -> list[ParallelStructure]:
    """All ways to see the structure in one order of the joints."""
    structures = []
    for first, one_after in _LAST_FIRST.items():
        before = range(first)
        after = range(one_after, 6)
        turns = [place for place in before if six.revolute[place]]
        slides = [place for place in before if not six.revolute[place]]
        if (
            not six.parallel(first, first + 1, first + 2)
            or not six.revolute[list(after)].all()
        ):
            continue
        if first == 1 and not six.meet(4, 5):
            continue
        if first == 2 and len(turns) != 1:
            continue
        turn = turns[0] if turns else None
        slide = slides[0] if slides else None
        structures.append(ParallelStructure(six, first, turn, slide))
    return structures


_SHOULDER = 0


class ParallelAxesSolver(FactoredSolver[ParallelStructure]):
    """Closed form around three parallel axes; see the module's formulas."""

    def steps(
        self, targets: np.ndarray, q_r: np.ndarray
    ) -> tuple[Arm, Sequence[np.ndarray]]:
        """See `FactoredSolver.steps`."""
        structure = self._structure
        mirrored = structure.joints.mirrored
        equation = Displacement.of(
            self._geometry, self._redundant, targets, q_r, mirrored=mirrored
        )
        arm = structure.arm(equation.screws())
        rotation = equation.rotation[:, :, None, None, None]
        place = apply(rotation, arm.centre) + equation.translation[:, None, None, None]
        values, angle, image = self._outer(arm, rotation, place)
        a, b, c, d = (arm.screws[i] for i in (structure.turn or 0, *structure.parallel))
        place = a.inverse.orbit(place).at(angle)
        n = b.axis
        slide = structure.slide
        theta = angle_about(
            n, arm.screws[structure.first + 3].axis, rotate(a.axis, -angle, image)
        )
        if slide is not None:
            s = arm.screws[slide].axis
            if slide < (structure.turn or 0):  # a turns its direction as well
                s = rotate(a.axis, -angle, s)
                arm = arm.with_axis(slide, s)
            values[slide] = dot(n, place - arm.centre) / dot(n, s)
            place = place - s * values[slide]
        end = place + rotate(n, theta, d.point - arm.centre)
        around = within_plane(b, c, d.point, end, structure.elbow)
        outer, elbow = (np.flip(answers, axis=structure.elbow) for answers in around)
        last = np.sign(dot(n, d.axis)) * (
            theta - outer - np.sign(dot(n, c.axis)) * elbow
        )
        values |= zip(structure.parallel, (outer, elbow, last), strict=True)
        return arm, [values[i] for i in range(6)]

    def _outer(
        self, arm: Arm, rotation: np.ndarray, place: np.ndarray
    ) -> tuple[dict[int, np.ndarray], np.ndarray, np.ndarray]:
        """Solve for the turning joints beside the parallel ones; return them, the angle of a, and R_D R_post^T e."""
        structure = self._structure
        angle = np.zeros(1)
        n = arm.screws[structure.first].axis
        turn = structure.turn
        wrist = structure.elbow + 1
        a = arm.screws[turn or 0]
        e = arm.screws[4]
        f = arm.screws[5]
        if structure.first == 1:
            if turn is not None:
                angle = a.inverse.orbit(place).component(
                    -n, -dot(n, arm.centre), _SHOULDER
                )
            y = apply_inverse(rotation, rotate(a.axis, angle, n))
            last = Circle.of(f.axis, y).component(e.axis, dot(e.axis, n), wrist)
            values = {4: angle_about(e.axis, rotate(f.axis, last, y), n), 5: last}
            image = rotate(f.axis, -last, e.axis)
        else:
            last = Circle.of(-f.axis, n).component(
                -apply_inverse(rotation, a.axis), -dot(a.axis, n), wrist
            )
            angle = angle_about(a.axis, n, apply(rotation, rotate(f.axis, -last, n)))
            values = {5: last}
            image = f.axis
        if turn is not None:
            values[turn] = angle
        return values, angle, apply(rotation, image)


@ik_family(
    "parallel_axes",
    source="Hawkins 2013 and IK-Geo 2022 for six revolute joints; this module's docstring",
)
def parallel_axes(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> ParallelAxesSolver:
    """Fit the family: a pose, six joints left over, and three parallel axes in succession among them."""
    six = PoseJoints.of(geometry, task_map, redundant)
    return ParallelAxesSolver(
        geometry, redundant, fitted(geometry, six, (ParallelStructure.of,))
    )
