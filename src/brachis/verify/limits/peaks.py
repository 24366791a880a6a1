"""The largest ratio between the places that are looked at."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.motion import States

_SAFETY = 4.0
"""A ratio bends by so many times what its neighbours show."""
_RESOLUTION = 5e-6
"""Ratios that could be exceeded by less are not searched any further."""
_ROUNDS = 40
_MOST_MORE = 100_000
"""States that are added at most; what lies between them then counts with the most that it may be."""
_SHORTEST = 1e-6
"""Steps in a piece, as parts of it, that are not halved any more."""


def worst_between(given: Given, ratio_at: Callable[[States], np.ndarray], subjects: Sequence[str]) -> Worst:
    """Find the largest of ratios that are no polynomials, at the states and wherever between them it may lie.

    Steps between states are halved for as long as the largest ratio may lie within one. Over a step of length h a ratio
    that bends by c rises above the higher end by (c h - |slope|)^2 / 4 c at most, if it peaks within the step at all.
    For c the second divided differences at both ends are taken, four times over.

    Parameters
    ----------
    given : Given
    ratio_at : callable
        ``ratio_at(states)`` returns the ratios, (K, c).
    subjects : sequence of str
        What the c ratios are of.

    Returns
    -------
    Worst
    """
    states, ratio = given.states, ratio_at(given.states)
    for _ in range(_ROUNDS):
        steps, most = _may_hold_more(states, given.pieces.lengths, ratio)
        if not len(steps):
            break
        if len(states.t) + len(steps) > len(given.states.t) + _MOST_MORE:
            k = int(np.argmax(most))
            column = int(np.argmax(ratio[steps[k]]))
            remark = f"not searched to the end: {ratio.max():.6g} was found, and more than this is not possible"
            return Worst(float(most[k]), subjects[column], float(states.t[steps[k]]), remark)
        u = states.u[steps]
        middle = u + 0.5 * (states.u[steps + 1] - u)
        new = States.at(given.pieces, given.robot, states.piece[steps], middle)
        states, order = states.merged(new)
        ratio = np.concatenate([ratio, ratio_at(new)])[order]
    k, column = (int(index) for index in np.unravel_index(np.argmax(ratio), ratio.shape))
    return Worst(float(ratio[k, column]), subjects[column], float(states.t[k]))


def _may_hold_more(states: States, lengths: np.ndarray, ratio: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List the steps within which the largest ratio of all may lie, (S,), and the most that it may be there, (S,)."""
    inside = states.piece[1:] == states.piece[:-1]
    part = np.where(inside, np.diff(states.u), 1.0)
    length = (part * lengths[states.piece[:-1]])[:, None]
    slope = np.diff(ratio, axis=0) / length
    bend = np.zeros_like(ratio)
    both = inside[1:] & inside[:-1]
    bend[1:-1] = np.where(both[:, None], np.abs(np.diff(slope, axis=0)) / (length[1:] + length[:-1]), 0.0)
    bend = _SAFETY * np.maximum(bend[1:], bend[:-1])
    climb = np.maximum(bend * length - np.abs(slope), 0.0)
    rise = climb**2 / np.maximum(4.0 * bend, np.finfo(float).tiny)
    most = (np.maximum(ratio[1:], ratio[:-1]) + rise).max(axis=1)
    steps = np.flatnonzero(inside & (part > _SHORTEST) & (most > ratio.max() + _RESOLUTION))
    return steps, most[steps]
