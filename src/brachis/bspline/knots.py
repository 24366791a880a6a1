"""Clamped knot vectors in normalised time."""

from __future__ import annotations

import numpy as np


def clamped_knots(degree: int, breaks: np.ndarray) -> np.ndarray:
    """Knots of a clamped spline over given intervals.

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
    return clamped_knots(degree, np.linspace(0.0, 1.0, intervals + 1))


def spread(breaks: np.ndarray, points: int | np.ndarray) -> np.ndarray:
    """Spread times evenly over every interval, with both its ends.

    Parameters
    ----------
    breaks : (N + 1,) ndarray
        Ends of the intervals, ascending.
    points : int or (N,) int ndarray
        Steps into which each interval is divided.

    Returns
    -------
    (sum of points + 1,) ndarray
    """
    steps = np.broadcast_to(points, len(breaks) - 1)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(breaks[:-1], breaks[1:], steps, strict=True)]
    return np.append(np.concatenate(parts), breaks[-1])
