"""Long straight ways between points: nothing else would hold a curve to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.arrays import with_like_signs
from brachis.cam.points import QUATERNION, Points
from brachis.errors import write_count

_FEWEST = 20
_LONG = 5.0
_MOST = 200


def with_gaps_filled(points: Points) -> tuple[Points, tuple[str, ...]]:
    """Put points on the straight ways that are five times longer than usual, and say how many ways there are."""
    chords = np.linalg.norm(np.diff(points.position, axis=0), axis=1)
    usual = float(np.median(chords))
    long = chords > _LONG * usual
    if len(points) < _FEWEST or not np.any(long):
        return points, ()
    counts = np.where(long, np.minimum(np.ceil(chords / (2.0 * usual)), _MOST), 1.0).astype(int)
    before = np.repeat(np.arange(len(chords)), counts)
    firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    shares = ((np.arange(len(before)) - firsts[before] + 1) / counts[before])[:, None]

    def filled(values: np.ndarray) -> np.ndarray:
        between = values[before] + shares * (values[before + 1] - values[before])
        return np.concatenate([values[:1], between])

    turning = filled(points.turning)
    speed = None if points.speed is None else np.concatenate([points.speed[:1], points.speed[before + 1]])
    rows = np.concatenate([points.rows[:1], points.rows[before + 1]])
    turning = with_like_signs(turning) if turning.shape[1] == QUATERNION else turning
    ways = write_count(int(np.count_nonzero(long)), "way")
    told = f"taken as straight: {ways} longer than {_LONG:g} times the usual spacing"
    return replace(points, position=filled(points.position), turning=turning, speed=speed, rows=rows), (told,)
