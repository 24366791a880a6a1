"""Lower bounds on branch margins, which keep the motion on its branch and away from singular decompositions."""

from __future__ import annotations

import numpy as np

from brachis.common.labels import Label
from brachis.kernel import Chain, FormulaQuantity
from brachis.kinematics import JointMap
from brachis.limits.protocol import Guarantee, JointStates, Limit, Partials, Role

MARGIN = 5e-3
"""Minimum branch margin, dimensionless. Closer to the boundary, non-redundant joints move too fast for any collocation
grid."""
HELD_BACK = 1e-4
"""A branch margin that is closer than this to its bound is considered to hold the motion back."""


class BranchMargin(Limit):
    """Limit that keeps a motion clear of the branch boundaries of a joint map.

    Parameters
    ----------
    joint_map : JointMap
    at_start : (c,) ndarray
        Branch margins of the start posture. If half of such a margin is smaller than `margin`, this half is the
        minimum.
    margin : float
        Minimum margin, dimensionless.
    """

    kind = "branch_margin"
    role = Role.SAFEGUARD
    guarantee = Guarantee.AT_COLLOCATION_POINTS
    at_rest = "posture"

    def __init__(
        self, joint_map: JointMap, at_start: np.ndarray, margin: float
    ) -> None:
        self._joint_map = joint_map
        label = joint_map.branch_label
        count = len(at_start)
        names = [f"{label} {i}" for i in range(count)] if count > 1 else [label]
        self.labels = tuple(Label(name, "branch margin", "-") for name in names)
        self.lower = np.minimum(margin, 0.5 * at_start)
        self.upper = np.full(count, np.inf)

    def values(self, motion: JointStates) -> np.ndarray:
        """Compute the margins, (K, c), of a motion that is a state of the joint map."""
        return self._joint_map.margins(motion)

    def kernel_quantity(self, _chain: Chain) -> FormulaQuantity | None:
        """Describe the margins for the kernel."""
        return self._joint_map.margin_quantity()

    def partials(self, motion: JointStates) -> Partials:
        by_q, by_s = self._joint_map.margin_gradient(motion)
        return Partials(q=by_q, s=by_s)


def build_branch_margins(
    joint_map: JointMap, margin: float = MARGIN
) -> tuple[BranchMargin, ...]:
    """Build the limit on the branch margins of a joint map; return () if the map has no margins."""
    at_start = joint_map.start_margins()
    return (BranchMargin(joint_map, at_start, margin),) if len(at_start) else ()
