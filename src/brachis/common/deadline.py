"""A moment by which work must end, passed on from stage to stage."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass


@dataclass(frozen=True)
class Deadline:
    """A moment on the monotonic clock, which all processes of a machine share. By default, it never comes.

    Attributes
    ----------
    at : float
        Time on the monotonic clock, s.
    """

    at: float = math.inf

    @classmethod
    def after(cls, seconds: float) -> Deadline:
        """Return the moment this many seconds from now."""
        return cls().within(seconds)

    @property
    def left(self) -> float:
        """Time left until the deadline, s; never negative."""
        return max(self.at - time.monotonic(), 0.0)

    @property
    def passed(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() > self.at

    def within(self, seconds: float) -> Deadline:
        """Return the earlier of this deadline and the moment this many seconds from now."""
        return Deadline(min(self.at, time.monotonic() + seconds))

    def part(self, share: float) -> Deadline:
        """Return the moment at which the given fraction of the remaining time has passed."""
        return self.within(share * self.left)

    def extend(self, seconds: float) -> Deadline:
        """Return a deadline that is this many seconds later."""
        return Deadline(self.at + seconds)


NEVER = Deadline()
