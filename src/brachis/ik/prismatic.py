"""Cartesian gantries: all non-redundant joints prismatic, so that the target is linear in them.

With t the non-redundant joints, z(q_r, t) = z(q_r, 0) + D(q_r) t, where the columns of D are the world directions of
the non-redundant joints. Redundant joints may be of any kind and anywhere in the chain.
"""

from __future__ import annotations

import numpy as np

from brachis.ik.protocol import IKSolver, NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import Pose, RowsAndYaw

_SAMPLES = 64


class PrismaticSolver(IKSolver):
    """Linear solver for prismatic non-redundant joints; see the module's formula."""

    def __init__(
        self, geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
    ) -> None:
        self._geometry = geometry
        self._redundant = list(redundant)
        self._rest = complement(geometry.n, redundant)
        self._rows = list(task_map.axes)
        postures = np.random.default_rng(0).uniform(
            -np.pi, np.pi, (_SAMPLES, geometry.n)
        )
        determinants = np.linalg.det(self._directions(postures)[1])
        self._scale = float(np.abs(determinants).max())
        if self._scale < 1e-9:
            raise NotApplicableError("J_nr is singular everywhere")
        turns = np.ptp(determinants) > 1e-9 * self._scale
        self.branches: tuple[str, ...] = (
            ("slides_positive", "slides_negative") if turns else ("slides",)
        )

    def _directions(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Task coordinates (K, m) and the matrix D (K, m, m) of the slides' directions."""
        posed = self._geometry.posed(q)
        return posed.tool_position[self._rows].T, np.moveaxis(
            posed.axes[self._rows][:, self._rest], 2, 0
        )

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        q = np.zeros((len(q_r), self._geometry.n))
        q[:, self._redundant] = q_r
        start, matrix = self._directions(q)
        determinants = np.linalg.det(matrix)
        regular = np.abs(determinants) > 1e-12 * self._scale
        matrix = np.where(regular[:, None, None], matrix, np.eye(matrix.shape[1]))
        slides = np.linalg.solve(matrix, (targets - start)[:, :, None])[:, :, 0]
        if len(self.branches) == 1:
            return slides[:, None, None]
        signs = np.array([1.0, -1.0])
        exists = regular[:, None] & (np.sign(determinants)[:, None] == signs)
        return np.where(exists[:, :, None], slides[:, None], np.nan)[:, :, None]

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """See `IKSolver.branch_margins`: the determinant of D, none where D is constant."""
        if len(self.branches) == 1:
            return np.zeros((len(q), 0), dtype=q.dtype)
        sign = 1.0 if branch == 0 else -1.0
        return sign * np.linalg.det(self._directions(q)[1])[:, None] / self._scale


@ik_family("prismatic", source="linear in the slides; this module's docstring")
def prismatic(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PrismaticSolver:
    """Fit the family: every non-redundant joint is prismatic and no angle is prescribed."""
    if isinstance(task_map, Pose):
        raise NotApplicableError("a whole pose is prescribed")
    turning = [
        geometry.joint_names[i]
        for i in complement(geometry.n, redundant)
        if geometry.revolute[i]
    ]
    if turning:
        raise NotApplicableError(
            f"{', '.join(turning)} would be left over and not prismatic"
        )
    if isinstance(task_map, RowsAndYaw):
        raise NotApplicableError("prismatic joints do not change yaw")
    return PrismaticSolver(geometry, task_map, redundant)
