"""Poses by six revolute joints whose axes are parallel or meet in places: EAIK's decomposition into subproblems.

Redundant joints may stand anywhere. Those before the first and behind the last of the six (a rail, a turntable, the
roll of the tool) move the base or the tool alone. With G_1 and G_2 their motions and M the tool's placement at the zero
posture, the target T asks of the chain in between for

    E_1(q_1) ... E_6(q_6) M = G_1^-1 T (G_2 M)^-1 M,

where redundant joints between the six are held at their values: these change the axes from sample to sample, and EAIK
looks at every different value anew (about ten microseconds).

EAIK's answers are believed only as far as they reach the target: near misses are polished, wrong and repeated answers
dropped. EAIK's order of the answers changes along a path; here they are told apart by the sign of det J_nr (`by_sign`).
Answers of either sign are equally many: the map from postures to poses has degree zero, as some poses are out of reach.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.ik.by_sign import SignSolver
from brachis.ik.eaik_answers import EaikChain, installed
from brachis.ik.geometry import ChainGeometry
from brachis.ik.polish import EXACT, Poses, polished
from brachis.ik.pose_joints import determinant, largest_determinant, random_postures
from brachis.ik.protocol import Kind, NotApplicableError, ik_family
from brachis.ik.vectors import wrap
from brachis.robot import TaskMap
from brachis.robot.joint_space import complement
from brachis.robot.task_map import Pose

NOT_INSTALLED = "EAIK is not installed (pip install EAIK)"
"""Why EAIK is not asked, where that is the reason."""

_SAMPLES = 64
_REACHED = 1e-9
_PER_SIGN = 8
"""Six revolute joints reach a pose in at most 16 ways."""


class EaikSolver(SignSolver):
    """Closed form by EAIK; see the module's formulas.

    Holds nothing of EAIK's own, which cannot be pickled.
    """

    kind: Kind = "closed_form"

    def __init__(self, geometry: ChainGeometry, redundant: tuple[int, ...]) -> None:
        rest = complement(geometry.n, redundant)
        first, last = rest[0], rest[-1]
        self._geometry = geometry
        self._before = [i for i in redundant if i < first]
        self._behind = [i for i in redundant if i > last]
        self._inner = slice(len(self._before), len(redundant) - len(self._behind))
        self._between = slice(first, last + 1)
        chain, six = _part(geometry, self._between), [i - first for i in rest]
        self._held = [i - first for i in redundant[self._inner]]
        self._eaik = EaikChain(chain, self._held)
        self._tool = Poses.of_tool(geometry.held([], np.empty((1, 0))))
        postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, chain.n))
        if not self._eaik.knows(postures[:, self._held]):
            raise NotApplicableError("EAIK knows no decomposition: too few of the six axes are parallel or meet")
        super().__init__(chain, six, float(np.abs(determinant(chain.posed(postures), six)).max()), _PER_SIGN)

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        joints = np.full((len(q_r), 2, _PER_SIGN, len(self._joints)), np.nan)
        finite = np.flatnonzero(np.isfinite(targets).all(axis=1) & np.isfinite(q_r).all(axis=1))
        if len(finite):
            joints[finite] = self._solve(targets[finite], q_r[finite])
        return joints

    def _solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        wanted, values = self._wanted(targets, q_r), q_r[:, self._inner]
        joints, samples, slack = self._eaik.answers(wanted.targets(), values)
        q = np.empty((len(joints), self._chain.n))
        q[:, self._held] = values[samples]
        q[:, self._joints] = joints
        determinants, right = self._put_to_test(q, wanted[samples], slack)
        return self._arranged(wrap(q[right][:, self._joints]), samples[right], determinants[right] < 0.0, len(q_r))

    def _put_to_test(self, q: np.ndarray, wanted: Poses, slack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Polish postures (N, n) that miss their poses by less than a slack (N,), in place.

        Returns
        -------
        determinants : (N,) ndarray
            Det J_nr.
        right : (R,) int ndarray
            Which postures reach their poses, and are not singular.
        """
        posed, six = self._chain.posed(q), self._joints
        miss, determinants = wanted.miss(posed), determinant(posed, six)
        near = np.flatnonzero((miss > EXACT) & (miss < slack))
        joints = polished(self._chain, six, q[near], wanted[near])
        converged = np.isfinite(joints[:, 0])
        moved = near[converged]
        q[moved[:, None], six] = joints[converged]
        posed = self._chain.posed(q[moved])
        miss[moved], determinants[moved] = wanted[moved].miss(posed), determinant(posed, six)
        return determinants, np.flatnonzero((miss < _REACHED) & (determinants != 0.0))

    def _wanted(self, targets: np.ndarray, q_r: np.ndarray) -> Poses:
        """Targets of the chain in between, G_1^-1 T (G_2 M)^-1 M; `held` returns G M."""
        wanted, geometry, inner = Poses.of_targets(targets), self._geometry, self._inner
        if self._before:
            placed = Poses.of_tool(geometry.held(self._before, q_r[:, : inner.start]))
            wanted = self._tool @ placed.inverse() @ wanted
        if self._behind:
            placed = Poses.of_tool(geometry.held(self._behind, q_r[:, inner.stop :]))
            wanted = wanted @ placed.inverse() @ self._tool
        return wanted

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """See `SignSolver.branch_margins`; what moves base or tool alone leaves det J_nr as it is."""
        return super().branch_margins(q[:, self._between], branch)


def _part(geometry: ChainGeometry, joints: slice) -> ChainGeometry:
    """Take some successive joints out of a chain, with the tool frame as the zero posture places it."""
    return replace(
        geometry,
        joint_names=geometry.joint_names[joints],
        revolute=geometry.revolute[joints],
        axes=geometry.axes[joints],
        points=geometry.points[joints],
    )


def _check_rank(geometry: ChainGeometry, redundant: tuple[int, ...]) -> None:
    """Refuse a decomposition whose J_nr is singular at all of many random postures."""
    try:
        largest_determinant(random_postures(geometry), complement(geometry.n, redundant))
    except NotApplicableError as singular:
        names = ", ".join(geometry.joint_names[i] for i in redundant)
        more = f": there is always a motion of the tool that needs {names}" if names else ""
        raise NotApplicableError(f"{singular}{more}") from None


@ik_family(
    "eaik", source="D. Ostermeier, J. Külz, M. Althoff, Automatic geometric decomposition for analytical IK, 2025"
)
def eaik(geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]) -> EaikSolver:
    """Fit the family: a pose is prescribed, and six joints are left over, all revolute, which EAIK can solve."""
    if not isinstance(task_map, Pose):
        raise NotApplicableError("no whole pose is prescribed")
    sliding = [geometry.joint_names[i] for i in complement(geometry.n, redundant) if not geometry.revolute[i]]
    if sliding:
        raise NotApplicableError(f"{', '.join(sliding)} would be left over and not revolute")
    _check_rank(geometry, redundant)
    if not installed():
        raise NotApplicableError(NOT_INSTALLED)
    return EaikSolver(geometry, redundant)
