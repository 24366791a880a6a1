"""Where joints with Coulomb friction reverse: their torque rises by twice the friction within its own width.

A width of 1e-5 rad/s is passed in microseconds, which no grid resolves. Between grid points the velocity of a joint is
taken for the cubic that its velocities and accelerations there define.
"""

from __future__ import annotations

import numpy as np

from brachis.kinematics import JointState
from brachis.robot import Friction

_LEVELS = np.array([-7.0, -4.5, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.5, 7.0])
"""Velocities, in widths of the friction, that are looked for: at 7 all but 2e-6 of it is there."""
_NEAR = 10.0
"""A velocity that turns within so many widths of zero is looked at as well."""
_BISECTIONS = 40


def reversals(friction: Friction, times: np.ndarray, state: JointState) -> np.ndarray:
    """Find the times at which joints with Coulomb friction pass through its width.

    Parameters
    ----------
    friction : Friction
    times : (K,) ndarray
        Ascending, s.
    state : JointState
        At these times.

    Returns
    -------
    (Z,) ndarray
        s, ascending.
    """
    rubbing = np.flatnonzero(friction.coulomb > 0.0)
    if not len(rubbing):
        return np.empty(0)
    speed = state.qdot[:, rubbing] / friction.v_eps[rubbing]
    h = np.diff(times)[:, None]
    gain = state.qddot[:, rubbing] / friction.v_eps[rubbing]
    cubic = np.array([speed[:-1], speed[:-1] + h * gain[:-1] / 3.0, speed[1:] - h * gain[1:] / 3.0, speed[1:]])
    step, joint = np.nonzero((cubic.min(axis=0) < _NEAR) & (cubic.max(axis=0) > -_NEAR))
    cubic = cubic[:, step, joint]
    first, last = cubic[0, :, None] - _LEVELS, cubic[-1, :, None] - _LEVELS
    which, level = np.nonzero(first * last < 0.0)
    crossing = _place(cubic[:, which] - _LEVELS[level])
    slopes = np.diff(cubic, axis=0)
    turns = np.flatnonzero((slopes[0] * slopes[-1] < 0.0) & (np.abs(cubic).min(axis=0) < _NEAR))
    which, u = np.append(which, turns), np.append(crossing, _place(slopes[:, turns]))
    return np.unique(times[step[which]] + u * h[step[which], 0])


def _place(c: np.ndarray) -> np.ndarray:
    """Place in [0, 1] at which polynomials in Bernstein form, (m + 1, F), whose ends differ in sign are zero."""
    low, high = np.zeros(c.shape[1]), np.ones(c.shape[1])
    for _ in range(_BISECTIONS if c.size else 0):
        middle = 0.5 * (low + high)
        value = c
        while len(value) > 1:  # de Casteljau
            value = value[:-1] * (1.0 - middle) + value[1:] * middle
        same = value[0] * c[0] > 0.0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.asarray(0.5 * (low + high))
