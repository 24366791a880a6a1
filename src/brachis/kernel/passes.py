"""Backward and forward passes over the phase plane of a joint path; see `brachis.timing.phase_plane`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.kernel.library import call_checked


def bounds_of_pairs(
    slope: np.ndarray, lower: np.ndarray, upper: np.ndarray, parallel: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the smallest and the largest x >= 0 at which no lower line is above an upper line.

    Parameters
    ----------
    slope, lower, upper : (P, c) ndarray
        Lines ``slope x + lower`` and ``slope x + upper``.
    parallel : float
        Difference of slopes below which lines are treated as parallel.

    Returns
    -------
    floor, ceiling : (P,) ndarray
        The smallest and the largest x. The largest x is -1 if parallel lines rule out every x.
    """
    floor, ceiling = call_checked(
        "brachis_bounds_of_pairs", slope, lower, upper, parallel
    )
    return floor, ceiling


def go_backwards(
    steps: Sequence[np.ndarray],
    levels: tuple[np.ndarray, np.ndarray],
    last: float,
    *,
    flat: float,
    rounding: float,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Find the intervals of x from which the last station can be reached.

    Parameters
    ----------
    steps : three (P - 1, c) ndarrays
        Arrays factor, lower and upper: the next x lies between ``factor x + lower`` and ``factor x + upper``.
    levels : tuple of (P - 1,) ndarray
        The smallest and the largest x at all stations except the last.
    last : float
        x at the last station.
    flat : float
        Factor below which a row is left out, because the next x does not increase with this x.
    rounding : float
        Amount, as a fraction of x, by which the lower end of an interval may exceed the upper end due to rounding.

    Returns
    -------
    low, high : (P,) ndarray
        Ends of the intervals. None is returned if an interval is empty.
    """
    count = len(steps[0]) + 1
    reached, low, high = call_checked(
        "brachis_go_backwards", *steps, *levels, last, flat, rounding, P=count
    )
    return (low, high) if reached else None


def go_forwards(
    factor: np.ndarray,
    upper: np.ndarray,
    within: tuple[np.ndarray, np.ndarray],
    first: float,
) -> np.ndarray:
    """Find the largest x at each station, (P,), in order, within given intervals, (P,); see `go_backwards`."""
    x: np.ndarray = call_checked(
        "brachis_go_forwards", factor, upper, *within, first, P=len(factor) + 1
    )
    return x
