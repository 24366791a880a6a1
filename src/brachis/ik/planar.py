"""Rows of positions: chains that move in one plane, and joints that all slide.

Planar chains leave one or two joints of any kind to the closed form, or three where yaw is prescribed. With the
redundant joints held, W0 is the tool while the others are at zero, and W its target in the plane:

    one joint     the row's component of E_a W0 is given:                    a cosine, or a line
    two joints    E_a E_b W0 = W:                                            `move_within_plane`
    with yaw      E_a E_b E_c = D, where D turns by the angle that yaw asks for, and brings W0 to W

With yaw one revolute joint leaves a point P of its axis in place and follows from the angle. Two joints are left:

    c revolute    E_a E_b P = D P
    a revolute    E_c^-1 E_b^-1 P = D^-1 P
    b alone       two slides: a along its direction, c along that which D gives it, bring P to D P

Angles are about the plane's normal, whatever the senses of the joints. Then det J_nr is positive at the first one of
the two answers, and negative at the second; where both joints slide there is one answer.

Where all non-redundant joints slide, and no angle is prescribed, the target is linear in their positions t: it is
z(q_r, 0) + D(q_r) t, where the columns of D are their directions. Redundant joints may be of any kind.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.ik.determinant_branches import DeterminantSolver
from brachis.ik.point_recipes import move_within_plane
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, PosedScrews, Screw
from brachis.ik.vectors import EXACT, determinants, rotate, wrap
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import Pose, RowsAndYaw

_LABELS = {
    "RR": "elbow",
    "RP": "reach",
    "PR": "reach",
    "PP": "slides",
    "R": "swing",
    "P": "slide",
}
"""What branches are called after the kinds of the joints that remain when one has been given to yaw."""


class PlanarSolver(DeterminantSolver):
    """Closed form of a planar chain; see the module's formulas.

    Parameters
    ----------
    geometry : ChainGeometry
    task_map : TaskMap
    redundant : tuple of int
    normal : (3,) ndarray
        Of the plane.
    """

    def __init__(
        self,
        geometry: ChainGeometry,
        task_map: TaskMap,
        redundant: tuple[int, ...],
        normal: np.ndarray,
    ) -> None:
        rest = complement(geometry.n, redundant)
        self._redundant = redundant
        self._normal = normal
        self._rows = np.eye(3)[list(task_map.axes)]
        self._plane = _basis(normal, self._rows) if len(rest) > 1 else self._rows
        self._tool_axis = (
            task_map.tool_axis if isinstance(task_map, RowsAndYaw) else None
        )
        self._senses = np.where(
            geometry.revolute, np.sign(geometry.axes @ normal), 1.0
        )[rest]
        letters = ["R" if geometry.revolute[i] else "P" for i in rest]
        if self._tool_axis is not None:
            self._last = len(letters) - 1 - letters[::-1].index("R")
            del letters[self._last]
        super().__init__(geometry, rest, _LABELS["".join(letters)])

    def _determinants(self, screws: PosedScrews) -> np.ndarray:
        columns = screws.jacobian_columns(self._joints)
        rows = np.tensordot(self._plane, columns[:3], 1)
        if self._tool_axis is not None:
            turns = np.tensordot(self._normal, columns[3:], 1)
            rows = np.concatenate([rows, turns[None]])
        return determinants(rows) * self._senses.prod()

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return the non-redundant joints, (K, 2, 1, m)."""
        screws = self._chain.screws_with(self._redundant, q_r)
        joints = [
            Screw(
                screws.axes[:, i, None] * sense,
                screws.points[:, i, None],
                bool(screws.revolute[i]),
            )
            for i, sense in zip(self._joints, self._senses, strict=True)
        ]
        tool = screws.tool_position[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            if len(joints) == 1:
                orbit = joints[0].orbit(tool)
                row = self._rows[0][:, None, None]
                values = [orbit.component(row, targets[:, 0], 0)]
            elif self._tool_axis is None:
                a, b = joints
                goal = self._goal(targets, tool)
                values = [*move_within_plane(a, b, tool, goal, 0)]
            else:
                values = self._values_with_yaw(joints, tool, targets, screws)
            answers = np.stack(np.broadcast_arrays(*values), axis=-1)
            return self._arrange(answers * self._senses, q_r)

    def _goal(self, targets: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Position of the tool that the rows ask for, (3, 1, K), at its height above the plane."""
        height = np.tensordot(self._normal, tool[:, 0], 1)
        given = np.concatenate([targets[:, :2].T, height[None]])
        return np.linalg.solve(np.vstack([self._rows, self._normal]), given)[:, None]

    def _values_with_yaw(
        self,
        joints: list[Screw],
        tool: np.ndarray,
        targets: np.ndarray,
        screws: PosedScrews,
    ) -> list[np.ndarray]:
        """Positions of three joints for a point and an angle."""
        normal = self._normal[:, None, None]
        heading = np.tensordot(self._plane, screws.tool_rotation[:, self._tool_axis], 1)
        angle = targets[:, 2] - np.arctan2(heading[1], heading[0])
        goal = self._goal(targets, tool)
        a, b, c = joints
        anchor = next(i for i in (2, 0, 1) if joints[i].revolute)
        point = joints[anchor].point
        if anchor == 0:
            end = tool + rotate(normal, -angle, point - goal)
            pair = move_within_plane(c.inverse, b.inverse, point, end, 0)[::-1]
        else:
            end = goal + rotate(normal, angle, point - tool)
            second = b
            if anchor == 1:
                second = replace(c, axis=rotate(normal, angle, c.axis))
            pair = move_within_plane(a, second, point, end, 0)
        values = list(pair)
        for joint, value in zip(
            joints[:anchor] + joints[anchor + 1 :], pair, strict=True
        ):
            if joint.revolute:
                angle = angle - value
        values.insert(anchor, angle)
        return values

    def _arrange(self, answers: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Arrange answers (R, K, m): two follow each other as the branches do, one has the sign of its determinant."""
        revolute = self._chain.revolute[self._joints]
        answers[..., revolute] = wrap(answers[..., revolute])
        answers += 0.0 * answers.sum(axis=-1, keepdims=True)
        if len(answers) == 1:
            q = np.empty((len(q_r), self._chain.n))
            q[:, self._redundant] = q_r
            q[:, self._joints] = answers[0]
            sign = np.sign(self._determinants(self._chain.screws_at(q)))
            exists = sign == np.array([[1.0], [-1.0]])
            answers = np.where(exists[:, :, None], answers, np.nan)
        return np.swapaxes(answers, 0, 1)[:, :, None]


def _plane_normal(geometry: ChainGeometry) -> np.ndarray:
    """Direction to which all revolute axes are parallel and each slide parallel or perpendicular."""
    turning = np.flatnonzero(geometry.revolute)
    if not len(turning):
        raise NotApplicableError("no joint is revolute")
    normal = geometry.axes[turning[0]]
    for name, axis, revolute in zip(
        geometry.joint_names, geometry.axes, geometry.revolute, strict=True
    ):
        cosine = abs(axis @ normal)
        if revolute and cosine < 1.0 - EXACT:
            raise NotApplicableError(
                f"not planar: the axes of {geometry.joint_names[turning[0]]} and {name} are not parallel"
            )
        if not revolute and EXACT < cosine < 1.0 - EXACT:
            raise NotApplicableError(
                f"not planar: {name} slides at an angle to the plane"
            )
    return normal


def _basis(normal: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Two orthonormal vectors of the plane, (2, 3); the rows' own axes where these span it."""
    if len(rows) == 2 and np.all(np.abs(rows @ normal) < EXACT):
        return rows
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


@ik_family(
    "planar",
    source="two circles, circle and line, two lines: elementary plane geometry",
)
def planar(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PlanarSolver:
    """Fit the family: all joints move in one plane that the prescribed rows can see."""
    if isinstance(task_map, Pose):
        raise NotApplicableError("a whole pose is prescribed")
    normal = _plane_normal(geometry)
    rows = np.eye(3)[list(task_map.axes)]
    basis = _basis(normal, rows)
    normal = np.cross(*basis)
    inert = ~geometry.revolute & (np.abs(geometry.axes @ normal) > 1.0 - EXACT)
    if inert.any() and np.any(np.abs(rows @ normal) > EXACT):
        raise NotApplicableError(
            "a slide along the plane's normal changes the prescribed rows"
        )
    if len(rows) > 2 or np.linalg.matrix_rank(rows @ basis.T, tol=EXACT) < len(rows):
        raise NotApplicableError(
            "the prescribed rows do not fit the plane in which the joints move"
        )
    if isinstance(task_map, RowsAndYaw):
        if abs(normal[task_map.world_axis]) < 1.0 - EXACT:
            raise NotApplicableError("yaw turns in another plane than the joints")
        if not geometry.revolute[complement(geometry.n, redundant)].any():
            raise NotApplicableError("no revolute joint is left to set yaw")
    return PlanarSolver(geometry, task_map, redundant, normal)


class PrismaticSolver(DeterminantSolver):
    """Linear solver for prismatic non-redundant joints; see the module's formula."""

    def __init__(
        self, geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
    ) -> None:
        self._redundant = list(redundant)
        self._rows = list(task_map.axes)
        super().__init__(geometry, complement(geometry.n, redundant), "slides")
        if np.ptp(self._random) <= EXACT * self._scale:
            self.branches = ("slides",)

    def _directions(self, screws: PosedScrews) -> np.ndarray:
        """Return the matrices D, (m, m, K)."""
        return screws.axes[self._rows][:, self._joints]

    def _determinants(self, screws: PosedScrews) -> np.ndarray:
        return determinants(self._directions(screws))

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return the non-redundant joints, (K, B, 1, m)."""
        screws = self._chain.screws_with(self._redundant, q_r)
        values = self._determinants(screws)
        regular = np.abs(values) > 1e-12 * self._scale
        matrices = np.moveaxis(self._directions(screws), 2, 0)
        matrices = np.where(regular[:, None, None], matrices, np.eye(len(self._rows)))
        gap = targets - screws.tool_position[self._rows].T
        slides = np.linalg.solve(matrices, gap[:, :, None])[:, None, None, :, 0]
        if len(self.branches) == 1:
            return slides
        exists = regular[:, None] & (np.sign(values)[:, None] == (1.0, -1.0))
        return np.where(exists[:, :, None, None], slides, np.nan)

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Return the determinant of D; no margin where D is constant."""
        margins = super().branch_margins(q, branch)
        return margins if len(self.branches) == 2 else margins[:, :0]


@ik_family("prismatic", source="linear in the slides; the docstring of `planar`")
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
