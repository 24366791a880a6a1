"""Halving of knot intervals where a timing needs shorter ones; see `brachis.optimise.timed_splines`."""

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
    """Halve intervals between 0 and 1, starting with those that cost the most time.

    The cost of an interval is its length times the deviation of the accelerations from a straight line within it.

    Parameters
    ----------
    t : (M,) ndarray
        Times of a timing, ascending, from 0 to 1.
    accelerations : (M, n) ndarray
    rate : (M,) ndarray
        dp/dt at these times.
    jumps, ramps : (M - 1,) ndarray
        Size of the jump of the accelerations between two times, and the cost per unit of length of a ramp that replaces
        the jump.
    least_times : int
        Minimum number of times in an interval that are needed to tell whether the accelerations are smooth there.
    begin_count : int
        Number of equal intervals before halving.
    tolerance : float
        Time that all intervals together may cost.
    shortest : float
        Length below which intervals are not halved.
    max_count : int
        Number of intervals at which halving stops.

    Returns
    -------
    (N,) ndarray
        Start of each interval, ascending.
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
