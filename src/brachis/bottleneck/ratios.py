"""How near a motion is to its limits over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.arrays import freeze
from brachis.limits import Label, Limit, Moments, limits_of
from brachis.robot import bind
from brachis.summary import Summary
from brachis.trajectory import Trajectory

_POINTS_PER_INTERVAL = 40


@dataclass(frozen=True, eq=False, repr=False)
class LimitRatios(Summary):
    """Ratios of the motion to all limits of its task. The arrays are read-only.

    Attributes
    ----------
    t : (K,) ndarray
        Ascending, s; a time at which a derivative that a limit asks for jumps occurs twice, before and after the jump.
    labels : tuple of Label
        What every column is.
    values : (K, c) ndarray
        1 at the upper limit, -1 at the lower one. Of a position it is the place in its range: 0 in the middle. Of
        a range with one end it is 1 minus the distance from it, rad or m, and 0 farther away.
    """

    t: np.ndarray
    labels: tuple[Label, ...]
    values: np.ndarray

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, "t", "values")


def limit_ratios(trajectory: Trajectory, limits: Sequence[Limit] | None = None) -> LimitRatios:
    """Compare a trajectory with every limit at its nodes, its knots and densely between.

    Parameters
    ----------
    trajectory : Trajectory
    limits : sequence of Limit, optional
        Those of the trajectory's task if left out.

    Returns
    -------
    LimitRatios
    """
    if limits is None:
        robot, _ = bind(trajectory.robot, trajectory.task.task_space)
        limits = limits_of(robot, trajectory.task)
    knots = np.unique(trajectory.knots) * trajectory.t_end
    steps = np.arange(_POINTS_PER_INTERVAL) / _POINTS_PER_INTERVAL
    grid = (knots[:-1, None] + np.diff(knots)[:, None] * steps).ravel()
    samples = trajectory.at(np.clip(np.union1d(grid, trajectory.times), 0.0, trajectory.t_end))
    behind = (samples.t, samples.q, samples.qdot, samples.qddot, trajectory.jerk(samples.t), samples.s)
    before, jumps = _just_before(trajectory), np.any(trajectory.qddot_before != trajectory.qddot, axis=1)[1:]
    if trajectory.degree <= max(limit.order for limit in limits):
        jumps[:-1] |= np.isin(trajectory.times[1:-1], knots)
    t, *motion = (np.concatenate([first[jumps], then]) for first, then in zip(before, behind, strict=True))
    order = np.argsort(t, kind="stable")
    moments = Moments(*(part[order] for part in motion))
    values = [limit.ratios(moments, t[order]) for limit in limits]
    return LimitRatios(t[order], tuple(label for limit in limits for label in limit.labels), np.hstack(values))


def _just_before(trajectory: Trajectory) -> tuple[np.ndarray, ...]:
    """Return times, positions, three derivatives and path coordinates just before every node but the first."""
    nodes = (trajectory.times, trajectory.q, trajectory.qdot, trajectory.qddot_before)
    return *(part[1:] for part in nodes), trajectory.jerk_pieces.c[-1], trajectory.path_spline(trajectory.times[1:])
