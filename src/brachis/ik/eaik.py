"""Poses of six revolute joints of which some axes are parallel or meet: EAIK's decomposition into subproblems.

Redundant joints may be anywhere in the chain. Redundant joints before the first or after the last of the six (a rail, a
turntable, the roll of the tool) only move the base or the tool. Let G_1 and G_2 be their motions, and M the placement
of the tool in the zero posture. The target T then requires of the chain in between

    E_1(q_1) ... E_6(q_6) M = G_1^-1 T (G_2 M)^-1 M,

where redundant joints between the six are held at their values. The held values change the axes from sample to sample,
and EAIK has to analyse the arm anew for each different value (in about ten microseconds).

A solution of EAIK is accepted only if it reaches the target: near misses are polished, and wrong or repeated solutions
are dropped. The order of EAIK's solutions changes along a path, so the sign of det J_nr defines the branch here. Both
signs have the same number of solutions: the map from postures to poses has degree zero, because some poses are out of
reach.

EAIK's tolerance for parallel and meeting axes is close to the rounding error. A URDF that writes pi/2 with ten digits,
or a product of a few rotations, already exceeds this tolerance. Axes are therefore corrected by `exact_axes`. Held
joints are removed from the chain here, and EAIK is called for one pose at a time. EAIK's own function for fixed joints
crashes on a wrong index. EAIK's batches run in threads, where an error ends the process, and are not faster. Only the
compiled part of the package is loaded; the rest reads URDFs and needs libraries for meshes.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import cross
from brachis.ik.branches import DeterminantSolver, largest_size
from brachis.ik.newton import Newton
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, Poses
from brachis.ik.vectors import across, dot, wrap
from brachis.robot import TaskMap
from brachis.robot.joints import TURN, complement
from brachis.robot.task_map import Pose

NOT_INSTALLED = "EAIK is not installed (pip install EAIK)"
"""Reason why EAIK is not used, if it is not installed."""
EXACT_AXES = 1e-8
"""Axes that are parallel (rad) or meet (m) to within this tolerance are treated as exactly so."""
COARSE_AXES = 4e-5
"""Tolerance used instead if EAIK fails on axes that are almost parallel; the solutions then need polishing."""
_AMPLIFIED = 1e3
"""Factor between the error of the axes and the allowed error of solutions."""
_KEPT = 4096
"""Maximum number of EAIK's robots in the cache."""
_PER_SIGN = 8
"""Six revolute joints reach a pose in at most 16 ways, half of them with each sign of det J_nr."""


def is_installed() -> bool:
    """Return whether EAIK can be imported."""
    try:
        _import_eaik()
    except ModuleNotFoundError:
        return False
    return True


def _import_eaik() -> Any:
    return importlib.import_module("eaik.pybindings.EAIK")


class EaikSolver(DeterminantSolver):
    """Closed form by EAIK; see the formulas in the docstring of the module.

    Parameters
    ----------
    geometry : ChainGeometry
    task_map : Pose
    redundant : tuple of int
        The redundant joints. The six other joints are revolute.

    Raises
    ------
    NotApplicableError
        EAIK does not solve for these joints.
    """

    alternatives = _PER_SIGN

    def __init__(
        self, geometry: ChainGeometry, task_map: Pose, redundant: tuple[int, ...]
    ) -> None:
        non_redundant = complement(geometry.n, redundant)
        first = non_redundant[0]
        last = non_redundant[-1]
        self._before = [i for i in redundant if i < first]
        self._behind = [i for i in redundant if i > last]
        self._held = [i for i in redundant if first < i < last]
        self._inner = slice(len(self._before), len(redundant) - len(self._behind))
        self._newton = Newton(task_map, geometry)
        self._tool = Poses.of_tool(geometry.screws_with([], np.empty((1, 0))))
        self._robots: dict[tuple[float, ...], tuple[Any, float]] = {}
        postures = np.zeros((64, geometry.n))
        postures[:, first : last + 1] = np.random.default_rng(0).uniform(
            -np.pi, np.pi, (64, last + 1 - first)
        )
        super().__init__(geometry, redundant, postures=postures)
        if None in self._make_robots(postures[:, self._held], EXACT_AXES):
            raise NotApplicableError(
                "EAIK cannot decompose this arm: too few of the six axes are parallel or intersect"
            )

    def __getstate__(self) -> dict[str, Any]:
        """Leave out EAIK's robots, which cannot be pickled; they are created again when needed."""
        return {**self.__dict__, "_robots": {}}

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return the solutions that reach their targets, (K, 2, 8, 6); angles are in (-pi, pi]."""
        finite = np.flatnonzero(
            np.isfinite(targets).all(axis=1) & np.isfinite(q_r).all(axis=1)
        )
        inner = q_r[finite, self._inner]
        inner_targets = self._targets_between(targets[finite], q_r[finite])
        joints, samples, slack = self._ask(inner_targets, inner)
        inner_targets = inner_targets[samples]
        q = np.zeros((len(joints), self._chain.n))
        q[:, self._held] = inner[samples]
        q[:, self._joints] = joints
        miss, determinants = self._judge(q, inner_targets)
        near = np.flatnonzero((miss > 1e-13) & (miss < slack))
        polished = self._newton.polish(inner_targets[near], q[near], self._redundant)
        converged = np.isfinite(polished[:, 0])
        moved = near[converged]
        q[moved] = polished[converged]
        miss[moved], determinants[moved] = self._judge(q[moved], inner_targets[moved])
        right = np.flatnonzero((miss < 1e-9) & (determinants != 0.0))
        groups = 2 * finite[samples[right]] + (determinants[right] < 0.0)
        return _arrange(wrap(q[right][:, self._joints]), groups, len(q_r))

    def _targets_between(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return the targets of the chain between the outer redundant joints, G_1^-1 T (G_2 M)^-1 M."""
        poses = Poses.of_targets(targets)
        if self._before:
            undo = self._undo(self._before, q_r[:, : self._inner.start])
            poses = self._tool @ undo @ poses
        if self._behind:
            undo = self._undo(self._behind, q_r[:, self._inner.stop :])
            poses = poses @ undo @ self._tool
        return poses.targets()

    def _undo(self, joints: list[int], positions: np.ndarray) -> Poses:
        """Return the inverse tool placements with some joints at positions, (K, h), and the others at zero."""
        return Poses.of_tool(self._chain.screws_with(joints, positions)).inverse()

    def _judge(
        self, q: np.ndarray, expected: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the errors of postures, in m or as elements of rotation matrices, and det J_nr; (N,) each."""
        positions, rotations, twists = self._chain.tool(q, in_tool_axes=False)
        targets = np.concatenate([positions, rotations.reshape(-1, 9)], axis=1)
        columns = np.moveaxis(twists[:, :, self._joints], 0, 1)
        return np.abs(expected - targets).max(axis=1), np.linalg.det(columns)

    def _ask(
        self, targets: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Let EAIK solve for six joints.

        Parameters
        ----------
        targets : (K, 12) ndarray
            Poses as task coordinates.
        values : (K, h) ndarray
            Positions of the held joints, rad or m. Every different value needs a separate robot.

        Returns
        -------
        joints : (N, 6) ndarray
            Solutions as returned by EAIK: some are repeated or wrong, and their order has no meaning.
        samples : (N,) int ndarray
            Index of the sample to which each solution belongs, ascending.
        slack : (N,) ndarray
            Allowed error of correct solutions, m or rad.
        """
        robots = self._robots_at(values)
        poses = np.tile(np.eye(4), (len(targets), 1, 1))
        poses[:, :3, :3] = targets[:, 3:].reshape(-1, 3, 3)
        poses[:, :3, 3] = targets[:, :3]
        answers = [
            _calculate(robot, pose)
            for (robot, _), pose in zip(robots, poses, strict=True)
        ]
        samples = np.repeat(
            np.arange(len(answers)), [len(joints) for joints in answers]
        )
        joints = np.concatenate([np.empty((0, 6)), *answers])
        slack = np.array([slack for _, slack in robots])[samples]
        finite = np.isfinite(joints).all(axis=1)
        return joints[finite], samples[finite], slack[finite]

    def _robots_at(self, values: np.ndarray) -> list[tuple[Any, float]]:
        """Return the robots for held values, (K, h), with the allowed error of their solutions."""
        keys = [tuple(row) for row in values.tolist()]
        if len(self._robots) > _KEPT:
            self._robots = {}
        new = [key for key in dict.fromkeys(keys) if key not in self._robots]
        robots = self._make_robots(np.array(new), EXACT_AXES) if new else []
        for key, exact in zip(new, robots, strict=True):
            robot = exact
            slack = _AMPLIFIED * EXACT_AXES
            if robot is None:
                (robot,) = self._make_robots(np.array([key]), COARSE_AXES)
                slack = _AMPLIFIED * COARSE_AXES
            elif "NO_PARALLEL" in robot.get_kinematic_family():
                slack = 1e-4  # roots of quartic polynomials sometimes have few correct digits
            self._robots[key] = (robot, slack)
        return [self._robots[key] for key in keys]

    def _make_robots(self, values: np.ndarray, tolerance: float) -> list[Any]:
        """Create EAIK's robots for held values, (U, h); None for values without a decomposition."""
        create = _import_eaik().Robot
        use_double_precision = True
        screws = self._chain.screws_with(self._held, values)
        axes, points = exact_axes(
            screws.axes[:, self._joints], screws.points[:, self._joints], tolerance
        )
        tool = np.broadcast_to(screws.tool_position[:, None], points[:, :1].shape)
        offsets = np.diff(
            np.concatenate([points, tool], axis=1), axis=1, prepend=0.0 * tool
        )
        arrays = (
            np.moveaxis(array, 2, 0) for array in (axes, offsets, screws.tool_rotation)
        )
        robots: list[Any] = []
        for h, p, rotation in zip(*arrays, strict=True):
            try:
                robot = create(h, p, rotation, [], use_double_precision)
            except RuntimeError:  # axes that are almost parallel
                robots.append(None)
            else:
                robots.append(robot if robot.has_known_decomposition() else None)
        return robots


def _calculate(robot: Any, pose: np.ndarray) -> np.ndarray:
    """Return EAIK's solutions for one pose, (count, 6)."""
    try:
        joints = robot.calculate_IK(pose).Q if robot is not None else ()
    except RuntimeError:  # one of EAIK's subproblems failed
        joints = ()
    return np.asarray(joints).reshape(-1, 6)


def _arrange(joints: np.ndarray, groups: np.ndarray, count: int) -> np.ndarray:
    """Arrange solutions by samples and signs, without repetitions.

    The solutions are ordered by their angles, rounded to coarse steps so that rounding errors seldom change the order.
    The order has no meaning; it only makes equal calls return equal results.

    Parameters
    ----------
    joints : (N, 6) ndarray
    groups : (N,) int ndarray
        Two groups per sample: 2 k for the positive sign, 2 k + 1 for the negative sign.
    count : int
        Number of samples.

    Returns
    -------
    (count, 2, 8, 6) ndarray
        Solutions by sample and sign, followed by NaN.
    """
    marks = 0.5 + joints / TURN
    keys = np.zeros(len(joints), dtype=np.int64)
    cells = 1024
    for cell in np.floor(cells * marks).astype(np.int64).T:
        keys = keys * (cells + 1) + cell
    order = np.lexsort((keys, groups))
    order = order[~_find_repetitions(marks[order], groups[order])]
    groups = groups[order]
    places = np.arange(len(groups)) - np.searchsorted(groups, groups)
    fits = places < _PER_SIGN
    table = np.full((2 * count, _PER_SIGN, joints.shape[1]), np.nan)
    table[groups[fits], places[fits]] = joints[order[fits]]
    return table.reshape(count, 2, *table.shape[1:])


def _find_repetitions(marks: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Find solutions, (N,) bool, within 1e-5 rad of an earlier one in their group; `marks`, (N, 6), are in turns."""
    repeated = np.zeros(len(marks), dtype=bool)
    for behind in range(1, len(marks)):
        together = np.flatnonzero(groups[behind:] == groups[:-behind])
        if not len(together):
            break
        gap = np.abs(marks[together + behind] - marks[together])
        near = np.minimum(gap, 1.0 - gap).max(axis=1) < tolerances.POSTURE / TURN
        repeated[together + behind] |= near
    return repeated


def exact_axes(
    axes: np.ndarray, points: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Make axes that are parallel or meet to within a tolerance do so exactly.

    An axis that is parallel to an earlier one gets its direction. An axis that meets its predecessor is moved to the
    meeting point and is given by this point. A third axis that meets them there is given by the same point.

    Parameters
    ----------
    axes : (3, c, U) ndarray
        Unit directions of the c axes of U chains.
    points : (3, c, U) ndarray
        A point on each axis, m.
    tolerance : float
        Tolerance, rad for directions and m for points.

    Returns
    -------
    axes, points : (3, c, U) ndarray
    """
    normal = cross(axes[:, :, None], axes[:, None])
    leader = np.argmax(dot(normal, normal) < tolerance**2, axis=0)
    led = np.take_along_axis(axes, leader[None], axis=1)
    axes = led * np.sign(dot(led, axes))
    return axes, _let_meet(axes, points, tolerance)


def _let_meet(axes: np.ndarray, points: np.ndarray, tolerance: float) -> np.ndarray:
    """Return points, (3, c, U), where axes meet their predecessors, or else the points closest to the predecessors'."""
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


@ik_family(
    "eaik",
    source="D. Ostermeier, J. Külz, M. Althoff, Automatic geometric decomposition for analytical IK, 2025",
)
def eaik(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> EaikSolver:
    """Fit the family: a pose is prescribed, and six revolute joints remain for which EAIK can solve."""
    if not isinstance(task_map, Pose):
        raise NotApplicableError("this family solves only for poses")
    non_redundant = complement(geometry.n, redundant)
    sliding = [
        geometry.joint_names[i] for i in non_redundant if not geometry.revolute[i]
    ]
    if sliding:
        raise NotApplicableError(
            f"EAIK needs six revolute joints besides the redundant ones; prismatic: {', '.join(sliding)}"
        )
    largest_size(geometry.random_screws.determinant(non_redundant), geometry, redundant)
    if not is_installed():
        raise NotApplicableError(NOT_INSTALLED)
    return EaikSolver(geometry, task_map, redundant)
