"""Six joints whose poses lead to a polynomial: a slide, a turn, two parallel axes, and two axes that meet.

    p a | x y | u v        p slides along s and a turns, in this or the other order; the axes of x and y run along n
                           through X and Y, and those of u and v meet at W

This is an arm with a spherical wrist on a rail with one of its wrist joints held, and an arm with three parallel axes
on a rail with one of those held. Chains that have this structure from the tool to the base are solved in the reverse
order.

With E_p E_a E_x E_y E_u E_v = D (`displacement`), theta = x + y and V = E_x E_y W = E_a^-1 (D W - s p),

    orientation     u . (R_n(theta)^T R_a^T R_D v) = u . v
    along n         n . (V - W) = 0
    distance        |V - R_n(theta) (W - Y) - X| = |Y - X|,  seen along n

are three equations for q_a, p and theta. Seen along n, vectors are complex numbers z(.), and with E = exp(i theta)

    Re(alpha E) = level,        alpha = z(u) conj(z(R_a^T R_D v)),   level = u . v - (n . u) (n . R_a^T R_D v)
    rate p = way,               rate = n . R_a^T s,                  way = n . (E_a^-1 D W - W)
    Re(beta E) = right,         beta = 2 rate z(W - Y) conj(zeta),   zeta = rate z(V - X)
                                right = |zeta|^2 + rate^2 (|W - Y|^2 - |Y - X|^2)

the third one after p has been put in. Alpha, level, rate and way are trigonometric polynomials of degree one in q_a,
and so is zeta: a position d less its slide is d - s (n_a . d) / (n_a . s) = n_a x (d x s) / (n_a . s), whose components
in the turned plane are those of d x s, turned by a right angle. Beta and right are of degree two. The first and the
third equation are linear in the real and the imaginary part of E; Cramer's rule and |E| = 1 leave

    F(q_a) = |right alpha - level beta|^2 - Im(alpha conj(beta))^2 = 0,

a trigonometric polynomial of degree six: at most twelve answers. Its real roots (`trigonometric`) are polished
together with p and theta on the three equations, x and y follow in the plane perpendicular to n, u and v from what is
left of the rotation, and every answer is put to the test: the tool has to reach its target within 2e-9.

No geometric choice tells the answers apart but the sign of det J_nr (`by_sign`). A long slide takes the tool far away,
so the map from joints to poses is proper; it does not reach all poses, so its degree is zero, and a regular pose has as
many answers with a positive as with a negative determinant: at most six of each.

The equations are ours; the resultant of two equations that are linear in a cosine and a sine is classical.
"""

from __future__ import annotations

import numpy as np

from brachis.ik.arm import PoseJoints, determinant, largest_determinant, random_postures
from brachis.ik.by_sign import SignSolver
from brachis.ik.displacement import Displacement
from brachis.ik.polish import Poses
from brachis.ik.polynomial_answers import joints_of_roots
from brachis.ik.polynomial_equations import Equations
from brachis.ik.protocol import Kind, NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry
from brachis.ik.trigonometric import real_roots, sample_angles
from brachis.ik.vectors import dot, wrap
from brachis.robot import TaskMap

_DEGREE = 6
_EACH = 6
_MISS = 2e-9
_ZERO = 1e-9


class PolynomialSolver(SignSolver):
    """Roots of a polynomial of degree twelve, found numerically; see the module's formulas."""

    kind: Kind = "polynomial"

    def __init__(
        self, geometry: ChainGeometry, redundant: tuple[int, ...], six: PoseJoints
    ) -> None:
        self._redundant = list(redundant)
        self._mirrored = six.mirrored
        self._turn = 0 if six.revolute[0] else 1
        posed = random_postures(geometry)
        slide, parallel = six.joints[1 - self._turn], six.joints[2]
        if np.abs(dot(posed.axes[:, slide], posed.axes[:, parallel])).max() < _ZERO:
            raise NotApplicableError(
                f"{six.names[1 - self._turn]} never moves the arm along the parallel axes"
            )
        joints = sorted(six.joints)
        super().__init__(geometry, joints, largest_determinant(posed, joints), _EACH)

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        equation = Displacement.of(
            self._chain, self._redundant, targets, q_r, mirrored=self._mirrored
        )
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            equations = Equations.of(equation, self._turn, 1 - self._turn)
            angles = real_roots(equations.resultant(sample_angles(_DEGREE)), _DEGREE)
            root, sample = np.nonzero(np.isfinite(angles))
            which, roots = equations[sample].guesses(angles[root, sample])
            sample = sample[which]
            roots = equations[sample].polished(roots)
            joints = joints_of_roots(equation[sample], self._turn, roots)
            joints[equation.revolute] = wrap(joints[equation.revolute])
            q = np.empty((len(sample), self._chain.n))
            q[:, self._redundant] = q_r[sample]
            q[:, self._joints] = (joints[::-1] if self._mirrored else joints).T
            posed = self._chain.posed(q)
            sound = Poses.of_targets(targets[sample]).miss(posed) < _MISS * (
                1.0 + np.abs(roots[1])
            )
            negative = determinant(posed, self._joints) < 0.0
        return self._arranged(
            q[sound][:, self._joints], sample[sound], negative[sound], len(q_r)
        )


def _structure(six: PoseJoints) -> PoseJoints:
    """Return the joints in the order in which they have the structure.

    Raises
    ------
    NotApplicableError
        They have it in neither order; says what is missing.
    """
    slides = [
        name
        for name, revolute in zip(six.names, six.revolute, strict=True)
        if not revolute
    ]
    if len(slides) != 1:
        raise NotApplicableError(
            f"one slide is needed among the six joints, not {len(slides)}"
        )
    for order in (six, six.reversed()):
        if order.revolute[:2].all() or not order.parallel(2, 3) or not order.meet(4, 5):
            continue
        if order.parallel(2, 3, 4) or (order.revolute[1] and order.parallel(1, 2, 3)):
            raise NotApplicableError(
                "three successive axes are parallel: that is closed form"
            )
        return order
    raise NotApplicableError(
        f"not {slides[0]} and a revolute joint before two with parallel axes and two whose axes meet, "
        "in this or the reverse order"
    )


@ik_family(
    "polynomial",
    source="resultant of two equations linear in a cosine and a sine; this module's docstring",
)
def polynomial(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PolynomialSolver:
    """Fit the family: a pose, and six joints left over that have the module's structure."""
    return PolynomialSolver(
        geometry, redundant, _structure(PoseJoints.of(geometry, task_map, redundant))
    )
