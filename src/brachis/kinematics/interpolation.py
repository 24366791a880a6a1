"""A joint motion as nodes between which quintic polynomials meet the closed form to rounding.

A saved trajectory must be evaluated without the closed form (its family may be a plug-in, and the verification must
not depend on it). Joint positions, velocities and accelerations at the nodes define quintic Hermite pieces, which join
with continuous acceleration. Nodes are added until the pieces agree with the closed form in between.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brachis.kinematics.decomposition import Decomposition, JointState

Curves = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]

_PIECES_PER_INTERVAL = 4
_POSITION_TOLERANCE = 1e-11
_ACCELERATION_TOLERANCE = 1e-6
_ROUNDS = 8


@dataclass(frozen=True)
class Nodes:
    """Joint motion at L + 1 times.

    Attributes
    ----------
    times : (L + 1,) ndarray
        s, ascending from 0 to t_end.
    q, qdot, qddot : (L + 1, n) ndarray
    position_error : float
        Largest difference found between the quintic pieces and the closed form, rad or m.
    """

    times: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    position_error: float


def interpolate(decomposition: Decomposition, curves: Curves, breaks: np.ndarray) -> Nodes:
    """Place nodes so densely that quintic pieces stand for the closed form.

    Parameters
    ----------
    decomposition : Decomposition
    curves : callable
        ``curves(t)`` returns y, ydot, yddot, each (K, 1 + r), at times (K,) in seconds.
    breaks : (N + 1,) ndarray
        Times between which the curves are polynomials, s.

    Returns
    -------
    Nodes

    Raises
    ------
    UnreachableError
        The motion leaves the branch between the breaks.
    """
    steps = np.arange(_PIECES_PER_INTERVAL) / _PIECES_PER_INTERVAL
    times = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel(), breaks[-1])
    error = np.inf
    for _ in range(_ROUNDS):
        middle = 0.5 * (times[1:] + times[:-1])
        order = np.argsort(merged := np.concatenate([times, middle]))
        state = decomposition.state(*curves(merged[order]))
        nodes, between = _pick(state, slice(None, None, 2)), _pick(state, slice(1, None, 2))
        gap_q, gap_qddot = _middle_gaps(times, nodes, between)
        error = float(gap_q.max())
        bad = (gap_q > _POSITION_TOLERANCE) | (gap_qddot > _ACCELERATION_TOLERANCE * (1.0 + np.abs(nodes[2]).max()))
        if not bad.any():
            break
        times = np.union1d(times, middle[bad])
    # The middles are known exactly as well; as nodes they make the error 64 times smaller still.
    return Nodes(merged[order], state.q, state.qdot, state.qddot, error)


def _pick(state: JointState, part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return state.q[part], state.qdot[part], state.qddot[part]


def _middle_gaps(
    times: np.ndarray,
    nodes: tuple[np.ndarray, np.ndarray, np.ndarray],
    between: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Largest differences of position and acceleration in the middle of every piece, (L,) each.

    In the middle of a quintic Hermite piece of length h:
    q = (q0 + q1)/2 + 5h/32 (v0 - v1) + h^2/64 (a0 + a1),  qddot = 3 (v1 - v0) / (2h) - (a0 + a1)/4.
    """
    h = np.diff(times)[:, None]
    q, v, a = nodes
    position = 0.5 * (q[1:] + q[:-1]) - 5.0 * h / 32.0 * np.diff(v, axis=0) + h**2 / 64.0 * (a[1:] + a[:-1])
    acceleration = 1.5 * np.diff(v, axis=0) / h - 0.25 * (a[1:] + a[:-1])
    return np.abs(position - between[0]).max(axis=1), np.abs(acceleration - between[2]).max(axis=1)
