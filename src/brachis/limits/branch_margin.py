"""Branch margins >= eps: keeps the motion on its branch and away from singular decompositions."""

from __future__ import annotations

import numpy as np

from brachis.ik import margin_gradient
from brachis.kinematics import Decomposition
from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials, Role

MARGIN = 5e-3
"""Least branch margin, dimensionless. Nearer to the boundary the non-redundant joints outrun any collocation grid.
Where the start posture is nearer, half of its own margin is the least one."""


class BranchMargin(Limit):
    """Margins of the branch that a decomposition is on.

    Parameters
    ----------
    decomposition : Decomposition
    at_start : (c,) ndarray
        Margins of the start posture.
    margin : float
        The least one.
    """

    kind = "branch_margin"
    role = Role.SAFEGUARD
    static = True

    def __init__(self, decomposition: Decomposition, at_start: np.ndarray, margin: float) -> None:
        self._solver, self._branch = decomposition.solver, decomposition.branch
        label, count = decomposition.solver.branches[decomposition.branch], len(at_start)
        names = [f"{label} {i}" for i in range(count)] if count > 1 else [label]
        self.labels = tuple(Label(name, "branch margin", "-") for name in names)
        self.lower, self.upper = np.minimum(margin, 0.5 * at_start), np.full(count, np.inf)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return tuple(Bound(c, least, least, 1.0, "lower") for c, least in enumerate(self.lower.tolist()))

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._solver.branch_margins(motion.q, self._branch)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(q=margin_gradient(self._solver, motion.q, self._branch))


def build(decomposition: Decomposition, margin: float = MARGIN) -> BranchMargin | None:
    """Build the limit where the closed form has margins."""
    at_start = decomposition.solver.branch_margins(decomposition.start[None], decomposition.branch)[0]
    return BranchMargin(decomposition, at_start, margin) if len(at_start) else None
