"""Six joints, three successive ones with parallel axes: UR arms and similar arms, on a fixed base or a rail.

The equation of the joints is E_1 ... E_6 = D (`FactoredSolver`). The parallel axes b, c, d have the direction n.
Without the joints before and after them, D leaves a planar motion G about n, which preserves n and distances along n:

    G = E_pre^-1 D E_post^-1 = E_b E_c E_d,    R_pre n = R_D R_post^T n,    n . (G x - x) = 0.

Let P be a point that no joint after the parallel ones moves, and A a point on the axis a.

    a | b c d | e f     Axes e and f meet at P.      shoulder   n . (E_a^-1 D P) = n . P             for a (2)
                        With y = R_D^T R_a n,        wrist      e . (R_f y) = e . n                  for f (2),
                                                                R_e R_f y = n                        for e
    p | b c d | e f     The same with y = R_D^T n;              n . (D P - s p) = n . P              for p
    p a | b c d | w     P is on the axis w.          wrist      a . (R_D R_w^T n) = a . n            for w (2),
                                                                R_a n = R_D R_w^T n                  for a,
                                                                n . E_a^-1 (D P - s p) = n . P       for p
    a p | b c d | w     The same with                           n . (E_a^-1 D P - s p) = n . P       for p

Here p slides along s, and R with the letter of a joint is its rotation. In all cases, G turns by theta = b + c + d:

    theta    turns e to R_G e about n,                  G D0 = G P + R_n(theta) (D0 - P)
    elbow    |E_c D0 - B| = |G D0 - B|   for c (2),     b turns E_c D0 to G D0

Here B and D0 are points on the axes b and d. If e is missing, w takes its place. The angle of d follows from theta. If
the last joints of a chain have the structure shown above for the first joints, the chain is solved in the reverse
order, E_6^-1 ... E_1^-1 = D^-1.

Branches are distinguished by the signs of these factors, whose product is det J_nr:

    shoulder  front, back    n . (a x (P - A))                       rail   left, right   n . s
    elbow     up, down       (D0 - B) . (c x (D0 - C))
    wrist     noflip, flip   (e x f) . n,  with one joint after the parallel ones (a x w) . n

all evaluated in the posture; the first word belongs to the positive sign. Each factor is, up to its sign, the
derivative of the left side of the equation with two solutions. The left side rises at one solution and falls at the
other; these two solutions are the two branches.

The case without a rail is in K. P. Hawkins, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms",
2013, and in A. J. Elias, J. T. Wen, "IK-Geo: unified robot inverse kinematics using subproblem decomposition", 2022,
without an order of the solutions. The cases with a rail are new.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.arm import Arm, RemainingJoints
from brachis.ik.branches import Factor, FactoredSolver, Steps, fit
from brachis.ik.point_recipes import move_within_plane
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, Circle, Poses, Screw, rotate
from brachis.ik.vectors import (
    angle_about,
    apply,
    apply_inverse,
    dot,
    meeting_point,
    sign,
)
from brachis.robot import TaskMap

_SHOULDER = 0
"""Slot of the two solutions of the shoulder, if there is one; elbow and wrist follow."""


class ParallelAxesSolver(FactoredSolver):
    """Closed form around three parallel axes; see the formulas in the docstring of the module.

    Parameters
    ----------
    geometry : ChainGeometry
    redundant : tuple of int
    joints : RemainingJoints
        The joints, in the order in which the solver solves for them.

    Raises
    ------
    NotApplicableError
        The joints do not have this structure.
    """

    def __init__(
        self,
        geometry: ChainGeometry,
        redundant: tuple[int, ...],
        joints: RemainingJoints,
    ) -> None:
        choices = [first for first in (1, 2) if _fits(joints, first)]
        if not choices:
            raise NotApplicableError(
                "no three successive joints with parallel axes have one joint before and two after them whose axes "
                "meet, or a slide and a revolute joint before and one after them, in this or the reverse order"
            )
        self._first = choices[0]
        before = joints.revolute[: self._first].tolist()
        self._turn = before.index(True) if True in before else 0
        self._slide = before.index(False) if False in before else None
        self._parallel = (self._first, self._first + 1, self._first + 2)
        # The factor of the wrist is spanned by f, the last joint, and by e, or by a if e is missing.
        self._beside = 4 if self._first == 1 else self._turn
        self._elbow = 0 if self._slide is not None else 1
        super().__init__(geometry, redundant, joints, self._factors_of_steps())

    def _factors_of_steps(self) -> tuple[Factor, ...]:
        """Return the factors of shoulder, elbow and wrist, or of elbow, wrist and rail."""
        elbow = Factor(self._elbow_factor, ("up", "down"))
        wrist = Factor(self._wrist_factor, ("noflip", "flip"))
        if self._slide is None:
            shoulder = Factor(self._shoulder_factor, ("front", "back"))
            return shoulder, elbow, wrist
        rail = Factor(self._rail_factor, ("left", "right"), (self._slide,))
        return elbow, wrist, rail

    def _arm(self, screws: tuple[Screw, ...], _tool: np.ndarray | None = None) -> Arm:
        """Build the arm, with P as its centre."""
        e, f = screws[4:]
        centre = f.point
        if self._first == 1:
            centre = meeting_point(e.axis, e.point, f.axis, f.point)
        return Arm(screws, centre, centre)

    def _shoulder_factor(self, arm: Arm) -> np.ndarray:
        """Return the velocity of P along the parallel axes that a causes."""
        velocity = arm.screws[self._turn].velocity(arm.centre)
        return dot(arm.screws[self._first].axis, velocity)

    def _elbow_factor(self, arm: Arm) -> np.ndarray:
        """Return the velocity, caused by c, of the axis of d away from the axis of b, times their distance."""
        b, c, d = (arm.screws[place] for place in self._parallel)
        return dot(d.point - b.point, c.velocity(d.point))

    def _wrist_factor(self, arm: Arm) -> np.ndarray:
        """Return the volume spanned by the axes of two joints and n."""
        normal = cross(arm.screws[self._beside].axis, arm.screws[5].axis)
        return dot(normal, arm.screws[self._first].axis)

    def _rail_factor(self, arm: Arm) -> np.ndarray:
        """Return the velocity of the arm along the parallel axes that p causes."""
        return dot(arm.screws[self._first].axis, arm.screws[self._slide or 0].axis)

    def _steps(self, targets: np.ndarray, q_r: np.ndarray) -> Steps:
        screws, motion = self._displacement(targets, q_r)
        arm = self._arm(screws)
        place = motion.move(arm.centre)
        values, angle, image = self._solve_outer(arm, motion, place)
        a, b, c, d = (screws[i] for i in (self._turn, *self._parallel))
        place = a.inverse.orbit(place).at(angle)
        n = b.axis
        following = screws[self._first + 3].axis
        theta = angle_about(n, following, rotate(a.axis, -angle, image))
        if self._slide is not None:
            s = screws[self._slide].axis
            if self._slide < self._turn:  # the joint a also turns this direction
                s = rotate(a.axis, -angle, s)
                turned = list(screws)
                turned[self._slide] = replace(screws[self._slide], axis=s)
                arm = replace(arm, screws=tuple(turned))
            values[self._slide] = dot(n, place - arm.centre) / dot(n, s)
            place = place - s * values[self._slide]
        end = place + rotate(n, theta, d.point - arm.centre)
        around = move_within_plane(b, c, d.point, end, self._elbow)
        outer, elbow = (np.flip(answers, axis=self._elbow) for answers in around)
        remaining = theta - outer - sign(dot(n, c.axis)) * elbow
        last = sign(dot(n, d.axis)) * remaining
        values |= zip(self._parallel, (outer, elbow, last), strict=True)
        return arm, [values[i] for i in range(6)]

    def _solve_outer(
        self, arm: Arm, motion: Poses, place: np.ndarray
    ) -> tuple[dict[int, np.ndarray], np.ndarray, np.ndarray]:
        """Solve for the revolute joints beside the parallel ones; return them, the angle of a, and R_D R_post^T e."""
        n = arm.screws[self._first].axis
        wrist = self._elbow + 1
        a = arm.screws[self._turn]
        e, f = arm.screws[4:]
        angle = np.zeros(1)
        if self._first == 1:
            if self._slide is None:
                level = -dot(n, arm.centre)
                angle = a.inverse.orbit(place).component(-n, level, _SHOULDER)
            y = apply_inverse(motion.rotation, rotate(a.axis, angle, n))
            last = Circle.of(f.axis, y).component(e.axis, dot(e.axis, n), wrist)
            bend = angle_about(e.axis, rotate(f.axis, last, y), n)
            values = {0: angle, 4: bend, 5: last}
            image = rotate(f.axis, -last, e.axis)
        else:
            direction = -apply_inverse(motion.rotation, a.axis)
            orbit = Circle.of(-f.axis, n)
            last = orbit.component(direction, -dot(a.axis, n), wrist)
            y = apply(motion.rotation, rotate(f.axis, -last, n))
            angle = angle_about(a.axis, n, y)
            values = {self._turn: angle, 5: last}
            image = f.axis
        return values, angle, apply(motion.rotation, image)


def _fits(six: RemainingJoints, first: int) -> bool:
    """Tell whether the axes of three joints from index `first` on are parallel, and the joints around them fit."""
    if not six.revolute[first:].all():
        return False
    if not six.are_parallel(first, first + 1, first + 2):
        return False
    if first == 1:
        return six.meeting(4, 5) is not None and not six.are_parallel(4, 5)
    return int(six.revolute[:2].sum()) == 1


@ik_family(
    "parallel_axes",
    source="Hawkins 2013 and IK-Geo 2022 for six revolute joints; this module's docstring",
)
def parallel_axes(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> ParallelAxesSolver:
    """Fit the family: a pose is prescribed, and six joints remain, three successive ones with parallel axes."""
    six = RemainingJoints.of_pose(geometry, task_map, redundant)
    return fit(ParallelAxesSolver, geometry, redundant, six)
