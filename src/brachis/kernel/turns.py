"""Turns of angles by 2 pi along a motion, and which of several answers goes on with it."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import address, as_doubles, load, where_written


def follow_turns(angles: np.ndarray, turning: np.ndarray, start: np.ndarray) -> None:
    """Put angles at successive times into the turns nearest to the ones before.

    Parameters
    ----------
    angles : (K, m) ndarray
        Is written to. If a number is not finite, it stays as it is.
    turning : (m,) ndarray
        1 for columns that are angles; else 0.
    start : (m,) ndarray
        The first row gets the turns nearest to these.
    """
    count, columns = angles.shape
    kept = as_doubles(turning, (columns,)), as_doubles(start, (columns,))
    place = where_written(angles, (count, columns))
    load().brachis_follow_turns(count, columns, *map(address, kept), place)


def set_turns(
    q: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray],
    t: np.ndarray,
    start: np.ndarray,
    turning: np.ndarray,
    ranged: np.ndarray,
) -> bool:
    """Put joints into the turns to which their velocities and accelerations lead; return whether that was possible.

    Parameters
    ----------
    q : (K, n) ndarray
        Is written to; if the turns are not certain, it is of no use afterwards.
    motion : tuple of (K, n) ndarray
        Velocities and accelerations.
    t : (K,) ndarray
        Times, ascending.
    start : (n,) ndarray
        The first row gets the turns nearest to this posture.
    turning : (n,) ndarray
        1 for joints whose turns are counted; else 0.
    ranged : (n,) ndarray
        1 for joints with a finite range: their turns must be certain.
    """
    count, n = q.shape
    kept = [as_doubles(own, (n,)) for own in (turning, ranged, start)]
    kept.append(as_doubles(t, (count,)))
    kept.extend(as_doubles(own, (count, n)) for own in motion)
    place = where_written(q, (count, n))
    return bool(load().brachis_set_turns(count, n, *map(address, kept), place))


def pick_nearest(
    answers: np.ndarray, turning: np.ndarray, near: np.ndarray, *, follows: bool
) -> np.ndarray:
    """Take the nearest of several answers, modulo turns, at each of K successive times, (K, m).

    Parameters
    ----------
    answers : (K, A, m) ndarray
        A answers, of which at least one; those that do not exist are not finite. If none exists, the first is taken.
    turning : (m,) ndarray
        1 for columns that are angles; else 0.
    near : (K, m) ndarray
        The answers nearest to these are taken; with `follows` (1, m).
    follows : bool
        Whether the answer nearest to the one before is taken, at first the one nearest to `near`.
    """
    count, alternatives, columns = answers.shape
    if not alternatives:
        raise ValueError("no answers to choose from")
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
