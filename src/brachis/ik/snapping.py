"""Chains whose axes are parallel, perpendicular or meeting except for rounded figures, as in rpy="1.5708 0 0".

The ideal chain follows the given one from the base to the tool. The direction of a joint is compared with the
directions that no joint turns relative to it: those of the revolute joint before it and of the slides in between. If
the direction is parallel to one of these to within a tolerance, it becomes exactly parallel. Otherwise, if the
direction is almost perpendicular to some of these, it becomes exactly perpendicular. A revolute axis that almost meets
the previous one, or almost coincides with it, is moved onto it. If the previous axis meets its own predecessor nearby,
the axis is moved into the same point. Every rotation or shift carries the rest of the chain and the tool along, so
errors do not add up along the chain. Relations that follow from neighbours, such as three parallel axes or three axes
that meet in one point, then hold exactly.

The closed forms of the ideal chain give solutions close to the solutions for the given chain. Newton's method refines
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.ik.newton import Newton
from brachis.ik.protocol import IKSolver
from brachis.ik.screws import ChainGeometry
from brachis.ik.vectors import meeting_point
from brachis.kernel import FormulaQuantity
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import Pose

TOLERANCE = 1e-4
"""Axes that are parallel or perpendicular (rad), or meet (m), to within this tolerance are assumed to be meant so."""
_SKEW = 1e-2
"""Angle between two axes, rad, below which their meeting point is not reliable."""


@dataclass(frozen=True)
class SnappedChain:
    """A chain with exactly parallel, perpendicular and meeting axes, close to a given one.

    Attributes
    ----------
    geometry : ChainGeometry
    turned : float
        Largest angle between an axis of the given chain and its ideal direction relative to the axes before it, rad.
    shifted : float
        Largest distance between an axis of the given chain and its ideal place, m.
    """

    geometry: ChainGeometry
    turned: float
    shifted: float

    @property
    def miss(self) -> str:
        """Deviation of the given chain's axes from the ideal ones, for messages."""
        return f"{self.turned:.1e} rad and {self.shifted:.1e} m"


def snap_axes(
    geometry: ChainGeometry, task_map: TaskMap, tolerance: float = TOLERANCE
) -> SnappedChain | None:
    """Make axes exactly parallel, perpendicular or meeting where they almost are.

    Parameters
    ----------
    geometry : ChainGeometry
    task_map : TaskMap
        For positions, the axes of the world and a tool on the last axis of rotation are taken into account as well.
    tolerance : float, optional
        Tolerance, rad for directions and m for points.

    Returns
    -------
    SnappedChain or None
        None if the chain is already ideal.
    """
    pose = isinstance(task_map, Pose)
    chain = _Chain([] if pose else list(np.eye(3)), tolerance)
    axes = np.empty_like(geometry.axes)
    points = np.zeros_like(geometry.points)
    for i, revolute in enumerate(geometry.revolute):
        axes[i] = chain.snap_direction(
            geometry.axes[i], geometry.points[i], revolute=revolute
        )
        if revolute:
            points[i] = chain.snap_point(axes[i], geometry.points[i])
    if not pose:
        chain.snap_tool(geometry.tool_position)
    if max(chain.turned, chain.shifted) < tolerances.ROUNDING:
        return None
    snapped = replace(
        geometry,
        axes=axes,
        points=points,
        tool_position=chain.carry(geometry.tool_position),
        tool_rotation=chain.rotation @ geometry.tool_rotation,
    )
    return SnappedChain(snapped, chain.turned, chain.shifted)


class _Chain:
    """The ideal chain up to some joint, and the motion that it applies to the rest of the given chain.

    Parameters
    ----------
    fixed : list of (3,) ndarray
        Directions in the world to which the first joints are compared.
    tolerance : float
    """

    def __init__(self, fixed: list[np.ndarray], tolerance: float) -> None:
        self.rotation = np.eye(3)
        self.offset = np.zeros(3)
        self.turned = 0.0
        self.shifted = 0.0
        self._tolerance = tolerance
        self._fixed = fixed
        self._axis: np.ndarray | None = None
        self._point = np.zeros(3)
        self._meets = False

    def carry(self, point: np.ndarray) -> np.ndarray:
        """Apply the motion to a point of the given chain."""
        return self.rotation @ point + self.offset

    def snap_direction(
        self, axis: np.ndarray, point: np.ndarray, *, revolute: bool
    ) -> np.ndarray:
        """Return the next joint's ideal direction; turn the rest of the chain about the closest point on its axis."""
        direction = self.rotation @ axis
        ideal = _nearest_ideal(direction, self._fixed, self._tolerance)
        pivot = (
            self._nearest(direction, self.carry(point))[1] if revolute else self._point
        )
        turn = _least_rotation(direction, ideal)
        self.turned = max(self.turned, float(np.linalg.norm(ideal - direction)))
        self.rotation = turn @ self.rotation
        self.offset = turn @ (self.offset - pivot) + pivot
        self._fixed = [ideal] if revolute else [*self._fixed, ideal]
        return ideal

    def snap_point(self, axis: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return a point on the next revolute axis; move the rest of the chain to where the axis should be."""
        before, here = self._nearest(axis, self.carry(point))
        meets = False
        if self._axis is not None and np.linalg.norm(here - before) < self._tolerance:
            parallel = abs(self._axis @ axis) > 1.0 - tolerances.ROUNDING
            if self._meets and np.linalg.norm(self._point - before) < self._tolerance:
                before = self._point
            if parallel or np.linalg.norm(np.cross(self._axis, axis)) > _SKEW:
                self._shift(before - here)
                here = before
                meets = self._meets or not parallel
        self._axis = axis
        self._point = here
        self._meets = meets
        return here

    def snap_tool(self, position: np.ndarray) -> None:
        """Move the tool onto the last axis of rotation if it is close to it."""
        if self._axis is not None:
            gap = self.carry(position) - self._point
            gap -= self._axis * (self._axis @ gap)
            if np.linalg.norm(gap) < self._tolerance:
                self._shift(-gap)

    def _shift(self, step: np.ndarray) -> None:
        self.shifted = max(self.shifted, float(np.linalg.norm(step)))
        self.offset = self.offset + step

    def _nearest(
        self, axis: np.ndarray, point: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the points where the last axis and another one are closest; if parallel, beside the last point."""
        if self._axis is None:
            return point, point
        before = self._point
        if np.linalg.norm(np.cross(self._axis, axis)) > _SKEW:
            before = meeting_point(self._axis, before, axis, point)
        return before, point + axis * (axis @ (before - point))


def _nearest_ideal(
    axis: np.ndarray, fixed: Sequence[np.ndarray], tolerance: float
) -> np.ndarray:
    """Make a direction exactly parallel, or exactly perpendicular, to fixed directions if it almost is."""
    for fixed_axis in fixed:
        if np.linalg.norm(np.cross(axis, fixed_axis)) < tolerance:
            return fixed_axis * np.sign(axis @ fixed_axis)
    across = [fixed_axis for fixed_axis in fixed if abs(axis @ fixed_axis) < tolerance]
    if not across:
        return axis
    ideal = axis - across[0] * (axis @ across[0])
    for fixed_axis in across[1:]:
        normal = np.cross(across[0], fixed_axis)
        if np.linalg.norm(normal) > _SKEW:
            ideal = normal * np.sign(axis @ normal)
            break
    return ideal / np.linalg.norm(ideal)


def _least_rotation(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the shortest rotation, (3, 3), that turns a direction into another one close to it."""
    skew = np.cross(np.eye(3), np.cross(start, end))
    return np.eye(3) + skew + skew @ skew / (1.0 + start @ end)


class PolishedSolver(IKSolver):
    """Closed form of an ideal chain, refined for the given chain by Newton's method.

    A solution of the ideal chain is used if the method leads from it to a nearby solution of the given chain. The
    branches have the labels and margins of the ideal chain. Where these margins are smaller than about the square root
    of the given chain's deviation, solutions may be missing.

    Parameters
    ----------
    solver : IKSolver
        Closed form of the ideal chain.
    geometry : ChainGeometry
        The given chain.
    task_map : TaskMap
    redundant : tuple of int

    Attributes
    ----------
    ideal : IKSolver
        The closed form of the ideal chain.
    """

    def __init__(
        self,
        solver: IKSolver,
        geometry: ChainGeometry,
        task_map: TaskMap,
        redundant: tuple[int, ...],
    ) -> None:
        self.branches = solver.branches
        self.alternatives = solver.alternatives
        self.ideal = solver
        self._newton = Newton(task_map, geometry)
        self._redundant = list(redundant)
        self._rest = complement(geometry.n, redundant)

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Polish the solutions of the ideal chain."""
        return self._polish(self.ideal.solve(targets, q_r), targets, q_r)

    def solve_branch(
        self, targets: np.ndarray, q_r: np.ndarray, branch: int
    ) -> np.ndarray:
        """Polish the solutions of one branch."""
        answers = self.ideal.solve_branch(targets, q_r, branch)
        return self._polish(answers, targets, q_r)

    def _polish(
        self, answers: np.ndarray, targets: np.ndarray, q_r: np.ndarray
    ) -> np.ndarray:
        """Polish solutions, (K, ..., m)."""
        exists = np.isfinite(answers).all(axis=-1)
        sample = np.nonzero(exists)[0]
        q = np.empty((len(sample), len(self._redundant) + len(self._rest)))
        q[:, self._redundant] = q_r[sample]
        q[:, self._rest] = answers[exists]
        exact = np.full_like(answers, np.nan)
        polished = self._newton.polish(targets[sample], q, self._redundant)
        exact[exists] = polished[:, self._rest]
        return exact

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Return the margins of the ideal chain."""
        return self.ideal.branch_margins(q, branch)

    def margin_formulas(self, branch: int, n: int) -> FormulaQuantity | None:
        """Return the formulas of the ideal chain's margins."""
        return self.ideal.margin_formulas(branch, n)

    def margin_gradient(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Return the slopes of the margins of the ideal chain."""
        return self.ideal.margin_gradient(q, branch)
