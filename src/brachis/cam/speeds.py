"""Speeds along a fitted curve, from those of its points."""

from __future__ import annotations

import numpy as np

from brachis.cam.points import Array

Run = tuple[tuple[float, float], ...]


def speed_runs(sigma: Array, speed: Array | None) -> tuple[Run, ...]:
    """Return tables (sigma, speed), m and m/s, linear in between, of the stretches where a speed is prescribed.

    The speed of a point is that on the way to it. A point takes the lower one of the ways before and after, so that
    the table is nowhere above what was prescribed. What linear interpolation gives is left out.

    Parameters
    ----------
    sigma : (n,) ndarray
        Where the points are.
    speed : (n,) ndarray or None
        On the way to them, m/s; NaN where none is prescribed.
    """
    if speed is None or len(sigma) < 2:  # noqa: PLR2004
        return ()
    sigma = np.maximum.accumulate(sigma)
    ways = speed[1:]
    given = np.isfinite(ways)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], given, [False]]).astype(int)))
    runs = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        of_way = ways[first:last]
        values = np.minimum(np.append(of_way[0], of_way), np.append(of_way, of_way[-1]))
        kept = np.ones(len(values), dtype=bool)
        kept[1:-1] = (values[1:-1] != values[:-2]) | (values[1:-1] != values[2:])
        at = sigma[first : last + 1]
        runs.append(tuple(zip(at[kept].tolist(), values[kept].tolist(), strict=True)))
    return tuple(runs)
