"""Three joints that bring the tool to a position, whatever its orientation; all others are redundant.

With the redundant joints held, let W0 be the tool while the three joints a, b, c are at zero. They bring it to the
target W,

    E_a E_b E_c W0 = W,

by one of the recipes of `placing`. Redundant joints may stand before, between and after them: these place the axes
and W0, sample by sample. Seen from the tool the equation is E_c^-1 E_b^-1 E_a^-1 W = W0, where the first becomes the
last joint, and target and tool change places; it serves where a recipe fits in this order alone.

Branches are told apart by the signs of the recipe's two factors (`position_recipes`); see `factors`.

Sources: see `placing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.errors import write_count
from brachis.ik.arm import Arm, RemainingJoints, random_postures
from brachis.ik.factored_solver import (
    FactoredSolver,
    PlacingStructure,
    fitted,
    recipe_for,
)
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, PosedScrews, Screw
from brachis.robot import TaskMap
from brachis.robot.task_map import Pose

_POINT = "the tool"
_JOINTS = 3
_VANISHES = 1e-9


@dataclass(frozen=True)
class ToolStructure(PlacingStructure):
    """Three joints and the recipe by which they place the tool."""

    @classmethod
    def of(cls, three: RemainingJoints) -> ToolStructure:
        """Find the recipe, from the base to the tool or the other way round.

        Raises
        ------
        NotApplicableError
            None fits.
        """
        reasons = []
        for order in (three, three.reversed()):
            try:
                return cls(order, *recipe_for(order, _POINT))
            except NotApplicableError as reason:
                reasons.append(reason)
        raise reasons[0]

    def words(self) -> dict[str, str]:
        """See `Structure.words`."""
        return {**dict(zip("abc", self.joints.names, strict=True)), "point": _POINT}

    def posed(self, posed: PosedScrews) -> Arm:
        """See `Structure.posed`."""
        return self.arm(self.joints.screws(posed), posed.tool_position)

    def arm(self, screws: tuple[Screw, ...], centre: np.ndarray) -> Arm:
        """Put in the points."""
        return Arm(screws, centre, self.meeting.at(screws) if self.meeting else centre)


class PositioningSolver(FactoredSolver[ToolStructure]):
    """Closed form of three joints for the tool's position; see the module's formulas.

    Parameters
    ----------
    geometry : ChainGeometry
    redundant : tuple of int
    structure : ToolStructure
    rows : sequence of int
        World axes (0, 1, 2) of the target's coordinates.
    """

    def __init__(
        self,
        geometry: ChainGeometry,
        redundant: tuple[int, ...],
        structure: ToolStructure,
        rows: Sequence[int],
    ) -> None:
        super().__init__(geometry, redundant, structure)
        self._order = np.argsort(rows)

    def steps(
        self, targets: np.ndarray, q_r: np.ndarray
    ) -> tuple[Arm, Sequence[np.ndarray]]:
        """See `FactoredSolver.steps`."""
        structure = self._structure
        posed = self._geometry.held(self._redundant, q_r)
        tool = posed.tool_position[:, None, None]
        target = targets.T[self._order, None, None]
        start, end = (target, tool) if structure.joints.mirrored else (tool, target)
        arm = structure.arm(structure.joints.screws(posed, alternatives=2), start)
        return arm, structure.recipe.solve(arm, end)


@ik_family("positioning", source="Pieper 1968; Paden 1985; IK-Geo 2022; `placing`")
def positioning(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PositioningSolver:
    """Fit the family: the tool's position alone is prescribed, and three joints are left over for it."""
    if isinstance(task_map, Pose) or len(task_map.axes) != _JOINTS:
        raise NotApplicableError("only for the position: x, y and z")
    if geometry.n - len(redundant) != _JOINTS:
        raise NotApplicableError(
            f"{write_count(geometry.n - len(redundant), 'joint')} would be left over, not three"
        )
    three = RemainingJoints.beside(geometry, redundant)
    _refuse_idle(geometry, three)
    structure = fitted(geometry, three, (ToolStructure.of,))
    return PositioningSolver(geometry, redundant, structure, task_map.axes)


def _refuse_idle(geometry: ChainGeometry, three: RemainingJoints) -> None:
    """Refuse a joint that never moves the tool: the last one, often, if the tool is on its axis."""
    speeds = np.abs(
        random_postures(geometry).jacobian_columns(three.joints)[:_JOINTS]
    ).max(axis=(0, 2))
    for name, speed in zip(three.names, speeds, strict=True):
        if speed < _VANISHES:
            raise NotApplicableError(
                f"J_nr is singular everywhere: {name} does not move the tool"
            )
