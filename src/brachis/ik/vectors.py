"""Vectors with their three components along the FIRST axis, and the subproblems of closed forms.

Arrays have the shape (3, ...); the other axes broadcast (samples, then branches). The functions are analytic for
complex numbers: they use no conjugates and no absolute values.

The subproblems are those of B. Paden, Kinematics and control of robot manipulators, PhD thesis, Berkeley 1985, and A.
J. Elias, J. T. Wen, "IK-Geo: unified robot inverse kinematics using subproblem decomposition", 2022.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from brachis.common.arrays import cross
from brachis.kernel import formula


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar product, shape (...)."""
    return np.einsum("i...,i...->...", a, b)


def across(axis: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return the component of a vector perpendicular to a unit axis, shape (3, ...)."""
    return vector - axis * dot(axis, vector)


def apply(rotation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Apply rotation matrices (3, 3, ...) to vectors (3, ...)."""
    return np.einsum("ij...,j...->i...", rotation, vector)


def apply_inverse(rotation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Apply the inverses of rotation matrices (3, 3, ...) to vectors (3, ...)."""
    return np.einsum("ji...,j...->i...", rotation, vector)


def angle_about(axis: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the angle in [-pi, pi], (...), that turns `start` towards `end` about a unit axis.

    Components along the axis are subtracted first: the remainder may be small, and only its direction matters.
    """
    start = across(axis, start)
    end = across(axis, end)
    return formula.arctan2(dot(axis, cross(start, end)), dot(start, end))


def cosine_roots(a: np.ndarray, b: np.ndarray, c: np.ndarray, slot: int) -> np.ndarray:
    """Return the angles in [-2 pi, 2 pi] at which ``a cos + b sin = c``.

    The two angles follow each other along the axis `slot`: the derivative of the left side, ``b cos - a sin``, is
    positive at the first one and negative at the second. Both are NaN if c is out of reach.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        half = formula.arccos(c / formula.sqrt(a * a + b * b))
    middle = formula.arctan2(b, a)
    return np.concatenate([middle - half, middle + half], axis=slot)


def meeting_point(
    axis: np.ndarray, point: np.ndarray, second_axis: np.ndarray, through: np.ndarray
) -> np.ndarray:
    """Return the position on the line through `point` along `axis` that is closest to a second line, (3, ...)."""
    normal = cross(axis, second_axis)
    return point + axis * (
        dot(cross(through - point, second_axis), normal) / dot(normal, normal)
    )


def wrap(angle: np.ndarray) -> np.ndarray:
    """Return the same angles in (-pi, pi]."""
    return angle - 2.0 * np.pi * formula.ceil((angle - np.pi) / (2.0 * np.pi))


def sign(value: np.ndarray) -> np.ndarray:
    """Return the sign of numbers that are not zero."""
    return value / formula.sqrt(value * value)


def nan_where_negative(level: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the values, or NaN where the level is negative."""
    root = formula.sqrt(level)
    return values + (root - root)


def determinants(matrices: np.ndarray) -> np.ndarray:
    """Compute determinants (K,) of matrices (m, m, K); real or complex, and analytic.

    Laplace's expansion is used because it needs no division; each minor is computed only once.
    """
    minors = {0: np.ones_like(matrices[0, 0])}
    for row in matrices:
        larger: dict[int, Any] = {}
        for columns, minor in minors.items():
            for j, entry in enumerate(row):
                if columns >> j & 1:
                    continue
                term = entry * minor
                is_odd = (columns >> j).bit_count() % 2
                selected = columns | 1 << j
                signed = -term if is_odd else term
                larger[selected] = larger.get(selected, 0.0) + signed
        minors = larger
    return minors[2 ** len(matrices) - 1]
