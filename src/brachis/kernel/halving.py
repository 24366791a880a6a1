"""Halve knot intervals where a timing needs it; see `brachis.optimise.timed_splines`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import compute


def halve_intervals(
    t: np.ndarray,
    accelerations: np.ndarray,
    rate: np.ndarray,
    jumps: np.ndarray,
    ramps: np.ndarray,
    *,
    few: int,
    pieces: int,
    tolerance: float,
    shortest: float,
    most: int,
) -> np.ndarray:
    """Halve intervals of 0 to 1, those first that lose most.

    An interval loses its length times how far accelerations are from linear within it.

    Parameters
    ----------
    t : (M,) ndarray
        Times of a timing, ascending, from 0 to 1.
    accelerations : (M, n) ndarray
    rate : (M,) ndarray
        dp/dt there.
    jumps, ramps : (M - 1,) ndarray
        How much of an acceleration jumps between two times, and what a ramp in its place costs a unit of length.
    few : int
        Times within an interval that are needed to tell whether it is smooth.
    pieces : int
        Equal intervals that are halved.
    tolerance : float
        What all intervals together may lose.
    shortest : float
        Length below which they are not halved.
    most : int
        Number of intervals with which halving ends.

    Returns
    -------
    (N,) ndarray
        Where they begin, ascending.
    """
    timing = (t, accelerations, rate, jumps, ramps, few)
    sizes = {"S": len(t) - 1, "B": max(most, pieces) + 2}
    ends = (pieces, tolerance, shortest, most)
    count, begins = compute("brachis_halve", *timing, *ends, **sizes)
    return np.sort(begins[:count])
