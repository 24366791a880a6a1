"""What the check of a kind of limit takes and gives.

The largest ratio between the places that are looked at.

Extremes of polynomials over all pieces of a motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from brachis.robot import Robot
from brachis.trajectory import Trajectory
from brachis.verify.motion import Pieces, States, turns

_BISECTIONS = 60
_SAME_PLACE = 1e-9
"""Of a piece."""


@dataclass(frozen=True, eq=False)
class Given:
    """What is checked.

    Attributes
    ----------
    robot : Robot
    trajectory : Trajectory
        What is judged are its pieces; from itself are the task and s(t).
    pieces : Pieces
    states : States
        The motion wherever it is looked at.
    """

    robot: Robot
    trajectory: Trajectory
    pieces: Pieces
    states: States

    def s_at(self, t: np.ndarray) -> np.ndarray:
        """Path coordinates, (K,), at times t, (K,), s."""
        return np.asarray(self.trajectory.path_spline(t))

    def times_of(self, s: np.ndarray) -> np.ndarray:
        """Find the times, (P,), s, at which path coordinates, (P,), are reached; s(t) does not decrease."""
        low, high = np.zeros(len(s)), np.full(len(s), self.trajectory.t_end)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            before = self.s_at(middle) < s
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return 0.5 * (low + high)

    def looking_at(self, s: np.ndarray) -> Given:
        """Return the same, with the states at further path coordinates, (P,)."""
        added = States.at(self.pieces, self.robot, *self.pieces.place(self.times_of(s)))
        both = self.states.merged(added)[0]
        apart = (np.diff(both.piece) > 0) | (np.diff(both.u) > _SAME_PLACE)
        return replace(self, states=both.only(np.append(True, apart)))

    def within(self, parts: np.ndarray) -> list[Given]:
        """Return the same for each part of the path, (P, 2), with no states but those in it, its ends included."""
        more, slack = (
            self.looking_at(parts.ravel()),
            _SAME_PLACE * self.trajectory.t_end,
        )
        times = self.times_of(parts.ravel()).reshape(parts.shape)
        first = np.searchsorted(more.states.t, times[:, 0] - slack)
        last = np.searchsorted(more.states.t, times[:, 1] + slack, side="right")
        return [
            replace(more, states=more.states.only(slice(a, b)))
            for a, b in zip(first, last, strict=True)
        ]


class Worst(NamedTuple):
    """Where a limit is used most.

    Attributes
    ----------
    ratio : float
        To the limit.
    subject : str
        Of what: a joint, the tool, ...
    time : float
        s.
    remark : str
        What there is to know of the check; empty where there is nothing.
    """

    ratio: float
    subject: str
    time: float
    remark: str = ""


LimitCheck = Callable[[Given], Worst | None]
"""Finds the worst ratio to a kind of limit; None where there is no such limit."""


_SAFETY = 4.0
"""A ratio bends by so many times what its neighbours show."""
_RESOLUTION = 5e-6
"""Ratios that could be exceeded by less are not searched any further."""
_ROUNDS = 40
_MOST_MORE = 100_000
"""States that are added at most; what lies between them then counts with the most that it may be."""
_SHORTEST = 1e-6
"""Steps in a piece, as parts of it, that are not halved any more."""


def worst_between(
    given: Given, ratio_at: Callable[[States], np.ndarray], subjects: Sequence[str]
) -> Worst:
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
            return Worst(
                float(most[k]), subjects[column], float(states.t[steps[k]]), remark
            )
        u = states.u[steps]
        middle = u + 0.5 * (states.u[steps + 1] - u)
        new = States.at(given.pieces, given.robot, states.piece[steps], middle)
        states, order = states.merged(new)
        ratio = np.concatenate([ratio, ratio_at(new)])[order]
    k, column = (
        int(index) for index in np.unravel_index(np.argmax(ratio), ratio.shape)
    )
    return Worst(float(ratio[k, column]), subjects[column], float(states.t[k]))


def _may_hold_more(
    states: States, lengths: np.ndarray, ratio: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """List the steps within which the largest ratio of all may lie, (S,), and the most that it may be there, (S,)."""
    inside = states.piece[1:] == states.piece[:-1]
    part = np.where(inside, np.diff(states.u), 1.0)
    length = (part * lengths[states.piece[:-1]])[:, None]
    slope = np.diff(ratio, axis=0) / length
    bend = np.zeros_like(ratio)
    both = inside[1:] & inside[:-1]
    bend[1:-1] = np.where(
        both[:, None], np.abs(np.diff(slope, axis=0)) / (length[1:] + length[:-1]), 0.0
    )
    bend = _SAFETY * np.maximum(bend[1:], bend[:-1])
    climb = np.maximum(bend * length - np.abs(slope), 0.0)
    rise = climb**2 / np.maximum(4.0 * bend, np.finfo(float).tiny)
    most = (np.maximum(ratio[1:], ratio[:-1]) + rise).max(axis=1)
    steps = np.flatnonzero(
        inside & (part > _SHORTEST) & (most > ratio.max() + _RESOLUTION)
    )
    return steps, most[steps]


def largest(given: Given, above: np.ndarray, below: np.ndarray) -> Worst:
    """Find the largest value of polynomials in Bernstein form, two for every piece and joint, (m + 1, L, n) each.

    It is at an end of a piece or where a polynomial turns that has a coefficient above the values at all ends.
    """
    flat = np.concatenate([above, below], axis=1).reshape(len(above), -1)
    ends = flat[[0, -1]]
    u, column = (int(index) for index in np.unravel_index(np.argmax(ends), ends.shape))
    value, place = float(ends[u, column]), float(u)
    higher = np.flatnonzero(flat.max(axis=0) > value)
    turning, at, values = turns(flat[:, higher])
    if values.max(initial=-np.inf) > value:
        k = int(np.argmax(values))
        value, column, place = float(values[k]), int(higher[turning[k]]), float(at[k])
    _, count, n = above.shape
    piece = column // n % count
    time = float(given.pieces.times[piece] + place * given.pieces.lengths[piece])
    return Worst(value, given.robot.joint_names[column % n], time)
