"""Passes over the phase plane of a joint path; see `brachis.timing.phase_plane`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import as_doubles, call


def bounds_of_pairs(
    slope: np.ndarray, lower: np.ndarray, upper: np.ndarray, parallel: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the least and the largest x >= 0 at which no lower line is above an upper one.

    Parameters
    ----------
    slope, lower, upper : (P, c) ndarray
        Lines ``slope x + lower`` and ``slope x + upper``.
    parallel : float
        Difference of slopes below which lines are parallel.

    Returns
    -------
    least, most : (P,) ndarray
        The largest x is -1 where parallel lines leave nothing between them.
    """
    lines = [as_doubles(own, slope.shape) for own in (slope, lower, upper)]
    least, most = np.empty((2, len(slope)))
    call("brachis_bounds_of_pairs", *slope.shape, *lines, parallel, least, most)
    return least, most


def go_backwards(
    steps: tuple[np.ndarray, np.ndarray, np.ndarray],
    levels: tuple[np.ndarray, np.ndarray],
    last: float,
    *,
    flat: float,
    rounding: float,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Find the intervals of x from which the last station can be reached.

    Parameters
    ----------
    steps : tuple of (P - 1, c) ndarray
        Factor, least and most: the next x is ``factor x + least`` to ``factor x + most``.
    levels : tuple of (P - 1,) ndarray
        The least and the largest x at all stations but the last.
    last : float
        x at the last station.
    flat : float
        Factor below which the next x does not rise with this one: such rows are left out.
    rounding : float
        Part of x by which rounding may leave an interval empty.

    Returns
    -------
    low, high : (P,) ndarray
        None if an interval is empty.
    """
    shape = steps[0].shape
    rows = [as_doubles(own, shape) for own in steps]
    ends = [as_doubles(own, shape[:1]) for own in levels]
    low, high = np.empty((2, shape[0] + 1))
    reached = call(
        "brachis_go_backwards",
        shape[0] + 1,
        shape[1],
        *rows,
        *ends,
        last,
        flat,
        rounding,
        low,
        high,
    )
    return (low, high) if reached else None


def go_forwards(
    factor: np.ndarray,
    most: np.ndarray,
    within: tuple[np.ndarray, np.ndarray],
    first: float,
) -> np.ndarray:
    """Find the largest x, (P,), from the first station on, within intervals, (P,) each; see `go_backwards`."""
    rows = [as_doubles(own, factor.shape) for own in (factor, most)]
    count = len(factor) + 1
    ends = [as_doubles(own, (count,)) for own in within]
    x = np.empty(count)
    x[0] = first
    call("brachis_go_forwards", count, factor.shape[1], *rows, *ends, x)
    return x
