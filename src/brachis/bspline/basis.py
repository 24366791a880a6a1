"""Sparse B-spline basis matrices and their derivatives."""

from __future__ import annotations

import numpy as np
from scipy import sparse


def basis_matrix(knots: np.ndarray, degree: int, tau: np.ndarray, derivative: int = 0) -> sparse.csr_array:
    """Matrix B with ``B @ control_points`` the spline's derivative at the times `tau`.

    The derivative of a spline of degree d is a spline of degree d - 1 whose control points are scaled differences,
    d (c[i+1] - c[i]) / (t[i+d+1] - t[i+1]) (de Boor, A Practical Guide to Splines, chapter X).

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
        Clamped knot vector.
    degree : int
        d.
    tau : (K,) ndarray
        Times within the knots.
    derivative : int, optional
        Order of differentiation, at most d; with respect to the knots' time.

    Returns
    -------
    (K, N + d) csr_array
    """
    from scipy.interpolate import BSpline  # noqa: PLC0415  (imports in 0.3 s)

    factor = sparse.eye_array(len(knots) - degree - 1, format="csr")
    inner, d = knots, degree
    for _ in range(derivative):
        count = len(inner) - d - 2
        scale = d / (inner[d + 1 : d + 1 + count] - inner[1 : 1 + count])
        factor = sparse.diags_array([-scale, scale], offsets=[0, 1], shape=(count, count + 1), format="csr") @ factor
        inner, d = inner[1:-1], d - 1
    matrix = BSpline.design_matrix(np.clip(tau, knots[0], knots[-1]), inner, d)
    return sparse.csr_array(matrix @ factor)
