"""Quintic Hermite pieces in Bernstein form, each relative to its first node.

Positions are of the order of 1 rad, and the second differences of the coefficients are divided by h^2. Were the node's
own position part of the coefficients, its rounding alone would be an error of 1e-16 / h^2 in the acceleration, which is
visible for motions of milliseconds.
"""

from __future__ import annotations

import numpy as np


def relative_coefficients(
    times: np.ndarray, q: np.ndarray, qdot: np.ndarray, after: np.ndarray, before: np.ndarray
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
    way = np.diff(q, axis=0)
    left = [np.zeros_like(way), slope * qdot[:-1], 2.0 * slope * qdot[:-1] + bend * after[:-1]]
    right = [way - 2.0 * slope * qdot[1:] + bend * before[1:], way - slope * qdot[1:], way]
    return np.stack([*left, *right])


def one_sided_derivatives(coefficients: np.ndarray, lengths: np.ndarray, order: int, *, at_end: bool) -> np.ndarray:
    """Differentiate every piece at one of its ends.

    Parameters
    ----------
    coefficients : (6, L, n) ndarray
        Bernstein coefficients.
    lengths : (L,) ndarray
        Of the pieces, s.
    order : int
        Of differentiation; 0 gives the value.
    at_end : bool
        At the end of the pieces, and not at their beginning.

    Returns
    -------
    (L, n) ndarray
    """
    degree = len(coefficients) - 1
    differences = np.diff(coefficients, n=order, axis=0)
    factor = np.prod(np.arange(degree, degree - order, -1)) / lengths**order
    return differences[-1 if at_end else 0] * factor[:, None]
