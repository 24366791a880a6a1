"""From a limit's partials with respect to the joints to its derivatives with respect to curves and end time."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import JointState
from brachis.limits import Partials


def chain(partials: Partials, state: JointState) -> tuple[np.ndarray, ...]:
    """Differentiate a limit with respect to y, ydot, yddot and, where it asks for the jerk, ydddot, (K, c, 1 + r) each.

    See `joint_map` for the derivatives of the jerk.
    """
    exact = state.derivatives
    given = (partials.q, partials.qdot, partials.qddot, partials.qdddot)
    shape = next(part.shape[:2] for part in given if part is not None)
    by_y = by_ydot = by_yddot = np.zeros((*shape, state.y.shape[1]))
    if partials.q is not None:
        by_y = by_y + partials.q @ state.gradient
    if partials.s is not None:
        by_y = by_y.copy()
        by_y[:, :, 0] += partials.s
    if partials.qdot is not None:
        by_y = by_y + partials.qdot @ exact.qdot_y
        by_ydot = by_ydot + partials.qdot @ state.gradient
    if partials.qddot is not None:
        by_y = by_y + partials.qddot @ exact.qddot_y
        by_ydot = by_ydot + partials.qddot @ exact.qddot_ydot
        by_yddot = by_yddot + partials.qddot @ state.gradient
    if partials.qdddot is None:
        return by_y, by_ydot, by_yddot
    by_y = by_y + partials.qdddot @ state.qdddot_y
    by_ydot = by_ydot + 3.0 * partials.qdddot @ exact.qddot_y
    by_yddot = by_yddot + 3.0 * partials.qdddot @ exact.qdot_y
    return by_y, by_ydot, by_yddot, partials.qdddot @ state.gradient
