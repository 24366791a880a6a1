"""Weights by which values at collocation points are integrated over normalised time.

The motion is smooth within a knot interval and not across its ends, so every interval is integrated for itself: over
each step between neighbouring points the cubic through the four nearest ones. Points that lie much closer together
than the others of their interval are skipped: cubics through them would swing.
"""

from __future__ import annotations

import numpy as np

_SAME_TIME = 1e-12
_STENCIL = 4
_CLOSE = 0.5
"""Points are skipped that follow another one by less than this part of the interval's median step."""
_CONTINUOUS_ACCELERATION = 3
"""Least degree with which the values at the end of an interval belong to it as well as to the next one."""


def interval_weights(breaks: np.ndarray, t_norm: np.ndarray, degree: int) -> np.ndarray:
    """Weights for integrals over each knot interval, taken to be of length 1.

    Parameters
    ----------
    breaks : (N + 1,) ndarray
        Ends of the intervals.
    t_norm : (K,) ndarray
        Points, ascending, all breaks among them.
    degree : int
        Of the splines.

    Returns
    -------
    (N, K) ndarray
        ``diff(breaks) @ weights`` are the weights of the integral over all.
    """
    weights = np.zeros((len(breaks) - 1, len(t_norm)))
    for row, low, high in zip(weights, breaks[:-1], breaks[1:], strict=True):
        inside = np.flatnonzero((t_norm > low - _SAME_TIME) & (t_norm < high + _SAME_TIME))
        if degree < _CONTINUOUS_ACCELERATION and high < breaks[-1]:
            inside = inside[:-1]
        kept = inside[_spaced((t_norm[inside] - low) / (high - low))]
        row[kept] = _weights((t_norm[kept] - low) / (high - low))
    return weights


def _spaced(u: np.ndarray) -> np.ndarray:
    """Numbers of places u, ascending, without those that follow another one too closely; both ends are kept."""
    least = _CLOSE * float(np.median(np.diff(u))) if len(u) > 1 else 0.0
    kept = [0]
    for number in range(1, len(u) - 1):
        if u[number] - u[kept[-1]] >= least and u[-1] - u[number] >= least:
            kept.append(number)
    return np.array(kept if len(u) == 1 else [*kept, len(u) - 1])


def _weights(u: np.ndarray) -> np.ndarray:
    """Weights, (P,), of the integral over [0, 1] of the cubics through values at places u, (P,)."""
    count = min(_STENCIL, len(u))
    ends = np.concatenate([[0.0], u[1:-1], [1.0]])[: max(len(u), 2)]
    weights, powers = np.zeros(len(u)), np.arange(count)
    for step in range(len(ends) - 1):
        first = int(np.clip(step - 1, 0, len(u) - count))
        stencil, middle = slice(first, first + count), ends[step]
        moments = np.diff([(end - middle) ** (powers + 1) / (powers + 1) for end in ends[step : step + 2]], axis=0)[0]
        weights[stencil] += np.linalg.solve(np.vander(u[stencil] - middle, count, increasing=True).T, moments)
    return weights
