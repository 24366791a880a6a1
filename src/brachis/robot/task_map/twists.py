"""Velocity and acceleration of the tool frame and their derivatives, from the columns of its Jacobian.

The columns J_i are twists (v, w) at the tool frame's origin. Joints after joint i carry its axis relative to the tool,
so that in the tool frame's own axes

    dJ_i/dq_k = [J_i, J_k] for i < k, else 0,        [X, Y] = (w_X x v_Y + v_X x w_Y, w_X x w_Y).

With V = J qdot, S_k the part of it that comes from the joints before joint k, a = J qddot + Jdot qdot and s_k its part:

    Jdot qdot = sum_k [S_k, J_k] qdot_k,             s_k = sum_{i<k} (J_i qddot_i + [S_i, J_i] qdot_i)
    dV/dq_k    = [S_k, J_k]
    da/dqdot_k = 2 [S_k, J_k] + [J_k, V]
    da/dq_k    = [s_k, J_k] + [[S_k, J_k], V - S_k]

(R. M. Murray, Z. Li, S. S. Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 3). They hold in
any axes that stand still while the derivative is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.arrays import cross


@dataclass(frozen=True)
class ToolMotion:
    """Motion of the tool frame in K states, and its derivatives.

    Attributes
    ----------
    velocity, acceleration : (6, K, 1) ndarray
        V and a.
    velocity_q, acceleration_q, acceleration_qdot : (6, K, n) ndarray
        dV/dq, da/dq and da/dqdot.
    """

    velocity: np.ndarray
    acceleration: np.ndarray
    velocity_q: np.ndarray
    acceleration_q: np.ndarray
    acceleration_qdot: np.ndarray


def tool_motion(twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> ToolMotion:
    """Derive the motion of K states (K, n) from the `twists` (6, K, n) at their postures; see the module's formulas."""
    before, velocity = _sums(twists * qdot)
    velocity_q = _bracket(before, twists)
    parts, acceleration = _sums(twists * qddot + velocity_q * qdot)
    acceleration_q = _bracket(parts, twists) + _bracket(velocity_q, velocity - before)
    acceleration_qdot = 2.0 * velocity_q + _bracket(twists, velocity)
    return ToolMotion(velocity, acceleration, velocity_q, acceleration_q, acceleration_qdot)


def velocity_slopes(twists: np.ndarray, qdot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """V, (6, K, 1), and dV/dq, (6, K, n), from the `twists` (6, K, n) at K postures and speeds (K, n)."""
    before, velocity = _sums(twists * qdot)
    return velocity, _bracket(before, twists)


def tool_bias(twists: np.ndarray, qdot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """V and Jdot qdot, both (6, K), from the `twists` (6, K, n) at K postures."""
    before, velocity = _sums(twists * qdot)
    return velocity[:, :, 0], (_bracket(before, twists) * qdot).sum(axis=2)


def turned(turning: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rates (6, K, n) at which linear and angular parts (6, K, 1) change as their axes turn, at `turning` (3, K, n)."""
    return np.concatenate([cross(turning, vectors[:3]), cross(turning, vectors[3:])])


def _sums(parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add parts (6, K, n) over the joints before each one, (6, K, n), and over all, (6, K, 1)."""
    upto = np.cumsum(parts, axis=2)
    return upto - parts, upto[:, :, -1:]


def _bracket(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Lie bracket of twists (6, K, n or 1)."""
    v, w = first[:3], first[3:]
    return np.concatenate([cross(w, second[:3]) + cross(v, second[3:]), cross(w, second[3:])])
