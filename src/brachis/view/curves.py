"""The curves of the viewer's plots: torque, speed and position over their limits, and the use of all limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.bottleneck.ratios import limit_ratios
from brachis.trajectory import Samples, Trajectory

_TOP = 1.15
_BINS = 400


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves of one plot.

    Attributes
    ----------
    title : str
        What is plotted, with its unit.
    names : tuple of str
        Of the c curves.
    styles : tuple of int
        Number of each one's colour.
    t : (K,) ndarray
        From 0 to the end of the motion, s.
    values : (K, c) ndarray
    bounds : tuple of float
        Levels of the limits.
    low, high : float
        Ends of the axis.
    """

    title: str
    names: tuple[str, ...]
    styles: tuple[int, ...]
    t: np.ndarray
    values: np.ndarray
    bounds: tuple[float, ...]
    low: float
    high: float


def all_curves(trajectory: Trajectory, samples: Samples) -> list[Curves]:
    """Return the curves of all plots of a motion."""
    robot = trajectory.robot
    units, limits, zero = robot.position_units, robot.limits, np.zeros(robot.n)
    rates = tuple(f"{unit}/s" for unit in units)
    ranges = np.array([limits.position_lower, limits.position_upper])
    ended = np.isfinite(ranges).all(axis=0)
    middle = np.where(ended, 0.5 * np.where(ended, ranges, 0.0).sum(axis=0), 0.0)
    kinds = (
        ("torque", "torque / limit", robot.torque_units, samples.tau, limits.both_ways("torque"), zero),
        ("speed", "speed / limit", rates, samples.qdot, limits.both_ways("velocity"), zero),
        ("position", "position in its range (ends at -1 and 1)", units, samples.q, ranges, middle),
    )
    plots = [plot for kind in kinds for plot in _plots_of(trajectory, samples.t, *kind)]
    return [*plots, _largest_ratios(trajectory)]


def _plots_of(
    trajectory: Trajectory,
    t: np.ndarray,
    name: str,
    title: str,
    units: tuple[str, ...],
    values: np.ndarray,
    limits: np.ndarray,
    centre: np.ndarray,
) -> list[Curves]:
    """Plot what has limits as a part of them, from a centre (n,) in either direction, and the rest in its units."""
    limited = np.isfinite(limits).all(axis=0)
    plots = []
    if limited.any():
        away = (values - centre)[:, limited]
        low, high = (limits - centre)[:, limited]
        parts = away / np.where(away > 0.0, high, -low)
        top = _TOP * max(1.0, float(np.abs(parts).max()))
        plots.append(_of(title, trajectory, t, parts, limited, (-1.0, 1.0), -top, top))
    for unit in dict.fromkeys(np.array(units)[~limited].tolist()):
        free = ~limited & (np.array(units) == unit)
        low, high = float(values[:, free].min()), float(values[:, free].max())
        margin = 0.1 * (high - low) or 1.0
        plots.append(
            _of(f"{name} ({unit}), no limit", trajectory, t, values[:, free], free, (), low - margin, high + margin)
        )
    return plots


def _of(
    title: str,
    trajectory: Trajectory,
    t: np.ndarray,
    values: np.ndarray,
    chosen: np.ndarray,
    bounds: tuple[float, ...],
    low: float,
    high: float,
) -> Curves:
    joints = np.flatnonzero(chosen).tolist()
    names = tuple(trajectory.joint_names[joint] for joint in joints)
    return Curves(title, names, tuple(joints), t, values, bounds, low, high)


def _largest_ratios(trajectory: Trajectory) -> Curves:
    """Plot the largest ratio of every kind of limit, whatever kinds there are."""
    ratios = limit_ratios(trajectory)
    kinds = tuple(dict.fromkeys(label.kind for label in ratios.labels))
    parts = np.abs(ratios.values)
    edges = np.unique(np.searchsorted(ratios.t, np.linspace(0.0, trajectory.t_end, _BINS), side="left"))
    edges = edges[ratios.t[edges] < trajectory.t_end]
    values = np.empty((len(edges), len(kinds)))
    for column, kind in enumerate(kinds):
        largest = parts[:, [label.kind == kind for label in ratios.labels]].max(axis=1)
        values[:, column] = np.maximum.reduceat(largest, edges)
    top = _TOP * max(1.0, float(values.max(initial=0.0)))
    t, values = np.append(ratios.t[edges], trajectory.t_end), np.vstack([values, values[-1:]])
    return Curves("largest of every kind / limit", kinds, tuple(range(len(kinds))), t, values, (1.0,), 0.0, top)
