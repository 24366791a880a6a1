"""A moment by which work must end, passed on from stage to stage."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass


@dataclass(frozen=True)
class Deadline:
    """A moment on the monotonic clock, which all processes of a machine share; by default never.

    Attributes
    ----------
    at : float
        s.
    """

    at: float = math.inf

    @classmethod
    def after(cls, seconds: float) -> Deadline:
        """Return the moment this many seconds from now."""
        return cls().within(seconds)

    @property
    def left(self) -> float:
        """Time that is left, s; not negative."""
        return max(self.at - time.monotonic(), 0.0)

    @property
    def passed(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() > self.at

    def within(self, seconds: float) -> Deadline:
        """Return this moment, or the moment this many seconds from now if that is earlier."""
        return Deadline(min(self.at, time.monotonic() + seconds))

    def part(self, share: float) -> Deadline:
        """Return the moment at which a fraction of the remaining time is over."""
        return self.within(share * self.left)

    def extend(self, seconds: float) -> Deadline:
        """Return the moment this many seconds later."""
        return Deadline(self.at + seconds)


NEVER = Deadline()
