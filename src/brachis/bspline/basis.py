"""B-spline basis functions and their derivatives, as windows or sparse matrices.

At any time only d + 1 basis functions of degree d differ from zero: a window. The derivative of a spline of degree d
is a spline of degree d - 1 whose control points are scaled differences, d (c[i+1] - c[i]) / (t[i+d+1] - t[i+1])
(de Boor, A Practical Guide to Splines, chapter X); read backwards, this turns windows of degree d - 1 into windows of
derivatives of degree d.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy import sparse


def basis_windows(
    knots: np.ndarray, degree: int, tau: np.ndarray, derivative: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Basis functions, or one of their derivatives, at the times `tau`.

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
        Clamped knot vector.
    degree : int
        d.
    tau : (K,) ndarray
        Times; beyond the knots they are taken back to the nearest end.
    derivative : int, optional
        Order of differentiation, at most d; with respect to the knots' time.

    Returns
    -------
    first : (K,) int ndarray
        Control point to which the window's first entry belongs.
    values : (K, d + 1) ndarray
    """
    from scipy.interpolate import BSpline  # noqa: PLC0415  (imports in 0.3 s)

    inner = knots[derivative : len(knots) - derivative]
    low = degree - derivative
    matrix = BSpline.design_matrix(np.clip(tau, knots[0], knots[-1]), inner, low)
    first = matrix.indices.reshape(len(tau), low + 1)[:, 0].astype(int)
    values = matrix.data.reshape(len(tau), low + 1)
    for d in range(low + 1, degree + 1):
        trim = degree - d
        outer = knots[trim : len(knots) - trim]
        scale = d / (outer[d + 1 : -1] - outer[1 : -d - 1])
        scaled = values * scale[first[:, None] + np.arange(d)]
        values = np.zeros((len(tau), d + 1))
        values[:, 1:] += scaled
        values[:, :-1] -= scaled
    return first, values


def basis_matrix(knots: np.ndarray, degree: int, tau: np.ndarray, derivative: int = 0) -> sparse.csr_array:
    """Matrix B with ``B @ control_points`` the spline's derivative at the times `tau`.

    Parameters are those of `basis_windows`.

    Returns
    -------
    (K, N + d) csr_array
    """
    from scipy import sparse  # noqa: PLC0415

    first, values = basis_windows(knots, degree, tau, derivative)
    columns = first[:, None] + np.arange(degree + 1)
    rows = np.repeat(np.arange(len(tau)), degree + 1)
    shape = (len(tau), len(knots) - degree - 1)
    return sparse.csr_array((values.ravel(), (rows, columns.ravel())), shape=shape)
