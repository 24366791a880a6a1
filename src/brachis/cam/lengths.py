"""Length along points that scatter: their polygon is longer than the path, and may go back and forth."""

from __future__ import annotations

import numpy as np

from brachis.cam.points import Array

_WIDE = 20.0
_AT_LEAST = 1e-9


def lengths_along(position: Array, deviation: float) -> Array:
    """Return the length along the path at each of n positions, (n, p), m; strictly ascending from zero.

    Where the points scatter, it is that of the polygon through the means of blocks of points, so long that the scatter
    of the means is small beside it.
    """
    count = len(position)
    block = _block(position, deviation)
    if block == 1:
        chords = np.linalg.norm(np.diff(position, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(np.maximum(chords, _AT_LEAST))])
    edges = np.arange(0, count + 1, block)
    edges[-1] = count
    sums = np.concatenate([np.zeros((1, position.shape[1])), np.cumsum(position - position[0], axis=0)])
    sizes = np.diff(edges)[:, None]
    means = position[0] + np.diff(sums[edges], axis=0) / sizes
    centres = (edges[:-1] + edges[1:] - 1) / 2.0
    corners = np.concatenate([position[:1], means, position[-1:]])
    chords = np.maximum(np.linalg.norm(np.diff(corners, axis=0), axis=1), _AT_LEAST)
    index = np.concatenate([[-0.5], centres, [count - 0.5]])
    lengths = np.interp(np.arange(count), index, np.concatenate([[0.0], np.cumsum(chords)]))
    return np.asarray(lengths - lengths[0])


def _block(position: Array, deviation: float) -> int:
    """Return how many points are averaged: twice as many until the blocks are far apart beside the scatter."""
    count, block = len(position), 1
    while deviation > 0.0 and 8 * block < count:
        ends = position[::block]
        step = float(np.median(np.linalg.norm(np.diff(ends, axis=0), axis=1)))
        if step > _WIDE * deviation / block**0.5:
            break
        block *= 2
    return block
