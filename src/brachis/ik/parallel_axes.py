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

Here p slides along s, and a letter's motion R is a rotation. Then, for all of them and seen along n, where vectors are
complex numbers and z(.) is a position's, G turns by theta = b + c + d:

    exp(i theta) = z(R_G e) / z(e),      w = z(G D0) - z(B) = z(G P) + exp(i theta) z(D0 - P) - z(B)
    elbow    |z(C - B) + exp(i c) z(D0 - C)| = |w|   for c (2),    exp(i b) = w / (z(C - B) + exp(i c) z(D0 - C))

with B, C, D0 on the axes b, c, d; d follows from theta. Chains whose last joints do what the first ones do above are
solved in the reverse order, E_6^-1 ... E_1^-1 = D^-1.

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

import itertools

import numpy as np

from brachis.ik.displacement import Displacement
from brachis.ik.geometry import ChainGeometry
from brachis.ik.parallel_chain import ParallelChain
from brachis.ik.parallel_equations import ParallelEquations
from brachis.ik.pose_joints import PoseJoints, largest_determinant, random_postures
from brachis.ik.protocol import Kind, NotApplicableError, ik_family
from brachis.ik.vectors import wrap
from brachis.robot import TaskMap

_WORDS = {
    "shoulder": ("front", "back"),
    "elbow": ("up", "down"),
    "wrist": ("noflip", "flip"),
    "rail": ("left", "right"),
}
_CONSTANT = 1e-9


class ParallelAxesSolver:
    """Closed form around three parallel axes; see the module's formulas."""

    kind: Kind = "closed_form"

    def __init__(self, geometry: ChainGeometry, redundant: tuple[int, ...], chain: ParallelChain) -> None:
        self._geometry = geometry
        self._redundant = redundant
        self._chain = chain
        posed = random_postures(geometry)
        factors = chain.factors(posed)
        rail = factors.get("rail", np.ones(1))
        if np.abs(rail).max() < _CONSTANT:
            raise NotApplicableError(f"{chain.slide_name} never moves the arm along the parallel axes")
        largest_determinant(posed, chain.joints)
        if np.ptp(rail) < _CONSTANT:
            factors.pop("rail", None)
        self._words = [name for name in _WORDS if name in factors and np.ptp(np.sign(factors[name])) > 0.0]
        self._signs = list(itertools.product((1.0, -1.0), repeat=len(self._words)))
        largest = {name: float(values[np.argmax(np.abs(values))]) for name, values in factors.items()}
        self._scales = {name: abs(value) if name in self._words else value for name, value in largest.items()}
        self.branches: tuple[str, ...] = tuple(
            "_".join(_WORDS[word][sign < 0.0] for word, sign in zip(self._words, signs, strict=True))
            for signs in self._signs
        )

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """See `IKSolver.branch_margins`: the factors of det J_nr, divided by their largest sizes."""
        factors = self._chain.factors(self._geometry.posed(q))
        signs = dict(zip(self._words, self._signs[branch], strict=True))
        return np.stack([signs.get(name, 1.0) * factors[name] / scale for name, scale in self._scales.items()], axis=1)

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        chain = self._chain
        equation = Displacement.of(self._geometry, self._redundant, targets, q_r)
        if chain.mirrored:
            equation = equation.reversed()
        with np.errstate(invalid="ignore", divide="ignore"):
            joints, along = ParallelEquations(chain, equation).solve()
        if "rail" in self._words:
            sides = np.stack([along > 0.0, along < 0.0], axis=-2)
            joints = np.where(sides, joints[..., None, :], np.nan)
        joints = joints.reshape(6, len(self.branches), -1)
        joints[equation.revolute] = wrap(joints[equation.revolute])
        joints[:, np.isnan(joints).any(axis=0)] = np.nan
        return np.moveaxis(joints[::-1] if chain.mirrored else joints, (0, 1, 2), (2, 1, 0))


@ik_family("parallel_axes", source="Hawkins 2013 and IK-Geo 2022 for six revolute joints; this module's docstring")
def parallel_axes(geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]) -> ParallelAxesSolver:
    """Fit the family: a pose, six joints left over, and three parallel axes in succession among them."""
    six = PoseJoints.of(geometry, task_map, redundant)
    return ParallelAxesSolver(geometry, redundant, ParallelChain.of(six))
