"""The clock of the viewer: which instant of the motion is shown."""

from __future__ import annotations

from dataclasses import dataclass

RATES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Speeds at which a motion can be played, as parts of the real one."""
_WATCHED = 3.0
"""Least time that a motion is played in at first, s."""
_PAUSE = 0.7
"""How long the end is shown before a motion begins again, s."""


def first_rate(t_end: float) -> float:
    """Return the largest of `RATES`, at most the real one, at which a motion of `t_end` s can be watched."""
    slow = [rate for rate in RATES if rate <= 1.0 and t_end / rate >= _WATCHED]
    return max(slow, default=RATES[0])


@dataclass
class Playback:
    """A motion that is played again and again.

    Attributes
    ----------
    t_end : float
        End of the motion, s.
    rate : float
        Speed, as a part of the real one.
    loops : bool
        Whether the motion goes on at its end without a pause.
    repeats : bool
        Whether it begins again at its end; otherwise it stays there.
    playing : bool
    time : float
        The instant that is shown, s.
    """

    t_end: float
    rate: float
    loops: bool = False
    repeats: bool = True
    playing: bool = True
    time: float = 0.0
    _waited: float = 0.0

    def advance(self, elapsed: float) -> float:
        """Go on by `elapsed` s of the spectator's time; returns the instant to show, s."""
        if not self.playing:
            return self.time
        if self.time < self.t_end:
            self.time, self._waited = min(self.time + elapsed * self.rate, self.t_end), 0.0
            return self.time
        if not self.repeats:
            self.playing = False
            return self.time
        self._waited += elapsed
        if self.loops or self._waited >= _PAUSE:
            self.time = 0.0
        return self.time

    def go_to(self, time: float) -> None:
        """Show one instant, s, and stay there."""
        self.playing = False
        self.time = min(max(time, 0.0), self.t_end)

    def toggle(self) -> None:
        """Play or pause; at the end, play from the beginning."""
        self.playing = not self.playing
        if self.playing and self.time >= self.t_end:
            self.time = 0.0
