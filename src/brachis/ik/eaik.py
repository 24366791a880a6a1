"""Poses by six revolute joints whose axes are parallel or meet in places: EAIK's decomposition into subproblems.

Redundant joints may stand anywhere. Those before the first and behind the last of the six (a rail, a turntable, the
roll of the tool) move the base or the tool alone. With G_1 and G_2 their motions and M the tool's placement at the zero
posture, the target T asks of the chain in between for

    E_1(q_1) ... E_6(q_6) M = G_1^-1 T (G_2 M)^-1 M,

where redundant joints between the six are held at their values: these change the axes from sample to sample, and EAIK
looks at every different value anew (about ten microseconds).

EAIK's answers are believed only as far as they reach the target: near misses are polished, wrong and repeated answers
dropped. EAIK's order of the answers changes along a path; here they are told apart by the sign of det J_nr, which
changes only where two of them merge. Within a sign only continuity tells them apart. Answers of either sign are equally
many: the map from postures to poses has degree zero, for there are poses out of reach.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.ik.eaik_answers import EaikChain, installed
from brachis.ik.geometry import ChainGeometry
from brachis.ik.polish import EXACT, Poses, polished
from brachis.ik.pose_joints import determinant
from brachis.ik.protocol import Kind, NotApplicableError, ik_family
from brachis.robot import TaskMap
from brachis.robot.task_map import Pose

NOT_INSTALLED = 'EAIK is not installed (pip install "brachis[eaik]")'
"""Why EAIK is not asked, where that is the reason."""

_TURN = 2.0 * np.pi
_SAMPLES = 64
_SINGULAR = 1e-9
_REACHED = 1e-9
_SAME = 1e-5
_PER_SIGN = 8
"""Six revolute joints reach a pose in at most 16 ways."""
_CELLS = 1024
"""Answers are put in order by angles in so many parts of a turn, so that rounding seldom changes it."""


class EaikSolver:
    """Closed form by EAIK; see the module's formulas.

    Holds nothing of EAIK's own, which cannot be pickled.
    """

    kind: Kind = "closed_form"
    branches: tuple[str, ...] = ("determinant_positive",) * _PER_SIGN + ("determinant_negative",) * _PER_SIGN

    def __init__(self, geometry: ChainGeometry, redundant: tuple[int, ...]) -> None:
        rest = [i for i in range(geometry.n) if i not in redundant]
        first, last = rest[0], rest[-1]
        self._geometry = geometry
        self._before = [i for i in redundant if i < first]
        self._behind = [i for i in redundant if i > last]
        self._inner = slice(len(self._before), len(redundant) - len(self._behind))
        self._between = slice(first, last + 1)
        self._chain = _part(geometry, self._between)
        self._rest = [i - first for i in rest]
        self._held = [i - first for i in redundant[self._inner]]
        self._eaik = EaikChain(self._chain, self._held)
        self._tool = Poses.of_tool(geometry.held([], np.empty((1, 0))))
        postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, self._chain.n))
        jacobian = self._jacobian(postures)
        self._check_decomposition(postures[:, self._held])
        self._scale = float(np.abs(np.linalg.det(jacobian)).max())

    def _jacobian(self, q: np.ndarray) -> np.ndarray:
        """J_nr, (K, 6, 6), at postures of the chain in between, up to a change of the frame that leaves det J_nr."""
        return np.moveaxis(self._chain.posed(q).jacobian_columns(self._rest), 2, 0)

    def _check_decomposition(self, values: np.ndarray) -> None:
        """Refuse axes of which EAIK knows no decomposition."""
        if not self._eaik.knows(values):
            raise NotApplicableError("EAIK knows no decomposition: too few of the six axes are parallel or meet")

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        joints = np.full((len(q_r), len(self.branches), len(self._rest)), np.nan)
        finite = np.flatnonzero(np.isfinite(targets).all(axis=1) & np.isfinite(q_r).all(axis=1))
        if len(finite):
            joints[finite] = self._solve(targets[finite], q_r[finite])
        return joints

    def _solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        wanted, values = self._wanted(targets, q_r), q_r[:, self._inner]
        joints, samples, slack = self._eaik.answers(wanted.targets(), values)
        q = np.empty((len(joints), self._chain.n))
        q[:, self._held] = values[samples]
        q[:, self._rest] = joints
        determinants, right = self._put_to_test(q, wanted[samples], slack)
        return _in_slots(_wrapped(q[right][:, self._rest]), samples[right], determinants[right] < 0.0, len(q_r))

    def _put_to_test(self, q: np.ndarray, wanted: Poses, slack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Polish postures (N, n) that miss their poses by less than a slack (N,), in place.

        Returns
        -------
        determinants : (N,) ndarray
            Det J_nr.
        right : (R,) int ndarray
            Which postures reach their poses, and are not singular.
        """
        posed, six = self._chain.posed(q), tuple(self._rest)
        miss, determinants = wanted.miss(posed), determinant(posed, six)
        near = np.flatnonzero((miss > EXACT) & (miss < slack))
        joints = polished(self._chain, self._rest, q[near], wanted[near])
        converged = np.isfinite(joints[:, 0])
        moved = near[converged]
        q[moved[:, None], self._rest] = joints[converged]
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
        """See `IKSolver.branch_margins`: det J_nr, divided by its largest size."""
        sign = 1.0 if branch < _PER_SIGN else -1.0
        return sign * np.linalg.det(self._jacobian(q[:, self._between]))[:, None] / self._scale


def _part(geometry: ChainGeometry, joints: slice) -> ChainGeometry:
    """Take some successive joints out of a chain, with the tool frame as the zero posture places it."""
    return replace(
        geometry,
        joint_names=geometry.joint_names[joints],
        revolute=geometry.revolute[joints],
        axes=geometry.axes[joints],
        points=geometry.points[joints],
    )


def _wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles in (-pi, pi]."""
    return angles - _TURN * np.ceil((angles - np.pi) / _TURN)


def _in_slots(joints: np.ndarray, samples: np.ndarray, negative: np.ndarray, count: int) -> np.ndarray:
    """Put answers (N, 6) into the slots of their sign, in ascending order of the angles; NaN in slots left over."""
    keys = np.zeros(len(joints), dtype=np.int64)
    for cell in np.floor((joints + np.pi) * (_CELLS / _TURN)).astype(np.int64).T:
        keys = keys * (_CELLS + 1) + cell
    groups = 2 * samples + negative
    order = np.lexsort((keys, groups))
    order = order[~_repeated(joints[order], groups[order])]
    joints, groups = joints[order], groups[order]
    places = np.arange(len(groups)) - np.searchsorted(groups, groups)
    room = places < _PER_SIGN
    slots = np.full((2 * count, _PER_SIGN, joints.shape[1]), np.nan)
    slots[groups[room], places[room]] = joints[room]
    return slots.reshape(count, 2 * _PER_SIGN, -1)


def _repeated(joints: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Whether an answer, (N,), is one before it in the same group, modulo 2 pi."""
    repeated = np.zeros(len(joints), dtype=bool)
    for behind in range(1, len(joints)):
        together = np.flatnonzero(groups[behind:] == groups[:-behind])
        if len(together) == 0:
            break
        gap = np.abs(joints[together + behind] - joints[together])
        repeated[together + behind] |= np.minimum(gap, _TURN - gap).max(axis=1) < _SAME
    return repeated


def _check_rank(geometry: ChainGeometry, redundant: tuple[int, ...]) -> None:
    """Refuse a decomposition whose J_nr is singular at all of many random postures."""
    postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, geometry.n))
    columns = geometry.posed(postures).jacobian_columns([i for i in range(geometry.n) if i not in redundant])
    jacobian = np.moveaxis(columns, 2, 0)
    size = np.abs(jacobian[:, :3]).max()
    scaled = jacobian / np.array([size, size, size, 1.0, 1.0, 1.0])[:, None]
    if np.linalg.svd(scaled, compute_uv=False)[:, -1].max() < _SINGULAR:
        names = ", ".join(geometry.joint_names[i] for i in redundant)
        more = f": there is always a motion of the tool that needs {names}" if names else ""
        raise NotApplicableError(f"J_nr is singular everywhere{more}")


@ik_family(
    "eaik", source="D. Ostermeier, J. Külz, M. Althoff, Automatic geometric decomposition for analytical IK, 2025"
)
def eaik(geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]) -> EaikSolver:
    """Fit the family: a pose is prescribed, and six joints are left over, all revolute, which EAIK can solve."""
    if not isinstance(task_map, Pose):
        raise NotApplicableError("no whole pose is prescribed")
    sliding = [geometry.joint_names[i] for i in range(geometry.n) if i not in redundant and not geometry.revolute[i]]
    if sliding:
        raise NotApplicableError(f"{', '.join(sliding)} would be left over and not revolute")
    _check_rank(geometry, redundant)
    if not installed():
        raise NotApplicableError(NOT_INSTALLED)
    return EaikSolver(geometry, redundant)
