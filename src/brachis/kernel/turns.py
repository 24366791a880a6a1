"""Turns of angles by 2 pi along a motion, and which of several answers goes on with it."""

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


def pick_nearest(
    answers: np.ndarray, turning: np.ndarray, near: np.ndarray, *, follows: bool
) -> np.ndarray:
    """Take one of several answers at each of K successive times, (K, m), the nearest one modulo turns.

    Parameters
    ----------
    answers : (K, A, m) ndarray
        Not finite where there is none; without any the first is taken.
    turning : (m,) ndarray
        Columns that are angles, 1; else 0.
    near : (K, m) ndarray
        To which they are nearest; one row is enough where each follows its predecessor.
    follows : bool
        Whether each is the nearest to its predecessor, and the first one to the first row of `near`.
    """
    count, alternatives, columns = answers.shape
    given = (
        as_doubles(turning, (columns,)),
        as_doubles(near, (1 if follows else count, columns)),
    )
    table = as_doubles(answers, answers.shape)
    found = np.empty((count, columns))
    load().brachis_pick_nearest(
        count,
        alternatives,
        columns,
        *map(address, given),
        follows,
        address(table),
        address(found),
    )
    return found
