"""Derivatives of rotation matrices and body twists along a path; see `brachis.path.rotations`."""

from __future__ import annotations

import math

import numpy as np

from brachis.kernel.library import call_checked

_MOST = 8
"""Maximum number of derivatives for which the library has room, including the value itself."""


def rotation_derivatives(quaternions: np.ndarray) -> np.ndarray:
    """Return derivatives of rotation matrices, (m, ..., 3, 3), from those of quaternions w, x, y, z, (m, ..., 4).

    The quaternions may have any length.
    """
    orders, *places, _ = quaternions.shape
    _check(orders)
    flat = quaternions.reshape(orders, math.prod(places), 4)
    rotations: np.ndarray = call_checked("brachis_rotations", flat)
    return rotations.reshape(orders, *places, 3, 3)


def body_twists(poses: np.ndarray) -> np.ndarray:
    """Compute body twists and their derivatives from poses.

    Parameters
    ----------
    poses : (m, ..., 12) ndarray
        Value and derivatives of the position and the rotation matrix, row by row.

    Returns
    -------
    (m - 1, ..., 6) ndarray
        The body twist and its derivatives: linear, then angular velocity, along the axes of the rotating frame.
    """
    orders, *places, width = poses.shape
    _check(orders)
    flat = poses.reshape(orders, math.prod(places), width)
    twists: np.ndarray = call_checked("brachis_body_twists", flat, w=12, r=orders - 1)
    return twists.reshape(orders - 1, *places, 6)


def _check(orders: int) -> None:
    """Raise an error if the library has no room for so many derivatives, including the value itself."""
    if not 1 <= orders <= _MOST:
        raise ValueError(f"{orders} derivatives; allowed: 1 to {_MOST}")
