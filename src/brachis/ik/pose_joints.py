"""Which of the six joints that are left over for a pose are parallel or meet, whatever the redundant ones do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.arrays import cross
from brachis.errors import write_count
from brachis.ik.arm import aligned, meeting
from brachis.ik.geometry import ChainGeometry, PosedScrews
from brachis.ik.protocol import NotApplicableError
from brachis.ik.remaining_joints import RemainingJoints
from brachis.robot import TaskMap
from brachis.robot.task_map import Pose

_JOINTS = 6
_POSTURES = 256
_TOLERANCE = 1e-9
_SINGULAR = 1e-9


@dataclass(frozen=True)
class PoseJoints(RemainingJoints):
    """The six non-redundant joints of a pose; see `RemainingJoints`."""

    @classmethod
    def of(cls, geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]) -> PoseJoints:
        """Hold the redundant joints at random positions.

        Raises
        ------
        NotApplicableError
            No pose is prescribed, or other than six joints are left over.
        """
        if not isinstance(task_map, Pose):
            raise NotApplicableError("only for poses")
        if geometry.n - len(redundant) != _JOINTS:
            raise NotApplicableError(f"{write_count(geometry.n - len(redundant), 'joint')} would be left over, not six")
        return cls.beside(geometry, redundant)

    def parallel(self, *places: int) -> bool:
        """Whether joints are revolute and all their axes parallel."""
        first = self.axes[:, places[0]]
        sines = [np.abs(cross(first, self.axes[:, place])).max() for place in places[1:]]
        return bool(self.revolute[list(places)].all()) and max(sines) < _TOLERANCE

    def meet(self, first: int, second: int) -> bool:
        """Whether two joints are revolute and their axes meet in one point."""
        return meeting(self, first, second) is not None and not aligned(self, first, second)


def random_postures(geometry: ChainGeometry) -> PosedScrews:
    """Screws at random postures, by which branch margins are made dimensionless."""
    return geometry.posed(np.random.default_rng(1).uniform(-np.pi, np.pi, (_POSTURES, geometry.n)))


def determinant(posed: PosedScrews, joints: Sequence[int]) -> np.ndarray:
    """Det J_nr (K,) of six joints for a pose, or of three for a position; real or complex, and analytic."""
    return np.linalg.det(np.moveaxis(posed.jacobian_columns(joints)[: len(joints)], 2, 0))


def largest_determinant(posed: PosedScrews, joints: Sequence[int]) -> float:
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
