"""Derivatives of rotation matrices and body twists along a path; see `brachis.path.rotations`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import as_doubles, call

_MOST = 8
"""Derivatives that the library has room for, with the value itself."""


def rotation_derivatives(quaternions: np.ndarray) -> np.ndarray:
    """Differentiate the rotation matrices, (m, ..., 3, 3), of quaternions w, x, y, z of any length, (m, ..., 4)."""
    orders, *places, _ = quaternions.shape
    _check(orders)
    kept = as_doubles(quaternions, (orders, *places, 4))
    found = np.empty((orders, *places, 3, 3))
    count = kept[0].size // 4
    call("brachis_rotations", orders, count, kept, found)
    return found


def body_twists(poses: np.ndarray) -> np.ndarray:
    """Differentiate poses.

    Parameters
    ----------
    poses : (m, ..., 12) ndarray
        Derivatives, from the value on, of the position and the rotation matrix row by row.

    Returns
    -------
    (m - 1, ..., 6) ndarray
        The body twist and its derivatives: linear, then angular velocity, along the axes of the turning frame.
    """
    orders, *places, _ = poses.shape
    _check(orders)
    kept = as_doubles(poses, (orders, *places, 12))
    found = np.empty((orders - 1, *places, 6))
    count = kept[0].size // 12
    call("brachis_body_twists", orders, count, kept, found)
    return found


def _check(orders: int) -> None:
    """Refuse more derivatives, with the value itself, than the library has room for."""
    if not 1 <= orders <= _MOST:
        raise ValueError(f"{orders} derivatives; allowed: 1 to {_MOST}")
