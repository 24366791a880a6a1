"""Quintic Hermite pieces in Bernstein form, each relative to its first node, and their jerk.

Positions are of the order of 1 rad, and the second differences of the coefficients are divided by h^2. Were the node's
own position part of the coefficients, its rounding alone would be an error of 1e-16 / h^2 in the acceleration, which is
visible for motions of milliseconds.

With x = 2 u - 1, from -1 to 1 over a piece of length h, the jerk is j(x) = m + a x + b (3 x^2 - 1) / 2 with

    m = (qddot1 - qddot0) / h
    a = 3 (qddot0 + qddot1) / h - 6 (qdot1 - qdot0) / h^2
    b = 60 miss / h^3,   miss = q1 - q0 - h / 2 (qdot0 + qdot1) + h^2 / 12 (qddot1 - qddot0)

Positions enter b alone. They are numbers of 64 bits: a piece's travel q1 - q0 is known to eps |q| and no better, which
over 0.1 ms is a jerk of 0.02 rad/s^3, over 1 us one of 20,000. A piece therefore travels what has the least |b| within
this rounding: what the positions do not say is not read into them, and all that they do say counts. This is the
definition of the motion, for all who evaluate it, the verification included.
"""

from __future__ import annotations

import numpy as np

_ROUNDING = float(np.finfo(float).eps)
"""Of a number that is the difference of two, as a part of the larger one."""


def travel_without_bend(
    times: np.ndarray, qdot: np.ndarray, after: np.ndarray, before: np.ndarray
) -> np.ndarray:
    """Travel of every piece, (L, n), if its jerk were linear in time; parameters as `relative_coefficients`."""
    h = np.diff(times)[:, None]
    return np.asarray(
        0.5 * h * (qdot[:-1] + qdot[1:]) - h**2 / 12.0 * (before[1:] - after[:-1])
    )


def _misses(
    times: np.ndarray,
    q: np.ndarray,
    qdot: np.ndarray,
    after: np.ndarray,
    before: np.ndarray,
) -> np.ndarray:
    """Return the part of every piece's travel, (L, n), that bends its jerk: what remains beyond rounding."""
    miss = np.diff(q, axis=0) - travel_without_bend(times, qdot, after, before)
    far, fast = (np.maximum(np.abs(part[1:]), np.abs(part[:-1])) for part in (q, qdot))
    rounding = _ROUNDING * (far + np.diff(times)[:, None] * fast)
    return np.asarray(miss - np.clip(miss, -rounding, rounding))


def relative_coefficients(
    times: np.ndarray,
    q: np.ndarray,
    qdot: np.ndarray,
    after: np.ndarray,
    before: np.ndarray,
) -> np.ndarray:
    """Bernstein coefficients of ``q(t) - q[i]`` on every piece i between nodes i and i + 1.

    A Bezier curve of degree 5 and length h begins with q = c0, qdot = 5 (c1 - c0) / h and
    qddot = 20 (c2 - 2 c1 + c0) / h^2, and ends likewise.

    Parameters
    ----------
    times : (L + 1,) ndarray
        Nodes, s.
    q, qdot : (L + 1, n) ndarray
        Motion at the nodes.
    after, before : (L + 1, n) ndarray
        Acceleration just after and just before the nodes.

    Returns
    -------
    (6, L, n) ndarray
    """
    h = np.diff(times)[:, None]
    slope, bend = h / 5.0, h**2 / 20.0
    way = travel_without_bend(times, qdot, after, before) + _misses(
        times, q, qdot, after, before
    )
    left = [
        np.zeros_like(way),
        slope * qdot[:-1],
        2.0 * slope * qdot[:-1] + bend * after[:-1],
    ]
    right = [
        way - 2.0 * slope * qdot[1:] + bend * before[1:],
        way - slope * qdot[1:],
        way,
    ]
    return np.stack([*left, *right])


def jerk_coefficients(
    times: np.ndarray,
    q: np.ndarray,
    qdot: np.ndarray,
    after: np.ndarray,
    before: np.ndarray,
) -> np.ndarray:
    """Bernstein coefficients of the jerk of every piece, (3, L, n); parameters as `relative_coefficients`.

    From the nodes themselves: third differences of the coefficients of the positions would multiply their rounding.
    """
    h = np.diff(times)[:, None]
    mean = (before[1:] - after[:-1]) / h
    slope = 3.0 * (after[:-1] + before[1:]) / h - 6.0 * np.diff(qdot, axis=0) / h**2
    bend = 60.0 * _misses(times, q, qdot, after, before) / h**3
    return np.stack([mean - slope + bend, mean - 2.0 * bend, mean + slope + bend])
