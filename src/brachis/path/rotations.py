"""Rotations and quaternions (w, x, y, z), and exact derivatives of products, unit vectors and sines by Leibniz' rule.

SciPy's rotations are imported only where they are used, because the import takes a fifth of a second.

A function of one parameter is given by its value and derivatives, along the first axis of an array of shape (order + 1,
...). Then ``f[1:]`` are the derivatives of f', and ``(f g)[k] = sum_i binomial(k, i) f[i] g[k - i]``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.kernel import body_twists
from brachis.path.protocol import Array
from brachis.task.points.units import quaternions_of

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def _leibniz(
    multiply: Callable[[Array, Array], Array], first: Array, second: Array, k: int
) -> Any:
    """Return the k-th derivative of a product from the derivatives of both factors, by Leibniz' rule."""
    return sum(comb(k, i) * multiply(first[i], second[k - i]) for i in range(k + 1))


def product(first: Array, second: Array, how: str) -> Array:
    """Return as many derivatives of a product as are given of its factors.

    Parameters
    ----------
    first, second : ndarray, shape (order + 1, ...)
        Derivatives of the two factors.
    how : str
        Rule for the product of two values, in the notation of `numpy.einsum`, for example ``"...ij,...j->...i"``.
    """
    orders = range(min(len(first), len(second)))
    multiply = partial(np.einsum, how)
    return np.stack([_leibniz(multiply, first, second, k) for k in orders])


def unit(vector: Array) -> Array:
    """Return the derivatives of a vector divided by its length, shape (order + 1, ..., n).

    Let n be the squared length. Then ``y = n^(-1/2)`` solves ``n y' = -n' y / 2``, which gives one derivative after the
    other.
    """
    squared = product(vector, vector, "...i,...i->...")
    inverse = np.zeros_like(squared)
    inverse[0] = 1.0 / np.sqrt(squared[0])
    for k in range(len(vector) - 1):
        right_side = _leibniz(np.multiply, squared[1:], inverse, k) / -2.0
        # The known part of n y': the last derivative of y is still zero.
        known = _leibniz(np.multiply, squared, inverse[1:], k)
        inverse[k + 1] = (right_side - known) / squared[0]
    return product(vector, inverse, "...i,...->...i")


def sine_cosine(angle: Array) -> tuple[Array, Array]:
    """Return the derivatives of the sine and the cosine of an angle, shape (order + 1, ...)."""
    both = np.zeros(angle.shape, dtype=complex)  # exp(i angle)
    both[0] = np.exp(1j * angle[0])
    for k in range(len(angle) - 1):
        both[k + 1] = 1j * _leibniz(np.multiply, angle[1:], both, k)
    return both.imag, both.real


def hat(vector: Array) -> Array:
    """Return the matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    return np.cross(np.eye(3), vector[..., None, :])


def quaternion_derivatives(pose: Array) -> Array:
    """Return the derivatives of a unit quaternion, (order + 1, 4), from those of a pose's coordinates, (order + 1, c).

    Let w be the angular velocity in the turning frame. Then ``q' = q w / 2`` gives one derivative after the other.
    """
    result = np.zeros((len(pose), 4))
    result[0] = quaternions_of(rotation_of(pose[0, -9:].reshape(3, 3)))
    rate = np.pad(angular_rates(pose), ((0, 0), (1, 0)))
    for k in range(len(pose) - 1):
        result[k + 1] = _leibniz(quaternion_product, result, rate, k) / 2.0
    return result


def angular_rates(poses: Array) -> Array:
    """Return the angular velocity along the tool's axes, and its derivatives, (order, ..., 3), rad.

    The coordinates, (order + 1, ..., c), end with a rotation matrix row by row.
    """
    turning = poses[..., -9:]
    still = np.zeros((*turning.shape[:-1], 3))
    return body_twists(np.concatenate([still, turning], axis=-1))[..., 3:]


def rotation_of(matrix: Array) -> Rotation:
    """Return the rotation or rotations given by matrices (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix)


def quaternion_product(first: Array, second: Array) -> Array:
    """Return the products, (..., 4), of quaternions (w, x, y, z)."""
    w = first[..., :1]
    v = first[..., 1:]
    scalar = w * second[..., :1] - np.sum(v * second[..., 1:], axis=-1, keepdims=True)
    vector = w * second[..., 1:] + second[..., :1] * v + np.cross(v, second[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)
