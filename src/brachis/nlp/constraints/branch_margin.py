"""Branch margins >= eps: keeps the motion on its branch and away from singular decompositions."""

from __future__ import annotations

import numpy as np

from brachis.ik import margin_gradient
from brachis.kinematics import Decomposition, JointState
from brachis.nlp.constraints.protocol import Partials

MARGIN = 5e-3
"""Least branch margin, dimensionless. Nearer to the boundary the non-redundant joints outrun any collocation grid.
A start posture that is nearer still may come half as near again."""


class BranchMarginConstraint:
    """Margins of the chosen branch."""

    kind = "branch_margin"
    timed = False
    physical = False

    def __init__(self, decomposition: Decomposition, at_start: np.ndarray, margin: float) -> None:
        self._solver = decomposition.solver
        self._branch = decomposition.branch
        label = decomposition.solver.branches[decomposition.branch]
        count = len(at_start)
        self.labels = tuple(f"{label} {i}" for i in range(count)) if count > 1 else (label,)
        self.lower, self.upper = np.minimum(margin, 0.5 * at_start), np.full(count, np.inf)
        self.excess_scale = np.ones(count)

    def values(self, state: JointState) -> np.ndarray:
        """See `Constraint.values`."""
        return self._solver.branch_margins(state.q, self._branch)

    def partials(self, state: JointState) -> Partials:
        """See `Constraint.partials`."""
        return Partials(q=margin_gradient(self._solver, state.q, self._branch))


def build(decomposition: Decomposition, margin: float) -> BranchMarginConstraint | None:
    """Build the constraint where the closed form has margins."""
    at_start = decomposition.solver.branch_margins(decomposition.start[None], decomposition.branch)[0]
    return BranchMarginConstraint(decomposition, at_start, margin) if len(at_start) else None
