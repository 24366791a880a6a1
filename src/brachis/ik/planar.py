"""Positions, with or without an angle, for chains that move in one plane and along its normal, or only slide.

For planar chains, the closed form solves for one or two joints of any kind, or three if an angle is prescribed, and for
a slide along the normal if the height is prescribed. The height of the tool is its height at zero plus the slides along
the normal. With the redundant joints held, W0 is the tool with the others at zero, and W its target in the plane:

    one joint     the row's component of E_a W0 is given:                    a cosine, or a line
    two joints    E_a E_b W0 = W:                                            `move_within_plane`
    an angle      E_a E_b E_c = D, where D turns by the rest of the angle, and moves W0 to W

With an angle, one revolute joint follows from the angle. This joint does not move a point P on its axis. Two joints
remain:

    c revolute    E_a E_b P = D P
    a revolute    E_c^-1 E_b^-1 P = D^-1 P
    b alone       two slides: a along its direction, c along that which D gives it, bring P to D P

Angles are about the normal of the plane, whatever the senses of the joints. Then det J_nr is positive for the first of
the two solutions, and negative for the second. If both joints are prismatic, there is one solution.

If all non-redundant joints are prismatic, and no angle is prescribed, the target is linear in their positions t: it is
z(q_r, 0) + D(q_r) t, where the columns of D are the directions of the joints. Redundant joints may be of any kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brachis.common import tolerances
from brachis.ik.branches import DeterminantSolver
from brachis.ik.point_recipes import move_within_plane
from brachis.ik.protocol import FormulaSolver, NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, PosedScrews, Screw, rotate
from brachis.ik.vectors import determinants, nan_where_negative, wrap
from brachis.kernel import formula
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import RowsAndAngle

_LABELS = {
    "RR": "elbow",
    "RP": "reach",
    "PR": "reach",
    "PP": "slides",
    "R": "swing",
    "P": "slide",
}
"""Names of branches, by the kinds of the joints that remain once the joint that sets the angle is known."""


class PlanarSolver(DeterminantSolver, FormulaSolver):
    """Closed form of a planar chain; see the formulas in the docstring of the module.

    Parameters
    ----------
    geometry : ChainGeometry
    task_map : TaskMap
    redundant : tuple of int
    basis : (2, 3) ndarray
        Orthonormal basis of the plane.
    lifting : list of int
        The non-redundant joint that slides along the normal; empty if there is none.
    """

    def __init__(
        self,
        geometry: ChainGeometry,
        task_map: TaskMap,
        redundant: tuple[int, ...],
        basis: np.ndarray,
        lifting: list[int],
    ) -> None:
        revolute = geometry.revolute
        self._plane = basis
        self._normal = np.cross(*basis)
        rows = np.eye(3)[list(task_map.axes)]
        self._heights = rows @ self._normal * bool(lifting)
        self._columns = np.flatnonzero(np.abs(self._heights) < 0.5)
        self._rows = rows[self._columns]
        self._senses = np.where(revolute, np.sign(geometry.axes @ self._normal), 1.0)
        # Motion of the tool along the normal per unit of each slide.
        self._lifts = np.where(revolute, 0.0, geometry.axes @ self._normal)
        self._lifting = lifting
        non_redundant = complement(geometry.n, redundant)
        self._planar = [i for i in non_redundant if i not in lifting]
        kinds = "".join("R" if revolute[i] else "P" for i in self._planar)
        self._angle = None
        if isinstance(task_map, RowsAndAngle):
            self._angle = task_map
            self._angle_sense = np.sign(self._normal[task_map.world_axis])
            kinds = "".join(kinds.rsplit("R", 1))
        # Heights above the plane are set to zero, and the contribution of the tool's height is subtracted from the
        # rows.
        self._height = self._normal @ geometry.tool_position
        self._offset = self._rows @ self._normal * self._height
        self._lift = basis.T @ np.linalg.pinv(self._rows @ basis.T)
        flatten = basis.T @ basis
        flat = replace(
            geometry,
            axes=np.where(revolute[:, None], self._normal, geometry.axes @ flatten),
            points=geometry.points @ flatten,
            tool_position=flatten @ geometry.tool_position,
        )
        super().__init__(flat, redundant, _LABELS[kinds])

    def _determinants(self, q: np.ndarray) -> np.ndarray:
        """Compute det J_nr, without the slide along the normal, from velocities in the plane and about the normal."""
        screws = self._chain.screws_at(q * self._senses)
        columns = screws.jacobian_columns(self._planar)
        directions = self._rows if len(self._planar) == 1 else self._plane
        rows = np.tensordot(directions, columns[:3], 1)
        if self._angle is not None:
            turns = np.tensordot(self._normal, columns[3:], 1)
            rows = np.concatenate([rows, turns[None]])
        return determinants(rows)

    def answers(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return the non-redundant joints, (K, 2, 1, m)."""
        known = q_r * self._senses[self._redundant]
        screws = self._chain.screws_with(self._redundant, known)
        joints = screws.pick(self._planar, 1)
        tool = screws.tool_position[:, None]
        rows = targets[:, self._columns] - self._offset
        goal = (self._lift @ rows.T)[:, None]
        if len(joints) == 1:
            row = self._rows[0][:, None, None]
            values = [joints[0].orbit(tool).component(row, rows[:, 0], 0)]
        elif self._angle is None:
            values = [*move_within_plane(joints[0], joints[1], tool, goal, 0)]
        else:
            first, second = self._angle.plane
            pointer = screws.tool_rotation[:, self._angle.tool_axis]
            heading = formula.arctan2(
                self._angle.sign * pointer[second], pointer[first]
            )
            angle = self._angle_sense * (targets[:, -1] - heading)
            values = self._solve_with_angle(joints, tool, goal, angle)
        for joint in self._lifting:
            height = targets[:, : len(self._heights)] @ self._heights - self._height
            height = height - q_r @ self._lifts[self._redundant]
            values.insert(self._joints.index(joint), height / self._lifts[joint])
        return self._arrange(np.broadcast_arrays(*values), q_r)

    def _solve_with_angle(
        self,
        joints: Sequence[Screw],
        tool: np.ndarray,
        goal: np.ndarray,
        angle: np.ndarray,
    ) -> list[np.ndarray]:
        """Solve for three joints that turn the tool by an angle, (K,), and move it to its goal; both are (3, 1, K)."""
        normal = self._normal[:, None, None]
        first, second, last = joints
        anchor = next(i for i in (2, 0, 1) if joints[i].revolute)
        start = joints[anchor].point
        end = goal + rotate(normal, angle, start - tool)
        if anchor == 0:
            first = last.inverse
            second = second.inverse
            end = tool + rotate(normal, -angle, start - goal)
        elif anchor == 1:
            second = replace(last, axis=rotate(normal, angle, last.axis))
        pair = move_within_plane(first, second, start, end, 0)
        values = list(pair if anchor else pair[::-1])
        movers = [joint for joint in joints if joint is not joints[anchor]]
        for joint, value in zip(movers, values, strict=True):
            if joint.revolute:
                angle = angle - value
        values.insert(anchor, angle)
        return values

    def _arrange(self, values: Sequence[np.ndarray], q_r: np.ndarray) -> np.ndarray:
        """Arrange m arrays of solutions, (R, K): two are in branch order; a single one has the branch of its sign."""
        answers = np.stack(values, axis=2) * self._senses[self._joints]
        revolute = self._chain.revolute[self._joints]
        answers[..., revolute] = wrap(answers[..., revolute])
        if len(answers) == 1:
            q = np.empty((len(q_r), self._chain.n), answers.dtype)
            q[:, self._redundant] = q_r
            q[:, self._joints] = answers[0]
            levels = self._determinants(q) * np.array([[1.0], [-1.0]])
            answers = nan_where_negative(levels[:, :, None], answers)
        return np.swapaxes(answers, 0, 1)[:, :, None]


def _plane_normal(geometry: ChainGeometry) -> np.ndarray:
    """Return the direction to which all revolute axes are parallel, and all slides parallel or perpendicular."""
    turning = np.flatnonzero(geometry.revolute)
    if not len(turning):
        raise NotApplicableError("no joint is revolute")
    normal = geometry.axes[turning[0]]
    for name, axis, revolute in zip(
        geometry.joint_names, geometry.axes, geometry.revolute, strict=True
    ):
        cosine = abs(axis @ normal)
        is_across = not revolute and cosine <= tolerances.ANGLE
        if cosine < 1.0 - tolerances.ANGLE and not is_across:
            raise NotApplicableError(
                f"not planar: {name} moves out of the plane in which {geometry.joint_names[turning[0]]} turns"
            )
    return normal


def _basis(normal: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return two orthonormal vectors of the plane, (2, 3); the axes of the rows if they span it."""
    if len(rows) == 2 and np.all(np.abs(rows @ normal) < tolerances.ANGLE):
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
    """Fit the family: all joints move in one plane, which the prescribed rows determine."""
    if len(task_map.angles) > 1:
        raise NotApplicableError("this family does not solve for orientations")
    normal = _plane_normal(geometry)
    rows = np.eye(3)[list(task_map.axes)]
    non_redundant = complement(geometry.n, redundant)
    slides_up = ~geometry.revolute & (
        np.abs(geometry.axes @ normal) > 1.0 - tolerances.ANGLE
    )
    is_height = slides_up.any() & (np.abs(rows @ normal) > 1.0 - tolerances.ANGLE)
    lifting = [i for i in non_redundant if slides_up[i] and is_height.any()]
    if len(lifting) != is_height.sum():
        row = task_map.rows[int(np.argmax(is_height))]
        raise NotApplicableError(
            f"{row} needs exactly one non-redundant slide along it"
        )
    rows = rows[~is_height]
    basis = _basis(normal, rows)
    normal = np.cross(*basis)
    leaves_plane = slides_up.any() and np.any(np.abs(rows @ normal) > tolerances.ANGLE)
    rank = np.linalg.matrix_rank(rows @ basis.T, tol=tolerances.ANGLE)
    if leaves_plane or rank < len(rows) or not len(rows):
        raise NotApplicableError(
            "the prescribed rows do not fit the plane in which the joints move"
        )
    if isinstance(task_map, RowsAndAngle):
        axis = np.eye(3)[task_map.world_axis]
        if np.linalg.norm(np.cross(normal, axis)) > tolerances.ANGLE:
            raise NotApplicableError(
                f"{task_map.rows[-1]} turns in a different plane than the joints"
            )
        if len(rows) != 2:
            raise NotApplicableError("an angle needs both rows of the plane")
        if not geometry.revolute[non_redundant].any():
            raise NotApplicableError("no revolute joint is left to set the angle")
    return PlanarSolver(geometry, task_map, redundant, basis, lifting)


class PrismaticSolver(DeterminantSolver, FormulaSolver):
    """Linear solver for prismatic non-redundant joints; see the formula in the docstring of the module."""

    def __init__(
        self, geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
    ) -> None:
        self._rows = list(task_map.axes)
        super().__init__(geometry, redundant, "slides")
        if np.ptp(self._random) <= tolerances.ANGLE * self._scale:
            self.branches = ("slides",)

    def _directions(self, screws: PosedScrews) -> np.ndarray:
        """Return the matrices D, (m, m, K)."""
        return screws.axes[self._rows][:, self._joints]

    def _determinants(self, q: np.ndarray) -> np.ndarray:
        return determinants(self._directions(self._chain.screws_at(q)))

    def answers(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return the non-redundant joints, (K, B, 1, m), by Cramer's rule."""
        screws = self._chain.screws_with(self._redundant, q_r)
        directions = self._directions(screws)
        gap = targets.T - screws.tool_position[self._rows]
        size = determinants(directions)
        slides = []
        for joint in range(len(gap)):
            replaced = np.array(directions, dtype=gap.dtype)
            replaced[:, joint] = gap
            slides.append(determinants(replaced) / size)
        solution = np.stack(slides, axis=1)[:, None, None]
        if len(self.branches) == 1:
            return solution
        levels = size[:, None] * np.array([1.0, -1.0])
        return nan_where_negative(levels[:, :, None, None], solution)

    def margins(self, q: np.ndarray) -> np.ndarray:
        """Return the determinant of D; no margin if D is constant."""
        return super().margins(q)[:, : len(self.branches) - 1]

    def margin_signs(self, branch: int) -> np.ndarray:
        """Return the sign of the determinant, if it is a margin."""
        return super().margin_signs(branch)[: len(self.branches) - 1]


@ik_family("prismatic", source="linear in the slides; the docstring of `planar`")
def prismatic(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PrismaticSolver:
    """Fit the family: every non-redundant joint is prismatic and no angle is prescribed."""
    if task_map.angles:
        raise NotApplicableError("prismatic joints do not change orientations")
    turning = [
        geometry.joint_names[i]
        for i in complement(geometry.n, redundant)
        if geometry.revolute[i]
    ]
    if turning:
        raise NotApplicableError(
            f"all joints except the redundant ones must be prismatic; revolute: {', '.join(turning)}"
        )
    return PrismaticSolver(geometry, task_map, redundant)
