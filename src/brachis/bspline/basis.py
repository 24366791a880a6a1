"""B-spline basis functions as functions of the interval lengths, and their exact derivatives by these.

A point lies at a fixed fraction of its interval. The d + 1 basis functions of degree d that differ from zero there
depend on the lengths of the 2 d - 1 intervals around it alone, by the recursion of Cox and de Boor (Piegl and Tiller,
The NURBS Book, A2.2). Its denominators are never less than the point's own interval, so that neighbours may have length
zero: beyond the ends of a clamped knot vector they do. The recursion is rational and takes complex lengths; a step
along the imaginary axis gives derivatives without cancellation (Squire and Trapp, 1998).
"""

from __future__ import annotations

import numpy as np

ORDERS = 4
"""Value and three derivatives."""
_STEP = 1e-30


def local_basis(knots: np.ndarray, degree: int, t_norm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value and three derivatives of the basis functions that differ from zero at given times.

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
        Clamped knot vector, strictly ascending within.
    degree : int
        d >= 2.
    t_norm : (K,) ndarray
        Times; beyond the knots they are taken back to the nearest end.

    Returns
    -------
    first : (K,) int ndarray
        Interval of each time, which is the control point of the first of its basis functions.
    values : (4, K, d + 1) ndarray
        Per unit of the knots' time.
    """
    breaks = knots[degree : len(knots) - degree]
    t_norm = np.clip(t_norm, breaks[0], breaks[-1])
    first = np.clip(np.searchsorted(breaks, t_norm, side="right") - 1, 0, len(breaks) - 2)
    lengths = np.diff(knots)[first[:, None] + np.arange(1, 2 * degree)]
    return first, basis_functions(lengths, (t_norm - breaks[first]) / lengths[:, degree - 1])


def basis_matrix(knots: np.ndarray, degree: int, t_norm: np.ndarray) -> np.ndarray:
    """Matrix B, (K, N + d), with ``B @ control_points`` the spline at given times; parameters as of `local_basis`."""
    first, values = local_basis(knots, degree, t_norm)
    matrix = np.zeros((len(first), len(knots) - degree - 1))
    np.put_along_axis(matrix, first[:, None] + np.arange(degree + 1), values[0], axis=1)
    return matrix


def basis_functions(lengths: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """Value and three derivatives of the basis functions that differ from zero at points.

    Parameters
    ----------
    lengths : (..., 2 d - 1) ndarray, real or complex
        Of the intervals around each point; its own is the middle one. d >= 2.
    fraction : (...) ndarray
        Place within the point's own interval, 0 to 1.

    Returns
    -------
    (4, ..., d + 1) ndarray
        Per unit of what the lengths are measured in.
    """
    degree = (lengths.shape[-1] + 1) // 2
    middle = degree - 1
    own = lengths[..., middle : middle + 1]
    part = fraction[..., None] * own
    # left[m]: from the m-th knot before the point to the point; right[m]: from it to the m-th knot behind.
    left = np.cumsum(np.concatenate([part, lengths[..., :middle][..., ::-1]], axis=-1), axis=-1)
    right = np.cumsum(np.concatenate([own - part, lengths[..., middle + 1 :]], axis=-1), axis=-1)
    value = [np.ones_like(part)]
    for p in range(1, degree + 1):
        value.append(_raised(value[-1], left, right, p))
    orders = [value[degree]]
    for order in range(1, ORDERS):
        part = value[degree - order] if order <= degree else np.zeros_like(value[0])
        for p in range(max(degree - order, 0) + 1, degree + 1):
            part = _slope(part, left, right, p)
        orders.append(part)
    return np.array(orders)


def basis_derivatives(lengths: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """Differentiate `basis_functions` by each of the lengths, at K points.

    Parameters
    ----------
    lengths : (K, 2 d - 1) ndarray
    fraction : (K,) ndarray

    Returns
    -------
    (4, 2 d - 1, K, d + 1) ndarray
    """
    steps = 1j * _STEP * np.eye(lengths.shape[-1])
    return np.asarray(basis_functions(lengths + steps[:, None], fraction[None]).imag / _STEP)


def _raised(value: np.ndarray, left: np.ndarray, right: np.ndarray, p: int) -> np.ndarray:
    """Basis functions of degree p from those of degree p - 1."""
    before, behind = left[..., :p][..., ::-1], right[..., :p]
    share = value / (before + behind)
    return _shifted(before * share) + _padded(behind * share)


def _slope(lower: np.ndarray, left: np.ndarray, right: np.ndarray, p: int) -> np.ndarray:
    """Differentiate functions of degree p, given `lower`, the same functions of degree p - 1."""
    share = p * lower / (left[..., :p][..., ::-1] + right[..., :p])
    return _shifted(share) - _padded(share)


def _padded(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values, np.zeros_like(values[..., :1])], axis=-1)


def _shifted(values: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros_like(values[..., :1]), values], axis=-1)
