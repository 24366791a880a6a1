"""Asking EAIK: chains of six revolute joints, made exact, and its answers as they come.

EAIK looks for axes that are parallel or meet with a tolerance near rounding, which a URDF that writes pi/2 with ten
digits, or a product of a few rotations, misses already; hence `exact_axes`. Joints that are held are taken out of the
chain here, and poses are asked for one by one: EAIK's own way of fixing joints crashes on a wrong index, and its
batches run in threads, where an error ends the process, without being faster. Of the package only the compiled part is
loaded; the rest reads URDFs, which takes libraries for meshes.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from brachis.arrays import cross
from brachis.ik.geometry import ChainGeometry
from brachis.ik.vectors import across, dot

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


def _extension() -> Any:  # noqa: ANN401  (a compiled module without types)
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

    def answers(self, targets: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
        found = [_ask(robot, pose) for (robot, _), pose in zip(robots, poses, strict=True)]
        samples = np.repeat(np.arange(len(found)), [len(joints) for joints in found])
        joints, slack = np.concatenate(found), np.array([slack for _, slack in robots])[samples]
        finite = np.isfinite(joints).all(axis=1)
        return joints[finite], samples[finite], slack[finite]

    def _robots_at(self, values: np.ndarray) -> list[tuple[Any, float]]:
        """Robots with the slack of their answers at held values, (K, h)."""
        keys = [tuple(row) for row in values.tolist()]
        kept = self._robots if len(self._robots) <= _KEPT else {}
        new = [key for key in dict.fromkeys(keys) if key not in kept]
        if new:
            made = self._made(np.array(new).reshape(len(new), len(self._held)), EXACT_AXES)
            for key, robot in zip(new, made, strict=True):
                if robot is None:
                    kept[key] = (self._made(np.array([key]), COARSE)[0], _AMPLIFIED * COARSE)
                else:
                    quartic = _QUARTIC in robot.get_kinematic_family()
                    kept[key] = (robot, _FEW_DIGITS if quartic else _AMPLIFIED * EXACT_AXES)
        self._robots = kept
        return [kept[key] for key in keys]

    def _made(self, values: np.ndarray, tolerance: float) -> list[Any]:
        """Make EAIK's robots at held values (U, h); None where it has no decomposition."""
        create = _extension().Robot
        none_fixed: list[tuple[int, float]] = []
        screws = self._chain.held(self._held, values)
        axes, points = exact_axes(screws.axes[:, self._rest], screws.points[:, self._rest], tolerance)
        tool = np.broadcast_to(screws.tool_position[:, None], points[:, :1].shape)
        offsets = np.concatenate([points[:, :1], np.diff(np.concatenate([points, tool], axis=1), axis=1)], axis=1)
        parts = (np.moveaxis(part, 2, 0) for part in (axes, offsets, screws.tool_rotation))
        robots: list[Any] = []
        for h, p, rotation in zip(*parts, strict=True):
            try:
                robot = create(h, p, rotation, none_fixed, True)  # noqa: FBT003  (double precision)
            except RuntimeError:  # axes that are almost parallel
                robot = None
            robots.append(robot if robot is not None and robot.has_known_decomposition() else None)
        return robots


def _ask(robot: Any, pose: np.ndarray) -> np.ndarray:  # noqa: ANN401
    """EAIK's answers for one pose, (count, 6)."""
    if robot is None:
        return _NONE
    try:
        joints = robot.calculate_IK(pose).Q
    except RuntimeError:  # one of its subproblems gave up
        return _NONE
    return joints if len(joints) else _NONE


def exact_axes(axes: np.ndarray, points: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
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
    meets = skew & (np.abs(dot(normal, np.diff(points, axis=1))) < tolerance * np.sqrt(size))
    for first in range(axes.shape[1] - 1):
        before, axis, start = axes[:, first], axes[:, first + 1], points[:, first]
        gap = points[:, first + 1] - start
        along = dot(cross(gap, axis), normal[:, first]) / size[first]
        along = np.where(np.abs(along) < tolerance, 0.0, along)
        points[:, first + 1] = np.where(meets[first], start + before * along, start + across(axis, gap))
    return points
