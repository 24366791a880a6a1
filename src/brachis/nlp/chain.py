"""From a constraint's partials with respect to the joints to its derivatives with respect to the curves."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import JointDerivatives, JointState
from brachis.nlp.constraints import Partials


def chain(partials: Partials, state: JointState, exact: JointDerivatives) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differentiate a constraint with respect to y, ydot and yddot, each (K, c, 1 + r), from its partials."""
    given = next(part for part in (partials.q, partials.qdot, partials.qddot) if part is not None)
    zeros = np.zeros((*given.shape[:2], state.y.shape[1]))
    by_y, by_ydot, by_yddot = zeros, zeros, zeros
    if partials.q is not None:
        by_y = by_y + partials.q @ state.gradient
    if partials.qdot is not None:
        by_y = by_y + partials.qdot @ exact.qdot_y
        by_ydot = by_ydot + partials.qdot @ state.gradient
    if partials.qddot is not None:
        by_y = by_y + partials.qddot @ exact.qddot_y
        by_ydot = by_ydot + partials.qddot @ exact.qddot_ydot
        by_yddot = by_yddot + partials.qddot @ state.gradient
    return by_y, by_ydot, by_yddot
