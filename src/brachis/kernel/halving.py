"""Halve knot intervals where a timing needs it; see `brachis.optimise.timed_splines`."""

from __future__ import annotations

import ctypes

import numpy as np

from brachis.kernel.library import address, as_doubles, call, declare_fields


class _Timing(ctypes.Structure):
    """`timing` of halving.c."""

    _fields_ = declare_fields(
        "l times joints; p t accelerations rate jumps ramps; l few"
    )


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
    count, joints = accelerations.shape
    kept = [
        as_doubles(t, (count,)),
        as_doubles(accelerations, (count, joints)),
        as_doubles(rate, (count,)),
        as_doubles(jumps, (count - 1,)),
        as_doubles(ramps, (count - 1,)),
    ]
    own = _Timing(count, joints, *map(address, kept), few)
    room = max(most, pieces) + 2
    heap = np.empty((room, 3))
    begins = np.empty(room)
    place = ctypes.addressof(own)
    found = call(
        "brachis_halve", place, pieces, tolerance, shortest, most, heap, begins
    )
    return np.sort(begins[:found])
