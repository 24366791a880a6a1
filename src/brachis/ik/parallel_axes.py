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
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.ik.arm import Arm
from brachis.ik.displacement import Displacement
from brachis.ik.factored_solver import FactoredSolver, fitted
from brachis.ik.geometry import ChainGeometry
from brachis.ik.parallel_structure import ParallelStructure
from brachis.ik.placing import within_plane
from brachis.ik.pose_joints import PoseJoints
from brachis.ik.protocol import ik_family
from brachis.ik.screws import Circle
from brachis.ik.vectors import angle_about, apply, apply_inverse, dot, rotate
from brachis.robot import TaskMap

_SHOULDER = 0


class ParallelAxesSolver(FactoredSolver[ParallelStructure]):
    """Closed form around three parallel axes; see the module's formulas."""

    def steps(self, targets: np.ndarray, q_r: np.ndarray) -> tuple[Arm, Sequence[np.ndarray]]:
        """See `FactoredSolver.steps`."""
        structure = self._structure
        mirrored = structure.joints.mirrored
        equation = Displacement.of(self._geometry, self._redundant, targets, q_r, mirrored=mirrored)
        arm, rotation = structure.arm(equation.screws()), equation.rotation[:, :, None, None, None]
        place = apply(rotation, arm.centre) + equation.translation[:, None, None, None]
        values, angle, image = self._outer(arm, rotation, place)
        a, b, c, d = (arm.screws[i] for i in (structure.turn or 0, *structure.parallel))
        place, n, slide = a.inverse.orbit(place).at(angle), b.axis, structure.slide
        theta = angle_about(n, arm.screws[structure.first + 3].axis, rotate(a.axis, -angle, image))
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
        last = np.sign(dot(n, d.axis)) * (theta - outer - np.sign(dot(n, c.axis)) * elbow)
        values |= zip(structure.parallel, (outer, elbow, last), strict=True)
        return arm, [values[i] for i in range(6)]

    def _outer(
        self, arm: Arm, rotation: np.ndarray, place: np.ndarray
    ) -> tuple[dict[int, np.ndarray], np.ndarray, np.ndarray]:
        """Solve for the turning joints beside the parallel ones; return them, the angle of a, and R_D R_post^T e."""
        structure, angle = self._structure, np.zeros(1)
        n, turn, wrist = arm.screws[structure.first].axis, structure.turn, structure.elbow + 1
        a, e, f = arm.screws[turn or 0], arm.screws[4], arm.screws[5]
        if structure.first == 1:
            if turn is not None:
                angle = a.inverse.orbit(place).component(-n, -dot(n, arm.centre), _SHOULDER)
            y = apply_inverse(rotation, rotate(a.axis, angle, n))
            last = Circle.of(f.axis, y).component(e.axis, dot(e.axis, n), wrist)
            values = {4: angle_about(e.axis, rotate(f.axis, last, y), n), 5: last}
            image = rotate(f.axis, -last, e.axis)
        else:
            last = Circle.of(-f.axis, n).component(-apply_inverse(rotation, a.axis), -dot(a.axis, n), wrist)
            angle = angle_about(a.axis, n, apply(rotation, rotate(f.axis, -last, n)))
            values, image = {5: last}, f.axis
        if turn is not None:
            values[turn] = angle
        return values, angle, apply(rotation, image)


@ik_family("parallel_axes", source="Hawkins 2013 and IK-Geo 2022 for six revolute joints; this module's docstring")
def parallel_axes(geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]) -> ParallelAxesSolver:
    """Fit the family: a pose, six joints left over, and three parallel axes in succession among them."""
    six = PoseJoints.of(geometry, task_map, redundant)
    return ParallelAxesSolver(geometry, redundant, fitted(geometry, six, (ParallelStructure.of,)))
