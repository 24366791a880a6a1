"""Smoothing splines through positions that have few digits, or are measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

_DEGREE, _FEWEST, _MORE, _ROWS = 5, 4, 1.2, 2.0
"""The first number of intervals, the factor to the next one, and the fewest rows in each."""
_NEAR, _EXPLAINED = 1.05, 2.0
"""Standard deviations that a spline is to be off, where noise alone is off by one; and may be."""
_AT_END, _ROWS_AT_END = 220.0, 8
"""Standard deviations that a joint has moved by where an end is over, and the fewest rows of one."""
_SMALL, _SURE = {1: 0.05, 2: 0.2}, 5.0
"""What velocity and acceleration at an end at rest are, of the largest ones; and the standard deviations of one that is
known."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A spline near rows of positions.

    Attributes
    ----------
    derivatives : (4, K, n) ndarray
        Positions and three derivatives at the rows.
    off : float
        Root mean square of what it is off, of the worst joint, in standard deviations of the rows.
    """

    derivatives: np.ndarray
    off: float

    @property
    def explains(self) -> bool:
        """Whether it is as near to the rows as they are exact."""
        return self.off <= _EXPLAINED


def smoothed(t: np.ndarray, q: np.ndarray, deviation: np.ndarray) -> Smoothed:
    """Return a least-squares spline of the fewest intervals that explain the rows.

    Of its ends it takes the calmest ones that the rows allow: in motion, at rest, at rest without acceleration. Those
    are splines whose first control points are one.

    Parameters
    ----------
    t : (K,) ndarray
        s.
    q : (K, n) ndarray
        rad or m.
    deviation : (n,) ndarray
        Standard deviation of every joint's rows, rad or m.
    """
    count = float(_FEWEST)
    found = _fitted(t, q, deviation, int(count), (0, 0))
    while found.off > _NEAR and _MORE * count <= len(t) / _ROWS:
        count *= _MORE
        found = _fitted(t, q, deviation, int(count), (0, 0))
    largest = np.abs(found.derivatives).max(axis=1)
    beginning = _vanishing(t - t[0], q, deviation, largest)
    return _fitted(t, q, deviation, int(count), (beginning, _vanishing(t[-1] - t[::-1], q[::-1], deviation, largest)))


def _vanishing(t: np.ndarray, q: np.ndarray, deviation: np.ndarray, largest: np.ndarray) -> int:
    """Tell how many derivatives vanish at an end, from which t is counted, by polynomials through the rows near it."""
    away = (np.abs(q - q[0]) > _AT_END * deviation).any(axis=1)
    rows = slice(0, max(_ROWS_AT_END, int(np.argmax(away)) if away.any() else len(t)) + 1)
    u, span = t[rows] / t[rows][-1], float(t[rows][-1])
    for order in (2, 1):
        powers = u[:, None] ** np.array([0, order, order + 1, order + 2])
        covariance = np.linalg.inv(powers.T @ powers)
        factor = order / span**order  # 1! and 2!
        found = factor * np.abs(covariance[1] @ powers.T @ q[rows])
        known = _SURE * factor * np.sqrt(covariance[1, 1]) * deviation
        if (found <= np.maximum(_SMALL[order] * largest[order], known)).all():
            return order
    return 0


def _fitted(t: np.ndarray, q: np.ndarray, deviation: np.ndarray, count: int, ends: tuple[int, int]) -> Smoothed:
    """Fit a spline of so many intervals, at whose ends so many derivatives vanish."""
    from scipy.interpolate import BSpline  # noqa: PLC0415  (imports in 0.3 s)
    from scipy.sparse.linalg import spsolve  # noqa: PLC0415

    breaks = np.interp(np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, len(t)), t)
    knots = np.concatenate([np.full(_DEGREE, t[0]), breaks, np.full(_DEGREE, t[-1])])
    tied = _tied(len(knots) - _DEGREE - 1, ends)
    rows = BSpline.design_matrix(t, knots, _DEGREE) @ tied
    spline = BSpline(knots, tied @ spsolve(rows.T @ rows, rows.T @ q).reshape(-1, q.shape[1]), _DEGREE)
    found = np.stack([spline(t, nu=order) for order in range(4)])
    return Smoothed(found, float(np.sqrt(np.mean(((found[0] - q) / deviation) ** 2, axis=0)).max()))


def _tied(count: int, ends: tuple[int, int]) -> Any:  # noqa: ANN401  (SciPy's sparse arrays)
    """Return the matrix, (count, free), from free control points to all; at an end the first ones are one."""
    from scipy.sparse import csr_array  # noqa: PLC0415

    columns = np.clip(np.arange(count) - ends[0], 0, count - 1 - sum(ends))
    return csr_array((np.ones(count), (np.arange(count), columns)), shape=(count, int(columns[-1]) + 1))
