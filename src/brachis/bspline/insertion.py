"""Knot insertion: the same curves over a finer knot vector.

A control point of a spline is the blossom (polar form) of any polynomial piece that it belongs to, at the d knots
behind its first: c_i = b(t_{i+1}, ..., t_{i+d}). For a finer knot vector the blossom of the old piece is evaluated at
the new knots by de Boor's recursion with another argument in every step (the Oslo algorithm of Cohen, Lyche and
Riesenfeld, 1980).
"""

from __future__ import annotations

import numpy as np


def insert_knots(control_points: np.ndarray, knots: np.ndarray, finer: np.ndarray, degree: int) -> np.ndarray:
    """Control points of the same curves over more knots.

    Parameters
    ----------
    control_points : (c, N + d) ndarray
        Of c scalar splines.
    knots : (N + 2 d + 1,) ndarray
        Clamped knot vector.
    finer : (N' + 2 d + 1,) ndarray
        Clamped knot vector that contains `knots`.
    degree : int
        d.

    Returns
    -------
    (c, N' + d) ndarray
    """
    new = np.arange(len(finer) - degree - 1)
    piece = np.searchsorted(knots, finer[new], side="right") - 1
    window = piece[:, None] + np.arange(-degree, 1)
    points = control_points[:, window]
    for level in range(1, degree + 1):
        at = finer[new + level][:, None]
        left = knots[window[:, level:]]
        right = knots[window[:, level:] + degree - level + 1]
        share = (at - left) / (right - left)
        points = share * points[..., 1:] + (1.0 - share) * points[..., :-1]
    return np.asarray(points[..., 0])
