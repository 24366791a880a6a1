"""A largest speed over the path coordinate: piecewise linear, with steps made into ramps on their faster side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_RAMP = 5e-3
"""Length of a ramp in s: Newton's steps need a slope."""
_SHARE = 0.4
"""Part of the way to the next place that a ramp takes at most."""
_BEYOND = 20.0
"""Times the speed at its end, up to which a table that ends there goes on rising within a ramp."""


class SpeedTable:
    """Largest speeds at path coordinates.

    Parameters
    ----------
    s : (P,) sequence of float
        Ascending; a place that occurs twice is a step.
    speed : (P,) sequence of float
        m/s.
    whole : bool, optional
        Whether the first and the last speed hold beyond their places too; otherwise nothing does there.

    Attributes
    ----------
    places : (p,) ndarray
        Path coordinates between which the speed is linear, each once.
    speeds : (p,) ndarray
        m/s; between the given places nowhere above the given ones.
    largest : float
        Of the given ones, m/s.
    """

    def __init__(self, s: Sequence[float], speed: Sequence[float], *, whole: bool = True) -> None:
        places, speeds = np.array(s, dtype=float), np.array(speed, dtype=float)
        given, steps = places.copy(), np.flatnonzero(np.diff(places) == 0.0)
        for first in steps.tolist():
            rising = speeds[first + 1] > speeds[first]
            moved, onwards = (first + 1, 1) if rising else (first, -1)
            beyond = moved + onwards
            if not 0 <= beyond < len(given):
                places[moved] += onwards * _RAMP
                continue
            length = min(_RAMP, _SHARE * abs(given[beyond] - given[moved]))
            share = length / abs(given[beyond] - given[moved])
            places[moved] += onwards * length
            speeds[moved] += share * (speed[beyond] - speed[moved])
        kept = _bends(places, speeds)
        self.places, self.speeds, self._whole = places[kept], speeds[kept], whole
        self.largest = float(self.speeds.max())
        if not whole:
            first, last = self.places[[0, -1]]
            self.places = np.concatenate([[first - _RAMP], self.places, [last + _RAMP]])
            self.speeds = np.concatenate([self.speeds[:1] * _BEYOND, self.speeds, self.speeds[-1:] * _BEYOND])

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest speeds, (K,), m/s, at path coordinates s, (K,), and their derivatives by s; none off the path."""
        if len(self.places) == 1:
            return np.full(len(s), self.speeds[0]), np.zeros(len(s))
        slopes = np.concatenate([[0.0], np.diff(self.speeds) / np.diff(self.places), [0.0]])
        piece = np.searchsorted(self.places, s, side="right")
        beyond = (s < self.places[0]) | (s > self.places[-1])
        nowhere = np.isnan(s) | (beyond & (not self._whole))
        return np.where(nowhere, np.inf, np.interp(s, self.places, self.speeds)), slopes[piece]


def _bends(places: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Tell which rows of a table are needed, (P,) bool: not those on the straight line between their neighbours."""
    slopes = np.concatenate([[np.nan], np.diff(speeds) / np.diff(places), [np.nan]])
    return ~np.isclose(slopes[1:], slopes[:-1], rtol=1e-12, atol=1e-12)
