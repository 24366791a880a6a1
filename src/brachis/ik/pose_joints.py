"""Which of the six joints that are left over for a pose are parallel, meet, or slide, whatever the redundant ones do.

A property counts as given if it holds within 1e-9 (rad, or m) at random positions of the redundant joints; the closed
forms then take it as exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.ik.displacement import Displacement
from brachis.ik.geometry import ChainGeometry, PosedScrews
from brachis.ik.protocol import NotApplicableError
from brachis.ik.vectors import cross, dot
from brachis.robot import TaskSpace

_JOINTS = 6
_HELD_SAMPLES = 8
_POSTURES = 256
_TOLERANCE = 1e-9
_SINGULAR = 1e-9


@dataclass(frozen=True)
class PoseJoints:
    """The non-redundant joints of a pose, with their axes at S random positions of the redundant ones.

    Attributes
    ----------
    names : tuple of str
    joints : tuple of int
        Their places in the chain.
    revolute : (6,) bool ndarray
    axes, points : (3, 6, S) ndarray
        As in `Displacement`.
    mirrored : bool
        Whether they are listed from the tool to the base.
    """

    names: tuple[str, ...]
    joints: tuple[int, ...]
    revolute: np.ndarray
    axes: np.ndarray
    points: np.ndarray
    mirrored: bool = False

    @classmethod
    def of(cls, geometry: ChainGeometry, task_space: TaskSpace, redundant: tuple[int, ...]) -> PoseJoints:
        """Hold the redundant joints at random positions.

        Raises
        ------
        NotApplicableError
            No pose is prescribed, or other than six joints are left over.
        """
        rest = tuple(i for i in range(geometry.n) if i not in redundant)
        if not task_space.oriented:
            raise NotApplicableError("only for poses")
        if len(rest) != _JOINTS:
            raise NotApplicableError(f"{len(rest)} joints would be left over, not six")
        q_r = np.random.default_rng(0).uniform(-np.pi, np.pi, (_HELD_SAMPLES, len(redundant)))
        anywhere = np.tile(np.concatenate([np.zeros(3), np.eye(3).ravel()]), (_HELD_SAMPLES, 1))
        posed = Displacement.of(geometry, redundant, anywhere, q_r)
        return cls(tuple(geometry.joint_names[i] for i in rest), rest, posed.revolute, posed.axes, posed.points)

    def reversed(self) -> PoseJoints:
        """List the same joints in the reverse order; see `Displacement.reversed`."""
        return PoseJoints(
            names=self.names[::-1],
            joints=self.joints[::-1],
            revolute=self.revolute[::-1],
            axes=-self.axes[:, ::-1],
            points=self.points[:, ::-1],
            mirrored=not self.mirrored,
        )

    def parallel(self, *places: int) -> bool:
        """Whether joints are revolute and all their axes parallel."""
        first = self.axes[:, places[0]]
        sines = [np.abs(cross(first, self.axes[:, place])).max() for place in places[1:]]
        return bool(self.revolute[list(places)].all()) and max(sines) < _TOLERANCE

    def meet(self, first: int, second: int) -> bool:
        """Whether two joints are revolute and their axes meet in one point."""
        normal = cross(self.axes[:, first], self.axes[:, second])
        size = np.sqrt(dot(normal, normal))
        gap = np.abs(dot(normal, self.points[:, second] - self.points[:, first]))
        revolute = bool(self.revolute[first] and self.revolute[second])
        return revolute and bool(size.max() > _TOLERANCE) and bool(np.all(gap < _TOLERANCE * np.maximum(size, 1e-3)))


def random_postures(geometry: ChainGeometry) -> PosedScrews:
    """Screws at random postures, by which branch margins are made dimensionless."""
    return geometry.posed(np.random.default_rng(1).uniform(-np.pi, np.pi, (_POSTURES, geometry.n)))


def determinant(posed: PosedScrews, joints: tuple[int, ...]) -> np.ndarray:
    """Det J_nr (K,) of six joints; real or complex, and analytic."""
    return np.linalg.det(np.moveaxis(posed.jacobian_columns(joints), 2, 0))


def largest_determinant(posed: PosedScrews, joints: tuple[int, ...]) -> float:
    """Largest size of det J_nr.

    Raises
    ------
    NotApplicableError
        J_nr is singular in all postures.
    """
    scale = float(np.abs(determinant(posed, joints)).max())
    if scale < _SINGULAR:
        raise NotApplicableError("J_nr is singular everywhere")
    return scale
