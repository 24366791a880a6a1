"""What the check of a kind of limit takes and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from brachis.robot import Robot
from brachis.trajectory import Trajectory
from brachis.verify.motion import Pieces, States

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
        more, slack = self.looking_at(parts.ravel()), _SAME_PLACE * self.trajectory.t_end
        times = self.times_of(parts.ravel()).reshape(parts.shape)
        first = np.searchsorted(more.states.t, times[:, 0] - slack)
        last = np.searchsorted(more.states.t, times[:, 1] + slack, side="right")
        return [replace(more, states=more.states.only(slice(a, b))) for a, b in zip(first, last, strict=True)]


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
