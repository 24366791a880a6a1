"""B-spline basis functions as functions of the interval lengths, and their exact derivatives by these lengths.

A point lies at a fixed fraction of its interval. The d + 1 basis functions of degree d that are nonzero at the point
depend only on the lengths of the 2 d - 1 intervals around it. They are computed by the recursion of Cox and de Boor
(Piegl and Tiller, The NURBS Book, A2.2). The denominators are never less than the length of the point's own interval.
Neighbouring intervals may therefore have length zero, as they do beyond the ends of a clamped knot vector. The
recursion is rational, so lengths may be complex. A step along the imaginary axis gives derivatives without
cancellation (Squire and Trapp, 1998).

Knot insertion gives the same curves over a finer knot vector. The new control points are blossoms of the old pieces at
the new knots (see `brachis.kernel`).
"""

from __future__ import annotations

import numpy as np

from brachis.kernel import blossom

ORDERS = 4
"""Number of orders: the value and three derivatives."""


def local_basis(
    knots: np.ndarray, degree: int, t_norm: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return value and three derivatives of those basis functions that are nonzero at given times.

    Parameters
    ----------
    knots : (N + 2 d + 1,) ndarray
        Clamped knot vector, strictly ascending between the repeated end knots.
    degree : int
        d >= 2.
    t_norm : (K,) ndarray
        Times. A time outside the knots is moved to the nearest end.

    Returns
    -------
    first : (K,) int ndarray
        Index of the interval of each time. It is also the index of the first control point with an effect there.
    values : (4, K, d + 1) ndarray
        Values, and derivatives per unit of the time of the knots.
    """
    breaks = knots[degree : len(knots) - degree]
    first, fraction = locate(breaks, np.clip(t_norm, breaks[0], breaks[-1]))
    lengths = np.diff(knots)[first[:, None] + np.arange(1, 2 * degree)]
    return first, basis_functions(lengths, fraction)


def locate(breaks: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the interval in which each time, (K,), lies, and the fraction of this interval before the time."""
    interval = np.searchsorted(breaks, times, side="right") - 1
    interval = interval.clip(0, len(breaks) - 2)
    return interval, (times - breaks[interval]) / np.diff(breaks)[interval]


def basis_functions(lengths: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """Return value and three derivatives of the basis functions that are nonzero at points.

    Parameters
    ----------
    lengths : (..., 2 d - 1) ndarray, real or complex
        Lengths of the intervals around each point. The interval in the middle contains the point. d >= 2.
    fraction : (...) ndarray
        Position of the point within its own interval, 0 to 1.

    Returns
    -------
    (4, ..., d + 1) ndarray
        Values, and derivatives per unit of the lengths.
    """
    degree = (lengths.shape[-1] + 1) // 2
    middle = degree - 1
    interval = lengths[..., middle : middle + 1]
    offset = fraction[..., None] * interval
    # from_knots[m]: from the m-th knot before the point to the point; to_knots[m]: from the point to the m-th knot
    # after it.
    before = lengths[..., :middle][..., ::-1]
    behind = lengths[..., middle + 1 :]
    from_knots = np.cumsum(np.concatenate([offset, before], axis=-1), axis=-1)
    to_knots = np.cumsum(np.concatenate([interval - offset, behind], axis=-1), axis=-1)
    value = [np.ones_like(offset)]
    for p in range(1, degree + 1):
        value.append(_raise_degree(value[-1], from_knots, to_knots, p))
    orders = [value[degree]]
    for order in range(1, ORDERS):
        values = value[degree - order] if order <= degree else np.zeros_like(value[0])
        for p in range(max(degree - order, 0) + 1, degree + 1):
            values = _slope(values, from_knots, to_knots, p)
        orders.append(values)
    return np.array(orders)


def basis_derivatives(lengths: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """Differentiate `basis_functions` with respect to each of the lengths, at K points.

    Parameters
    ----------
    lengths : (K, 2 d - 1) ndarray
    fraction : (K,) ndarray

    Returns
    -------
    (4, 2 d - 1, K, d + 1) ndarray
    """
    step = 1e-30
    moved = lengths + 1j * step * np.eye(lengths.shape[-1])[:, None]
    return basis_functions(moved, fraction[None]).imag / step


def _raise_degree(
    value: np.ndarray, from_knots: np.ndarray, to_knots: np.ndarray, p: int
) -> np.ndarray:
    """Compute basis functions of degree p from those of degree p - 1."""
    before = from_knots[..., :p][..., ::-1]
    behind = to_knots[..., :p]
    share = value / (before + behind)
    return _add_neighbours(before * share, behind * share)


def _slope(
    lower: np.ndarray, from_knots: np.ndarray, to_knots: np.ndarray, p: int
) -> np.ndarray:
    """Differentiate functions of degree p, given `lower`, the same functions of degree p - 1."""
    share = p * lower / (from_knots[..., :p][..., ::-1] + to_knots[..., :p])
    return _add_neighbours(share, -share)


def _add_neighbours(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Add two sets of values. The first set is shifted by one basis function."""
    zero = np.zeros_like(first[..., :1])
    moved = np.concatenate([zero, first], axis=-1)
    return moved + np.concatenate([second, zero], axis=-1)


def clamped_knots(degree: int, breaks: np.ndarray) -> np.ndarray:
    """Return the knots of a clamped spline over given intervals.

    Parameters
    ----------
    degree : int
    breaks : (N + 1,) ndarray
        Ends of the intervals in normalised time, strictly ascending from 0 to 1.

    Returns
    -------
    (N + 2 degree + 1,) ndarray
    """
    return np.concatenate([np.zeros(degree), breaks, np.ones(degree)])


def insert_knots(
    control_points: np.ndarray, knots: np.ndarray, finer: np.ndarray, degree: int
) -> np.ndarray:
    """Return the control points of the same curves over more knots.

    Parameters
    ----------
    control_points : (c, N + d) ndarray
        Control points of c scalar splines.
    knots : (N + 2 d + 1,) ndarray
        Clamped knot vector.
    finer : (N' + 2 d + 1,) ndarray
        Clamped knot vector that contains `knots`.
    degree : int
        d.

    Returns
    -------
    (c, N' + d) ndarray
    """
    new = np.arange(len(finer) - degree - 1)
    # Far from its own interval, a polynomial would lose all digits. Use the one of the middle knot's interval.
    middle = finer[new + (degree + 1) // 2]
    interval = np.searchsorted(knots, middle, side="right") - 1
    interval = np.clip(interval, degree, len(knots) - degree - 2)
    arguments = [finer[new + level] for level in range(1, degree + 1)]
    return blossom(knots, control_points.T, interval, arguments).T
