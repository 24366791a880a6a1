"""Branch margins >= eps: keeps the motion on its branch and away from singular decompositions."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import JointMap
from brachis.limits.protocol import (
    Bound,
    Guarantee,
    JointMotion,
    Label,
    Limit,
    Partials,
    Role,
)

MARGIN = 5e-3
"""Least branch margin, dimensionless. Nearer to the boundary the non-redundant joints outrun any collocation grid.
Where the start posture is nearer, half of its own margin is the least one."""


class BranchMargin(Limit):
    """Margins of the branch that a joint map is on.

    Parameters
    ----------
    joint_map : JointMap
    at_start : (c,) ndarray
        Margins of the start posture.
    margin : float
        The least one.
    """

    kind = "branch_margin"
    role = Role.SAFEGUARD
    guarantee = Guarantee.AT_COLLOCATION_POINTS
    at_rest = "posture"

    def __init__(
        self, joint_map: JointMap, at_start: np.ndarray, margin: float
    ) -> None:
        self._joint_map = joint_map
        label, count = joint_map.branch_label, len(at_start)
        names = [f"{label} {i}" for i in range(count)] if count > 1 else [label]
        self.labels = tuple(Label(name, "branch margin", "-") for name in names)
        self.lower, self.upper = (
            np.minimum(margin, 0.5 * at_start),
            np.full(count, np.inf),
        )

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return tuple(
            Bound(c, least, least, 1.0, "lower")
            for c, least in enumerate(self.lower.tolist())
        )

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`; the motion is a state of the joint map."""
        return self._joint_map.margins(motion)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        by_q, by_s = self._joint_map.margin_gradient(motion)
        return Partials(q=by_q, s=by_s)


def build_branch_margins(
    joint_map: JointMap, margin: float = MARGIN
) -> tuple[BranchMargin, ...]:
    """Build the limit, where the joint map has margins: what keeps the motion where it can be computed."""
    at_start = joint_map.start_margins()
    return (BranchMargin(joint_map, at_start, margin),) if len(at_start) else ()
