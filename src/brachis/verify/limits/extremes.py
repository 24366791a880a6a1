"""Extremes of polynomials over all pieces of a motion."""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.polynomials import turns


def largest(given: Given, above: np.ndarray, below: np.ndarray) -> Worst:
    """Find the largest value of polynomials in Bernstein form, two for every piece and joint, (m + 1, L, n) each.

    It is at an end of a piece or where a polynomial turns that has a coefficient above the values at all ends.
    """
    flat = np.concatenate([above, below], axis=1).reshape(len(above), -1)
    ends = flat[[0, -1]]
    u, column = (int(index) for index in np.unravel_index(np.argmax(ends), ends.shape))
    value, place = float(ends[u, column]), float(u)
    higher = np.flatnonzero(flat.max(axis=0) > value)
    turning, at, values = turns(flat[:, higher])
    if values.max(initial=-np.inf) > value:
        k = int(np.argmax(values))
        value, column, place = float(values[k]), int(higher[turning[k]]), float(at[k])
    _, count, n = above.shape
    piece = column // n % count
    time = float(given.pieces.times[piece] + place * given.pieces.lengths[piece])
    return Worst(value, given.robot.joint_names[column % n], time)
