"""Clamped knot vectors in normalised time."""

from __future__ import annotations

import numpy as np


def clamped_uniform_knots(degree: int, intervals: int) -> np.ndarray:
    """Knots of a clamped spline with equal intervals.

    Parameters
    ----------
    degree : int
    intervals : int
        N; the spline has N + degree control points.

    Returns
    -------
    (N + 2 degree + 1,) ndarray
        Normalised time, from 0 to 1.
    """
    return np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, intervals + 1), np.ones(degree)])
