"""From a limit's partials with respect to the joints to its derivatives with respect to curves and end time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.kinematics import JointDerivatives, JointState
from brachis.limits import Partials


def chain(partials: Partials, state: JointState, exact: JointDerivatives) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differentiate a limit with respect to y, ydot and yddot, each (K, c, 1 + r), from its partials."""
    given = next(part for part in (partials.q, partials.qdot, partials.qddot) if part is not None)
    zeros = np.zeros((*given.shape[:2], state.y.shape[1]))
    by_y, by_ydot, by_yddot = zeros, zeros, zeros
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
    return by_y, by_ydot, by_yddot


def by_time(by: Sequence[np.ndarray], state: JointState) -> np.ndarray:
    """Add up what `chain` found to -t_E d/dt_E of the limit, (K, c): a longer time slows the curves down."""
    of_rates = np.einsum("kcj,kj->kc", by[1], state.ydot)
    return np.asarray(of_rates + 2.0 * np.einsum("kcj,kj->kc", by[2], state.yddot))


def timed(orders: np.ndarray, t_end: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value and two derivatives per second, from those per unit of normalised time."""
    return orders[0], orders[1] / t_end, orders[2] / t_end**2
