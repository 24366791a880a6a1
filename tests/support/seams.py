"""Points along seams that are known, with scatter, corners and orientations."""

from __future__ import annotations

import numpy as np

from brachis.task.points.points import Points

Array = np.ndarray


def wave(count: int, scatter: float = 0.0, seed: int = 0) -> Array:
    """Return positions, (count, 3), along a smooth curve of 1 m."""
    t = np.linspace(0.0, 1.0, count)
    smooth = np.column_stack(
        [0.9 * t, 0.1 * np.sin(2.0 * np.pi * t), 0.05 * np.cos(np.pi * t)]
    )
    return smooth + np.random.default_rng(seed).normal(size=smooth.shape) * scatter


def bent(count: int, scatter: float = 0.0, seed: int = 0) -> tuple[Array, Array]:
    """Return positions along a line, an arc and a line, with corners of 90 and 40 degrees, and the corners, (2, 3)."""
    third = count // 3
    first = np.column_stack([np.linspace(0.0, 0.3, third), np.zeros((third, 2))])
    angle = np.linspace(0.0, np.pi / 2.0, third)[1:]
    arc = first[-1] + 0.2 * np.column_stack(
        [1.0 - np.cos(angle), np.sin(angle), 0.0 * angle]
    )
    heading = np.deg2rad(-40.0)
    along = np.linspace(0.0, 0.4, count - len(first) - len(arc) + 1)[1:, None]
    last = arc[-1] + along * np.array([np.cos(heading), np.sin(heading), 0.0])
    points = np.concatenate([first, arc, last])
    corners = np.stack([first[-1], arc[-1]])
    return points + np.random.default_rng(seed).normal(
        size=points.shape
    ) * scatter, corners


def points(
    position: Array, turning: Array | None = None, speed: Array | None = None
) -> Points:
    count = len(position)
    return Points(
        position,
        np.empty((count, 0)) if turning is None else turning,
        speed,
        np.arange(count),
        "p",
        "row",
    )


def brute_distances(position: Array, drawn: Array) -> Array:
    """Return the distances, (n,), of points from a polygon, (k, p), by looking at every side."""
    first, side = drawn[:-1], np.diff(drawn, axis=0)
    square = np.maximum(np.sum(side**2, axis=1), 1e-300)
    result = []
    for point in position:
        share = np.clip(np.sum((point - first) * side, axis=1) / square, 0.0, 1.0)[
            :, None
        ]
        result.append(np.linalg.norm(point - first - share * side, axis=1).min())
    return np.array(result)
