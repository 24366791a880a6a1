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

Asking EAIK: chains of six revolute joints, made exact, and its answers as they come.

EAIK looks for axes that are parallel or meet with a tolerance near rounding, which a URDF that writes pi/2 with ten
digits, or a product of a few rotations, misses already; hence `exact_axes`. Joints that are held are taken out of the
chain here, and poses are asked for one by one: EAIK's own way of fixing joints crashes on a wrong index, and its
batches run in threads, where an error ends the process, without being faster. Of the package only the compiled part is
loaded; the rest reads URDFs, which takes libraries for meshes.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.arm import determinant, largest_determinant, random_postures
from brachis.ik.by_sign import SignSolver
from brachis.ik.polish import EXACT, Poses, polished
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry
from brachis.ik.vectors import across, dot, wrap
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import Pose

EXACT_AXES = 1e-8
"""Axes this near to parallel, or to meeting, are taken to do so, rad or m."""
COARSE = 4e-5
"""The same where EAIK makes nothing of axes that are almost parallel; such answers need polishing."""
_AMPLIFIED = 1e3
"""How much farther than their axes answers may be off."""
_QUARTIC = "NO_PARALLEL"
"""In the names of families for which EAIK takes the roots of quartic polynomials, now and then with few digits."""
_FEW_DIGITS = 1e-4
_KEPT = 4096
_NONE = np.empty((0, 6))


def installed() -> bool:
    """Whether EAIK can be imported."""
    try:
        _extension()
    except ModuleNotFoundError:
        return False
    return True


def _extension() -> Any:
    return importlib.import_module("eaik.pybindings.EAIK")


class EaikChain:
    """EAIK's robots of a chain of which all joints but six are held.

    Parameters
    ----------
    chain : ChainGeometry
    held : sequence of int
        The joints that are held; the six others are revolute.
    """

    def __init__(self, chain: ChainGeometry, held: Sequence[int]) -> None:
        self._chain = chain
        self._held = list(held)
        self._rest = [i for i in range(chain.n) if i not in self._held]
        self._robots: dict[tuple[float, ...], tuple[Any, float]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Leave EAIK's robots out, which cannot be pickled; they are made again when needed."""
        return {**self.__dict__, "_robots": {}}

    def knows(self, values: np.ndarray) -> bool:
        """Whether EAIK has a decomposition at each of some held values (U, h)."""
        return all(robot is not None for robot in self._made(values, EXACT_AXES))

    def answers(
        self, targets: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Let EAIK solve for six joints.

        Parameters
        ----------
        targets : (K, 12) ndarray
            Poses as task coordinates.
        values : (K, h) ndarray
            Of the held joints, rad or m. Every different value needs a robot of its own.

        Returns
        -------
        joints : (N, 6) ndarray
            As EAIK returns them: some repeated, some wrong, in an order that means nothing.
        samples : (N,) int ndarray
            To which of the K samples they belong, ascending.
        slack : (N,) ndarray
            By how much right answers may miss their target, m or rad.
        """
        robots = self._robots_at(values)
        poses = np.zeros((len(targets), 4, 4))
        poses[:, :3, :3] = targets[:, 3:].reshape(-1, 3, 3)
        poses[:, :3, 3] = targets[:, :3]
        poses[:, 3, 3] = 1.0
        found = [
            _ask(robot, pose) for (robot, _), pose in zip(robots, poses, strict=True)
        ]
        samples = np.repeat(np.arange(len(found)), [len(joints) for joints in found])
        joints = np.concatenate(found)
        slack = np.array([slack for _, slack in robots])[samples]
        finite = np.isfinite(joints).all(axis=1)
        return joints[finite], samples[finite], slack[finite]

    def _robots_at(self, values: np.ndarray) -> list[tuple[Any, float]]:
        """Robots with the slack of their answers at held values, (K, h)."""
        keys = [tuple(row) for row in values.tolist()]
        kept = self._robots if len(self._robots) <= _KEPT else {}
        new = [key for key in dict.fromkeys(keys) if key not in kept]
        if new:
            made = self._made(
                np.array(new).reshape(len(new), len(self._held)), EXACT_AXES
            )
            for key, robot in zip(new, made, strict=True):
                if robot is None:
                    kept[key] = (
                        self._made(np.array([key]), COARSE)[0],
                        _AMPLIFIED * COARSE,
                    )
                else:
                    quartic = _QUARTIC in robot.get_kinematic_family()
                    kept[key] = (
                        robot,
                        _FEW_DIGITS if quartic else _AMPLIFIED * EXACT_AXES,
                    )
        self._robots = kept
        return [kept[key] for key in keys]

    def _made(self, values: np.ndarray, tolerance: float) -> list[Any]:
        """Make EAIK's robots at held values (U, h); None where it has no decomposition."""
        create = _extension().Robot
        none_fixed: list[tuple[int, float]] = []
        screws = self._chain.held(self._held, values)
        axes, points = exact_axes(
            screws.axes[:, self._rest], screws.points[:, self._rest], tolerance
        )
        tool = np.broadcast_to(screws.tool_position[:, None], points[:, :1].shape)
        offsets = np.concatenate(
            [points[:, :1], np.diff(np.concatenate([points, tool], axis=1), axis=1)],
            axis=1,
        )
        parts = (
            np.moveaxis(part, 2, 0) for part in (axes, offsets, screws.tool_rotation)
        )
        robots: list[Any] = []
        for h, p, rotation in zip(*parts, strict=True):
            try:
                robot = create(h, p, rotation, none_fixed, True)  # noqa: FBT003  (double precision)
            except RuntimeError:  # axes that are almost parallel
                robot = None
            robots.append(
                robot if robot is not None and robot.has_known_decomposition() else None
            )
        return robots


def _ask(robot: Any, pose: np.ndarray) -> np.ndarray:
    """EAIK's answers for one pose, (count, 6)."""
    if robot is None:
        return _NONE
    try:
        joints = robot.calculate_IK(pose).Q
    except RuntimeError:  # one of its subproblems gave up
        return _NONE
    return joints if len(joints) else _NONE


def exact_axes(
    axes: np.ndarray, points: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Make axes that are parallel, or that meet, to within a tolerance do so exactly.

    An axis that is parallel to one before it takes over its direction. An axis that meets its predecessor is moved to
    where it does, and given by that point; a third one that meets them there is given by the very same point.

    Parameters
    ----------
    axes : (3, c, U) ndarray
        Unit directions of the c axes of U chains.
    points : (3, c, U) ndarray
        A point on each axis, m.
    tolerance : float
        rad for directions, m for points.

    Returns
    -------
    axes, points : (3, c, U) ndarray
    """
    axes = _aligned(axes, tolerance)
    return axes, _meeting(axes, points, tolerance)


def _aligned(axes: np.ndarray, tolerance: float) -> np.ndarray:
    """Directions (3, c, U), each that of the first axis to which it is parallel."""
    normal = cross(axes[:, :, None], axes[:, None])
    leader = np.argmax(dot(normal, normal) < tolerance**2, axis=0)
    led = np.take_along_axis(axes, leader[None], axis=1)
    return led * np.sign(dot(led, axes))


def _meeting(axes: np.ndarray, points: np.ndarray, tolerance: float) -> np.ndarray:
    """Points (3, c, U): where an axis meets its predecessor, else the one nearest to the predecessor's point."""
    points = points.copy()
    normal = cross(axes[:, :-1], axes[:, 1:])
    size = dot(normal, normal)
    skew = size > tolerance**2
    size = np.where(skew, size, 1.0)
    meets = skew & (
        np.abs(dot(normal, np.diff(points, axis=1))) < tolerance * np.sqrt(size)
    )
    for first in range(axes.shape[1] - 1):
        before = axes[:, first]
        axis = axes[:, first + 1]
        start = points[:, first]
        gap = points[:, first + 1] - start
        along = dot(cross(gap, axis), normal[:, first]) / size[first]
        along = np.where(np.abs(along) < tolerance, 0.0, along)
        points[:, first + 1] = np.where(
            meets[first], start + before * along, start + across(axis, gap)
        )
    return points


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

    def __init__(self, geometry: ChainGeometry, redundant: tuple[int, ...]) -> None:
        rest = complement(geometry.n, redundant)
        first = rest[0]
        last = rest[-1]
        self._geometry = geometry
        self._before = [i for i in redundant if i < first]
        self._behind = [i for i in redundant if i > last]
        self._inner = slice(len(self._before), len(redundant) - len(self._behind))
        self._between = slice(first, last + 1)
        chain = _part(geometry, self._between)
        six = [i - first for i in rest]
        self._held = [i - first for i in redundant[self._inner]]
        self._eaik = EaikChain(chain, self._held)
        self._tool = Poses.of_tool(geometry.held([], np.empty((1, 0))))
        postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, chain.n))
        if not self._eaik.knows(postures[:, self._held]):
            raise NotApplicableError(
                "EAIK knows no decomposition: too few of the six axes are parallel or meet"
            )
        super().__init__(
            chain,
            six,
            float(np.abs(determinant(chain.posed(postures), six)).max()),
            _PER_SIGN,
        )

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        joints = np.full((len(q_r), 2, _PER_SIGN, len(self._joints)), np.nan)
        finite = np.flatnonzero(
            np.isfinite(targets).all(axis=1) & np.isfinite(q_r).all(axis=1)
        )
        if len(finite):
            joints[finite] = self._solve(targets[finite], q_r[finite])
        return joints

    def _solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        wanted = self._wanted(targets, q_r)
        values = q_r[:, self._inner]
        joints, samples, slack = self._eaik.answers(wanted.targets(), values)
        q = np.empty((len(joints), self._chain.n))
        q[:, self._held] = values[samples]
        q[:, self._joints] = joints
        determinants, right = self._put_to_test(q, wanted[samples], slack)
        return self._arranged(
            wrap(q[right][:, self._joints]),
            samples[right],
            determinants[right] < 0.0,
            len(q_r),
        )

    def _put_to_test(
        self, q: np.ndarray, wanted: Poses, slack: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Polish postures (N, n) that miss their poses by less than a slack (N,), in place.

        Returns
        -------
        determinants : (N,) ndarray
            Det J_nr.
        right : (R,) int ndarray
            Which postures reach their poses, and are not singular.
        """
        posed = self._chain.posed(q)
        six = self._joints
        miss = wanted.miss(posed)
        determinants = determinant(posed, six)
        near = np.flatnonzero((miss > EXACT) & (miss < slack))
        joints = polished(self._chain, six, q[near], wanted[near])
        converged = np.isfinite(joints[:, 0])
        moved = near[converged]
        q[moved[:, None], six] = joints[converged]
        posed = self._chain.posed(q[moved])
        miss[moved], determinants[moved] = (
            wanted[moved].miss(posed),
            determinant(posed, six),
        )
        return determinants, np.flatnonzero((miss < _REACHED) & (determinants != 0.0))

    def _wanted(self, targets: np.ndarray, q_r: np.ndarray) -> Poses:
        """Targets of the chain in between, G_1^-1 T (G_2 M)^-1 M; `held` returns G M."""
        wanted = Poses.of_targets(targets)
        geometry = self._geometry
        inner = self._inner
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
        largest_determinant(
            random_postures(geometry), complement(geometry.n, redundant)
        )
    except NotApplicableError as singular:
        names = ", ".join(geometry.joint_names[i] for i in redundant)
        more = (
            f": there is always a motion of the tool that needs {names}"
            if names
            else ""
        )
        raise NotApplicableError(f"{singular}{more}") from None


@ik_family(
    "eaik",
    source="D. Ostermeier, J. Külz, M. Althoff, Automatic geometric decomposition for analytical IK, 2025",
)
def eaik(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> EaikSolver:
    """Fit the family: a pose is prescribed, and six joints are left over, all revolute, which EAIK can solve."""
    if not isinstance(task_map, Pose):
        raise NotApplicableError("no whole pose is prescribed")
    sliding = [
        geometry.joint_names[i]
        for i in complement(geometry.n, redundant)
        if not geometry.revolute[i]
    ]
    if sliding:
        raise NotApplicableError(
            f"{', '.join(sliding)} would be left over and not revolute"
        )
    _check_rank(geometry, redundant)
    if not installed():
        raise NotApplicableError(NOT_INSTALLED)
    return EaikSolver(geometry, redundant)
