"""Derivatives of the tool's motion, and rotation vectors; see `brachis.robot.task_map`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import call_checked


def tool_derivatives(
    twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray, *, in_tool_axes: bool
) -> np.ndarray:
    """Differentiate the tool's velocity V = J qdot and its acceleration a = J qddot + Jdot qdot.

    Parameters
    ----------
    twists : (6, K, n) ndarray
        Columns of the Jacobian; see `Chain.tool`.
    qdot, qddot : (K, n) ndarray
    in_tool_axes : bool
        Whether the twists are given along the tool's axes. If they are given along the world's axes, a is the
        acceleration of the tool's origin.

    Returns
    -------
    (3, 6, K, n) ndarray
        dV/dq, da/dq and da/dqdot.
    """
    derivatives: np.ndarray = call_checked(
        "brachis_tool_derivatives", twists, qdot, qddot, in_tool_axes
    )
    return derivatives


def rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Return the rotation vectors, (K, 3), rad, of rotation matrices, (K, 3, 3)."""
    vectors: np.ndarray = call_checked("brachis_logarithms", rotations)
    return vectors
