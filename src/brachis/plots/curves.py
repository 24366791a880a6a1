"""Samples that are dense enough for a smooth line and miss no corner."""

from __future__ import annotations

import numpy as np

from brachis.trajectory import Samples, Trajectory

_POINTS_PER_INTERVAL = 16


def knot_times(trajectory: Trajectory) -> np.ndarray:
    """Return the times of the knots of the splines from 0 to t_end, (N + 1,), s."""
    return np.unique(trajectory.knots) * trajectory.t_end


def dense_samples(trajectory: Trajectory) -> Samples:
    """Evaluate the trajectory at its knots, at its nodes and between."""
    knots = knot_times(trajectory)
    steps = np.arange(_POINTS_PER_INTERVAL) / _POINTS_PER_INTERVAL
    grid = (knots[:-1, None] + np.diff(knots)[:, None] * steps).ravel()
    return trajectory.at(np.clip(np.union1d(grid, trajectory.times), 0.0, trajectory.t_end))
