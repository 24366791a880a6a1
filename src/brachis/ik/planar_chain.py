"""A chain that moves in one plane, with plane vectors written as complex numbers.

With e1, e2 spanning the plane, the vector x e1 + y e2 is x + i y. A revolute joint turns the plane about its centre p:
w -> p + exp(i sigma q) (w - p); a prismatic joint shifts it: w -> w + d q. All joints before a joint act on what that
joint has done, so a chain is a composition of such maps, each of the form w -> alpha w + beta.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from brachis.ik.geometry import ChainGeometry
from brachis.ik.protocol import NotApplicableError
from brachis.robot import TaskMap
from brachis.robot.task_map import RowsAndYaw

_PARALLEL = 1e-9


@dataclass(frozen=True)
class PlanarChain:
    """Joints of a chain within their common plane.

    Attributes
    ----------
    revolute : (n,) bool ndarray
    sigma : (n,) ndarray
        +1 or -1, sense of each revolute joint about the plane's normal e1 x e2; 0 for prismatic joints.
    centre : (n,) complex ndarray
        Axis of each revolute joint at the zero posture, m.
    slide : (n,) complex ndarray
        Direction of each prismatic joint at the zero posture; 0 for one along the normal.
    tool : complex
        Tool frame origin at the zero posture, m.
    yaw : float
        Yaw at the zero posture, rad (0 if not prescribed).
    to_plane : (m_position, 2) ndarray, offset : (m_position,) ndarray
        Position rows of the task space are ``offset + to_plane @ (x, y)``.
    """

    revolute: np.ndarray
    sigma: np.ndarray
    centre: np.ndarray
    slide: np.ndarray
    tool: complex
    yaw: float
    to_plane: np.ndarray
    offset: np.ndarray

    @classmethod
    def of(cls, geometry: ChainGeometry, task_map: TaskMap) -> PlanarChain:
        """Find the plane from the screw axes.

        Raises
        ------
        NotApplicableError
            The joints do not move in one plane, or the rows cannot tell positions in it apart.
        """
        normal = _normal(geometry)
        first, second = _basis(normal, task_map)
        normal = np.cross(first, second)
        basis = first + 1j * second
        along = geometry.axes @ normal
        inert = ~geometry.revolute & (np.abs(along) > 1.0 - _PARALLEL)
        selection = np.eye(3)[list(task_map.axes)]
        if np.any(inert) and np.any(np.abs(selection @ normal) > _PARALLEL):
            raise NotApplicableError("a slide along the plane's normal changes the prescribed rows")
        to_plane = selection @ np.column_stack([first, second])
        offset = selection @ (normal * (normal @ geometry.tool_position))
        if np.linalg.matrix_rank(to_plane, tol=_PARALLEL) < min(2, len(to_plane)) or len(to_plane) > 2:  # noqa: PLR2004
            raise NotApplicableError("the prescribed rows do not fit the plane in which the joints move")
        yaw = 0.0
        if isinstance(task_map, RowsAndYaw):
            if abs(normal[task_map.world_axis]) < 1.0 - _PARALLEL:
                raise NotApplicableError("yaw turns in another plane than the joints")
            yaw = float(np.angle(basis @ geometry.tool_rotation[:, task_map.tool_axis]))
        return cls(
            revolute=geometry.revolute,
            sigma=np.where(geometry.revolute, np.sign(along), 0.0),
            centre=np.where(geometry.revolute, geometry.points @ basis, 0.0),
            slide=np.where(geometry.revolute | inert, 0.0, geometry.axes @ basis),
            tool=complex(basis @ geometry.tool_position),
            yaw=yaw,
            to_plane=to_plane,
            offset=offset,
        )

    def compose(self, joints: Iterable[int], q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (alpha, beta), each (K,), of the map of some joints, first outermost, at postures (K, n)."""
        alpha = np.ones(len(q), dtype=complex)
        beta = np.zeros(len(q), dtype=complex)
        for i in joints:
            if self.revolute[i]:
                turn = np.exp(1j * self.sigma[i] * q[:, i])
                beta = beta + alpha * self.centre[i] * (1.0 - turn)
                alpha = alpha * turn
            else:
                beta = beta + alpha * self.slide[i] * q[:, i]
        return alpha, beta

    def jacobian_determinant(self, q: np.ndarray, columns: list[int], rows: int) -> np.ndarray:
        """Compute the determinant of the task Jacobian's columns of some joints, up to a constant factor.

        Parameters
        ----------
        q : (K, n) ndarray
            Real or complex: written with cosines and sines, not complex numbers, so that complex steps work.
        columns : list of int
            As many joints as rows.
        rows : int
            1: one position row; 2: both plane coordinates; 3: these and yaw.

        Returns
        -------
        (K,) ndarray
        """
        x, y, angle = (np.full(len(q), value, dtype=q.dtype) for value in (self.tool.real, self.tool.imag, 0.0))
        # From the tool inwards: (x, y) is the tool as the joints seen so far have moved it.
        levers: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        turns: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for i in range(len(self.revolute) - 1, -1, -1):
            if self.revolute[i]:
                cos, sin = np.cos(q[:, i]), self.sigma[i] * np.sin(q[:, i])
                dx, dy = x - self.centre[i].real, y - self.centre[i].imag
                x = self.centre[i].real + cos * dx - sin * dy
                y = self.centre[i].imag + sin * dx + cos * dy
                levers[i] = (self.centre[i].imag - y, x - self.centre[i].real)
                turns[i] = (cos, sin)
            else:
                x, y = x + self.slide[i].real * q[:, i], y + self.slide[i].imag * q[:, i]
                levers[i] = (np.full_like(angle, self.slide[i].real), np.full_like(angle, self.slide[i].imag))
        matrix = np.empty((len(q), rows, len(columns)), dtype=q.dtype)
        for position, joint in enumerate(columns):
            vx, vy = levers[joint]
            for i in range(joint - 1, -1, -1):
                if self.revolute[i]:
                    cos, sin = turns[i]
                    vx, vy = cos * vx - sin * vy, sin * vx + cos * vy
            vector = (vx, vy)
            if rows == 1:
                matrix[:, 0, position] = self.to_plane[0, 0] * vx + self.to_plane[0, 1] * vy
            else:
                matrix[:, 0, position], matrix[:, 1, position] = vector
            if rows == 3:  # noqa: PLR2004
                matrix[:, 2, position] = float(self.revolute[joint])
        return _determinant(matrix)


def _determinant(matrix: np.ndarray) -> np.ndarray:
    """Compute determinants (K,) of matrices (K, m, m), m <= 3; written out, faster than LAPACK's batch."""
    if matrix.shape[1] == 1:
        return matrix[:, 0, 0]
    if matrix.shape[1] == 2:  # noqa: PLR2004
        return matrix[:, 0, 0] * matrix[:, 1, 1] - matrix[:, 0, 1] * matrix[:, 1, 0]
    return np.einsum("ki,ki->k", matrix[:, :, 0], np.cross(matrix[:, :, 1], matrix[:, :, 2]))


def _normal(geometry: ChainGeometry) -> np.ndarray:
    """Direction to which all revolute axes are parallel and each slide parallel or perpendicular."""
    turning = np.flatnonzero(geometry.revolute)
    if len(turning) == 0:
        raise NotApplicableError("no joint is revolute")
    normal = geometry.axes[turning[0]]
    for i in range(geometry.n):
        cosine = abs(geometry.axes[i] @ normal)
        name = geometry.joint_names[i]
        if geometry.revolute[i] and cosine < 1.0 - _PARALLEL:
            raise NotApplicableError(
                f"not planar: the axes of {geometry.joint_names[turning[0]]} and {name} are not parallel"
            )
        if not geometry.revolute[i] and _PARALLEL < cosine < 1.0 - _PARALLEL:
            raise NotApplicableError(f"not planar: {name} slides at an angle to the plane")
    return normal


def _basis(normal: np.ndarray, task_map: TaskMap) -> tuple[np.ndarray, np.ndarray]:
    """Two orthonormal vectors of the plane; the rows' own axes where the rows span it."""
    wanted = np.eye(3)[list(task_map.axes[:2])]
    if len(wanted) == 2 and np.all(np.abs(wanted @ normal) < _PARALLEL):  # noqa: PLR2004
        return wanted[0], wanted[1]
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)
