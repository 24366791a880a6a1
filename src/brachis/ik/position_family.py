"""Three joints that bring the tool to a position, whatever its orientation; all others are redundant.

With the redundant joints held, let W0 be the tool while the three joints a, b, c are at zero. They bring it to the
target W,

    E_a E_b E_c W0 = W,

by one of the `point_recipes`. Redundant joints may stand before, between and after them: these place the axes and W0,
sample by sample. Seen from the tool the equation is E_c^-1 E_b^-1 E_a^-1 W = W0, where the first becomes the last
joint, and target and tool change places; it serves where a recipe fits in this order alone.

Branches are told apart by the signs of the recipe's two factors. Sources: see `point_recipes`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.common import tolerances
from brachis.ik.arm import Arm, RemainingJoints
from brachis.ik.branches import SINGULAR, FactoredSolver, fit
from brachis.ik.point_recipes import choose_recipe
from brachis.ik.protocol import NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry, Screw
from brachis.robot import TaskMap
from brachis.robot.task_map import Pose


class PositioningSolver(FactoredSolver):
    """Closed form of three joints for the tool's position; see the module's formulas.

    Parameters
    ----------
    geometry : ChainGeometry
    redundant : tuple of int
    three : RemainingJoints
        From the base to the tool.
    rows : sequence of int
        World axes (0, 1, 2) of the target's coordinates.

    Raises
    ------
    NotApplicableError
        No recipe fits.
    """

    letters = "abc"
    point = "the tool"

    def __init__(
        self,
        geometry: ChainGeometry,
        redundant: tuple[int, ...],
        three: RemainingJoints,
        rows: Sequence[int],
    ) -> None:
        joints, self.recipe, self._meeting = choose_recipe(
            self.point, three, three.reverse()
        )
        self._order = np.argsort(rows)
        super().__init__(geometry, redundant, joints, self.recipe.factors)

    def _arm(self, screws: tuple[Screw, ...], tool: np.ndarray) -> Arm:
        return Arm(screws, tool, self._meeting.at(screws) if self._meeting else tool)

    def _steps(
        self, targets: np.ndarray, q_r: np.ndarray
    ) -> tuple[Arm, Sequence[np.ndarray]]:
        screws = self._geometry.screws_with(self._redundant, q_r)
        start = screws.tool_position[:, None, None]
        end = targets.T[self._order, None, None]
        if self._joints.mirrored:
            start, end = (end, start)
        arm = self._arm(self._joints.screws(screws, alternatives=2), start)
        return arm, self.recipe.solve(arm, end)


@ik_family(
    "positioning", source="Pieper 1968; Paden 1985; IK-Geo 2022; `point_recipes`"
)
def positioning(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PositioningSolver:
    """Fit the family: the tool's position alone is prescribed, and three joints are left over for it."""
    if isinstance(task_map, Pose) or len(task_map.axes) != 3:
        raise NotApplicableError("this family solves only the position: x, y and z")
    three = RemainingJoints.of(geometry, redundant, 3)
    columns = geometry.random_screws.jacobian_columns(three.joints)
    speeds = np.abs(columns[:3]).max(axis=(0, 2))
    for name, speed in zip(three.names, speeds, strict=True):
        if speed < tolerances.LENGTH:
            raise NotApplicableError(f"{SINGULAR}: {name} does not move the tool")
    return fit(
        geometry,
        three,
        [lambda: PositioningSolver(geometry, redundant, three, task_map.axes)],
    )
