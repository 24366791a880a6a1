"""Halve knot intervals where a timing needs it; see `brachis.optimise.timed_splines`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import call_checked


def halve_intervals(
    t: np.ndarray,
    accelerations: np.ndarray,
    rate: np.ndarray,
    jumps: np.ndarray,
    ramps: np.ndarray,
    *,
    least_times: int,
    begin_count: int,
    tolerance: float,
    shortest: float,
    max_count: int,
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
    least_times : int
        Times within an interval that are needed to tell whether it is smooth.
    begin_count : int
        Equal intervals that are halved.
    tolerance : float
        What all intervals together may lose.
    shortest : float
        Length below which they are not halved.
    max_count : int
        Number of intervals with which halving ends.

    Returns
    -------
    (N,) ndarray
        Where they begin, ascending.
    """
    count, begins = call_checked(
        "brachis_halve",
        t,
        accelerations,
        rate,
        jumps,
        ramps,
        least_times,
        begin_count,
        tolerance,
        shortest,
        max_count,
        S=len(t) - 1,
        B=max(max_count, begin_count) + 2,
    )
    return np.sort(begins[:count])
