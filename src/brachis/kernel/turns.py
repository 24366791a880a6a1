"""Turns of angles by 2 pi along a motion."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import address, as_doubles, load


def follow_turns(angles: np.ndarray, turning: np.ndarray, start: np.ndarray) -> None:
    """Put angles at successive times into the turns nearest to the ones before.

    Parameters
    ----------
    angles : (K, m) ndarray
        Contiguous; is written to. If a number is not finite, nothing is done.
    turning : (m,) ndarray
        Columns that are angles, 1; else 0.
    start : (m,) ndarray
        To which the first ones are nearest.
    """
    count, columns = angles.shape
    kept = as_doubles(turning, (columns,)), as_doubles(start, (columns,))
    load().brachis_follow_turns(count, columns, *map(address, kept), address(angles))


def count_turns(
    q: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray],
    t: np.ndarray,
    start: np.ndarray,
    turning: np.ndarray,
    ranged: np.ndarray,
) -> bool:
    """Put joints into the turns to which their velocities and accelerations lead; tell whether that is possible.

    Parameters
    ----------
    q : (K, n) ndarray
        Contiguous; is written to.
    motion : tuple of (K, n) ndarray
        Velocities and accelerations.
    t : (K,) ndarray
        Times, ascending.
    start : (n,) ndarray
        To which the first posture is nearest.
    turning, ranged : (n,) ndarray
        Joints whose turns are counted, 1; those of them that must be told with certainty, 1.
    """
    count, n = q.shape
    kept = [as_doubles(own, (n,)) for own in (turning, ranged, start)]
    kept.append(as_doubles(t, (count,)))
    kept.extend(as_doubles(own, (count, n)) for own in motion)
    return bool(load().brachis_count_turns(count, n, *map(address, kept), address(q)))
