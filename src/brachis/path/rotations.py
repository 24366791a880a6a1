"""Rotation matrices, unit quaternions (w, x, y, z) and rotation vectors, and their derivatives along a path."""

from __future__ import annotations

from math import comb
from typing import TYPE_CHECKING

import numpy as np

from brachis.path.leibniz import product
from brachis.task import Quaternion, RotationVector

if TYPE_CHECKING:
    from brachis.path.protocol import Array
    from brachis.task import Attitude


# Of the three axes, the matrices of the cross product: row i of that of axis k is axis i x axis k.
_OF_AXES = np.cross(np.eye(3)[None, :], np.eye(3)[:, None])


def hat(vector: Array) -> Array:
    """Return the matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    return np.tensordot(vector, _OF_AXES, axes=1)


def multiply(one: Array, other: Array) -> Array:
    """Return the product of quaternions, shape (..., 4)."""
    w, v = one[..., :1], one[..., 1:]
    other_w, other_v = other[..., :1], other[..., 1:]
    scalar = w * other_w - np.sum(v * other_v, axis=-1, keepdims=True)
    return np.concatenate([scalar, w * other_v + other_w * v + np.cross(v, other_v)], axis=-1)


def conjugate(quaternion: Array) -> Array:
    """Return the inverse of a unit quaternion."""
    return quaternion * np.array([1.0, -1.0, -1.0, -1.0])


def matrices(quaternions: Array) -> Array:
    """Return the derivatives of rotation matrices, (order + 1, ..., 3, 3), from quaternions, (order + 1, ..., 4)."""
    products = product(quaternions, quaternions, "...i,...j->...ij")
    of_vector = products[..., 1:, 1:]
    diagonal = products[..., 0, 0] - np.trace(of_vector, axis1=-2, axis2=-1)
    return 2.0 * (of_vector + hat(products[..., 0, 1:])) + diagonal[..., None, None] * np.eye(3)


def with_like_signs(quaternions: Array) -> Array:
    """Return quaternions, shape (n, 4), with signs chosen so that neighbours are close; the first keeps its own."""
    neighbours = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    signs = np.cumprod(np.where(neighbours < 0.0, -1.0, 1.0))
    return np.concatenate([quaternions[:1], signs[:, None] * quaternions[1:]])


def matrix(quaternion: Array) -> Array:
    """Return the rotation matrix of a unit quaternion."""
    return matrices(quaternion[None])[0]


def quaternion_of(rotation: Array) -> Array:
    """Return the unit quaternion, one of both, of a rotation matrix.

    ``4 q q^T`` is linear in the matrix; its column with the largest diagonal entry is q times a number that is safe to
    divide by.
    """
    r = rotation
    trace = np.trace(r)
    scalar = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    products = np.empty((4, 4))
    products[0, 0] = 1.0 + trace
    products[0, 1:] = products[1:, 0] = scalar
    products[1:, 1:] = r + r.T + (1.0 - trace) * np.eye(3)
    column = products[np.argmax(np.diag(products))]
    return column / np.linalg.norm(column)


def quaternion_derivatives(rotation: Array) -> Array:
    """Return the derivatives of a unit quaternion, (order + 1, 4), from those of a rotation matrix, (order + 1, 3, 3).

    With the angular velocity w in the turning frame, ``q' = q w / 2``, one derivative after the other.
    """
    result = np.zeros((len(rotation), 4))
    result[0] = quaternion_of(rotation[0])
    rate = np.pad(angular_velocity(rotation), ((0, 0), (1, 0)))
    for k in range(len(rotation) - 1):
        result[k + 1] = sum(comb(k, i) * multiply(result[i], rate[k - i]) for i in range(k + 1)) / 2.0
    return result


def angular_velocity(rotation: Array) -> Array:
    """Return the angular velocity in the turning frame and its derivatives, (order, ..., 3).

    Parameters
    ----------
    rotation : ndarray, shape (order + 1, ..., 3, 3)
        Derivatives of the rotation matrix R; the angular velocity is that of ``R^T R'``.
    """
    skew = product(np.swapaxes(rotation, -1, -2), rotation[1:], "...ij,...jk->...ik")
    upper = np.stack([skew[..., 1, 2], skew[..., 2, 0], skew[..., 0, 1]], axis=-1)
    lower = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    return (lower - upper) / 2.0


def rotation_vector(quaternion: Array) -> Array:
    """Return the rotation vector, of at most pi rad, of a unit quaternion."""
    size = float(np.linalg.norm(quaternion[1:]))
    angle = 2.0 * np.arctan2(size, abs(quaternion[0]))
    sign = -1.0 if quaternion[0] < 0.0 else 1.0
    return quaternion[1:] * (sign * angle / size if size > 0.0 else 0.0)


def quaternion_about(vector: Array) -> Array:
    """Return the unit quaternion of a rotation vector, rad."""
    angle = float(np.linalg.norm(vector))
    # sin(a / 2) / a, also where a vanishes.
    return np.concatenate([[np.cos(angle / 2)], np.sinc(angle / (2 * np.pi)) / 2 * vector])


def quaternion_from(attitude: Attitude) -> Array:
    """Return the unit quaternion of an orientation as a task gives it."""
    if isinstance(attitude, Quaternion):
        given = np.array(attitude.quaternion)
        return given / np.linalg.norm(given)
    if isinstance(attitude, RotationVector):
        return quaternion_about(np.array(attitude.rotation_vector))
    x, y, z = (
        quaternion_about(np.deg2rad(angle) * axis) for angle, axis in zip(attitude.rpy_deg, np.eye(3), strict=True)
    )
    return multiply(multiply(z, y), x)
