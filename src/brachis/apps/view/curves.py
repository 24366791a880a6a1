"""What the viewer shows of a motion, evaluated once: frames, path, curves of the plots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.apps.bottleneck.saturation import limit_ratios
from brachis.apps.plots.quantities import (
    Quantity,
    allowed_tool_speeds,
    kinds_of,
    quantities,
)
from brachis.apps.view.bodies import Placements, placements
from brachis.path import path_of
from brachis.robot import task_map_of
from brachis.trajectory import Samples, Trajectory

_TOP = 1.15
_NEAR = 1.3
"""Of the axis: limits of the tool's speed that are farther away are not shown."""
_SHOWN_FREE = ("position", "velocity", "torque")
"""Kinds of quantities that are shown of joints without limits, too."""


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


def all_curves(
    trajectory: Trajectory, samples: Samples, *, degrees: bool = False
) -> list[Curves]:
    """Return the curves of all plots of a motion; `degrees` for angles of joints without limits."""
    plots = []
    for kind in reversed(kinds_of(trajectory)):
        parts = quantities(trajectory, samples, kind, degrees=degrees)
        limited = [
            ratios for part in parts if (ratios := part.over_limits()) is not None
        ]
        if limited:
            largest = max(float(np.abs(part.values).max()) for part in limited)
            top = _TOP * max(1.0, largest)
            title = ", ".join(dict.fromkeys(part.share for part in limited))
            plots.append(_of(trajectory, title, limited, (-1.0, 1.0), -top, top))
        if kind not in _SHOWN_FREE:
            continue
        for each in parts:
            part = each.of_joints(~each.is_limited)
            if part is None:
                continue
            low = float(part.values.min())
            high = float(part.values.max())
            margin = 0.1 * (high - low) or 1.0
            title = f"{part.name} ({part.unit}), no limit"
            plots.append(
                _of(trajectory, title, [part], (), low - margin, high + margin)
            )
    return [*plots, _tool_speed(trajectory, samples), _largest_ratios(trajectory)]


def _of(
    trajectory: Trajectory,
    title: str,
    parts: Sequence[Quantity],
    bounds: tuple[float, ...],
    low: float,
    high: float,
) -> Curves:
    """Plot some quantities of the joints, in chain order."""
    values = np.hstack([part.values for part in parts])
    joints = np.concatenate([part.joints for part in parts])
    order = np.argsort(joints)
    names = tuple(trajectory.joint_names[joint] for joint in joints[order])
    return Curves(
        title,
        names,
        tuple(joints[order].tolist()),
        parts[0].t,
        values[:, order],
        bounds,
        low,
        high,
    )


def _tool_speed(trajectory: Trajectory, samples: Samples) -> Curves:
    """Plot the tool's speed, and the largest one that the task allows where it is near and the same everywhere."""
    speed = samples.tool_speed
    top = _TOP * float(speed.max()) or 1.0
    levels = [
        level
        for level in allowed_tool_speeds(trajectory, samples)
        if (level == level[0]).all()
    ]
    bounds = tuple(float(level[0]) for level in levels if level[0] < _NEAR * top)
    top = max([top, *(1.05 * level for level in bounds)])
    colour = len(trajectory.joint_names)
    return Curves(
        "tool speed (m/s)",
        ("tool",),
        (colour,),
        samples.t,
        speed[:, None],
        bounds,
        0.0,
        top,
    )


def _largest_ratios(trajectory: Trajectory) -> Curves:
    """Plot the largest ratio of every kind of limit, whatever kinds there are."""
    ratios = limit_ratios(trajectory)
    kinds = tuple(dict.fromkeys(label.kind for label in ratios.labels))
    parts = np.abs(ratios.values)
    edges = np.unique(
        np.searchsorted(ratios.t, np.linspace(0.0, trajectory.t_end, 400), side="left")
    )
    edges = edges[ratios.t[edges] < trajectory.t_end]
    values = np.empty((len(edges), len(kinds)))
    for column, kind in enumerate(kinds):
        largest = parts[:, [label.kind == kind for label in ratios.labels]].max(axis=1)
        values[:, column] = np.maximum.reduceat(largest, edges)
    top = _TOP * max(1.0, float(values.max(initial=0.0)))
    t = np.append(ratios.t[edges], trajectory.t_end)
    values = np.vstack([values, values[-1:]])
    return Curves(
        "largest of every kind / limit",
        kinds,
        tuple(range(len(kinds))),
        t,
        values,
        (1.0,),
        0.0,
        top,
    )


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory at even times.

    Attributes
    ----------
    trajectory : Trajectory
    samples : Samples
        At K times from start to end.
    frames : Placements
        At the same times.
    path : (K, 3) ndarray
        The prescribed path at the motion's own s, m; what it does not prescribe is the tool's.
    ghosts : Placements
        At a few even times from start to end.
    """

    trajectory: Trajectory
    samples: Samples
    frames: Placements
    path: np.ndarray
    ghosts: Placements

    @classmethod
    def of(cls, trajectory: Trajectory) -> Motion:
        """Evaluate a trajectory."""
        samples = trajectory.at(np.linspace(0.0, trajectory.t_end, 401))
        frames = placements(trajectory.robot, samples.q)
        ghosts = placements(
            trajectory.robot,
            trajectory.position(np.linspace(0.0, trajectory.t_end, 6)),
        )
        return cls(
            trajectory,
            samples,
            frames,
            _path(trajectory, samples.s, frames.tool),
            ghosts,
        )


def _path(trajectory: Trajectory, s: np.ndarray, tool: np.ndarray) -> np.ndarray:
    """Positions that the task prescribes, (K, 3), m."""
    task_map = task_map_of(trajectory.robot, trajectory.task.task_space)
    axes = list(task_map.axes)
    points = tool.copy()
    if axes:
        points[:, axes] = (
            path_of(task_map, trajectory.task)
            .sample(np.clip(s, 0.0, 1.0))
            .target[:, : len(axes)]
        )
    return points
