"""Halving of knot intervals where a timing needs it; see `brachis.optimise.timed_splines`."""

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
    """Halve intervals between 0 and 1, beginning with those that cost the most time.

    An interval costs its length times the deviation of the accelerations from a straight line within it.

    Parameters
    ----------
    t : (M,) ndarray
        Times of a timing, ascending, from 0 to 1.
    accelerations : (M, n) ndarray
    rate : (M,) ndarray
        dp/dt at these times.
    jumps, ramps : (M - 1,) ndarray
        Size of the jump of the accelerations between two times, and the cost of a ramp in its place per unit of length.
    least_times : int
        Minimum number of times within an interval that are needed to tell whether it is smooth.
    begin_count : int
        Number of equal intervals at the beginning.
    tolerance : float
        Time that all intervals together may cost.
    shortest : float
        Length below which intervals are not halved.
    max_count : int
        Number of intervals at which halving ends.

    Returns
    -------
    (N,) ndarray
        Beginnings of the intervals, ascending.
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
