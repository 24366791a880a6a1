"""Joint quantities, torques, path coordinate and tool speed over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.apps.plots import style
from brachis.apps.plots.quantities import REACH, Quantity, near_tool_speeds, quantities
from brachis.trajectory import Samples, Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS_PER_INTERVAL = 16


def knot_times(trajectory: Trajectory) -> np.ndarray:
    """Return the times of the knots of the splines from 0 to t_end, (N + 1,), s."""
    return np.unique(trajectory.knots) * trajectory.t_end


def dense_samples(trajectory: Trajectory) -> Samples:
    """Evaluate the trajectory at its knots, at its nodes and between."""
    knots = knot_times(trajectory)
    steps = np.arange(_POINTS_PER_INTERVAL) / _POINTS_PER_INTERVAL
    grid = (knots[:-1, None] + np.diff(knots)[:, None] * steps).ravel()
    return trajectory.at(
        np.clip(np.union1d(grid, trajectory.times), 0.0, trajectory.t_end)
    )


_PROGRESS_MM = 26.0


@of_motion
def plot_motion(trajectory: Trajectory) -> Figure:
    """Plot q, dq/dt, s and the tool's speed in panels over one time axis; joints in rad and in m are apart.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        One column wide. Thin dashed lines are limits in the colours of their joints, drawn where the motion comes near
        them; the faint ticks are the knots of the splines.
    """
    samples = dense_samples(trajectory)
    found = quantities(trajectory, samples, "position", "velocity")
    heights = [
        *(38.0 * height_of(part) for part in found),
        _PROGRESS_MM,
        _PROGRESS_MM,
    ]
    figure = style.new_figure(style.COLUMN_WIDTH, sum(heights) + 17.0)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    panels = [figure.add_subplot(grid[row]) for row in range(len(heights))]
    for ax, part in zip(panels, found, strict=False):
        draw_quantity(ax, trajectory, part)
    draw_progress(panels[-2], trajectory, samples)
    draw_tool_speed(panels[-1], trajectory, samples)
    for ax in panels[:-1]:
        ax.sharex(panels[-1])
    label_time_once(panels)
    legend_joints(panels[:-2], trajectory, style.COLUMN_WIDTH - 15.0)
    style.mark_end(panels[-1], trajectory.t_end)
    figure.align_ylabels(panels)
    return figure


def height_of(part: Quantity) -> float:
    """Height of a panel, relative to one with many joints."""
    return 1.0 if len(part.joints) > 2 else 0.6


def draw_quantity(ax: Axes, trajectory: Trajectory, part: Quantity) -> None:
    """Draw one quantity of its joints, with their limits."""
    draw_joints(ax, trajectory, part)
    _draw_limits(ax, part)
    dress(ax, trajectory, f"${part.symbol}$ ({part.unit})")


def label_time_once(panels: Sequence[Axes]) -> None:
    """Leave the labels of time to the last one of panels one below the other."""
    for ax in panels[:-1]:
        ax.tick_params(labelbottom=False)
        ax.set_xlabel("")


def draw_joints(ax: Axes, trajectory: Trajectory, part: Quantity) -> None:
    """Draw one labelled line for each joint of a quantity."""
    for joint, column in zip(part.joints.tolist(), part.values.T, strict=True):
        ax.plot(
            part.t,
            column,
            label=style.plain(trajectory.joint_names[joint]),
            **style.joint_style(joint),
        )


def joint_lines(panels: Sequence[Axes], trajectory: Trajectory) -> dict[str, Artist]:
    """Collect one line of every joint that the panels show, in chain order, by its label."""
    found = style.lines_by_label(panels)
    names = map(style.plain, trajectory.joint_names)
    return {name: found[name] for name in names if name in found}


def legend_joints(panels: Sequence[Axes], trajectory: Trajectory, width: float) -> None:
    """Put a legend of all joints above the first panel; `width` is its room, mm."""
    style.legend_above(panels[0], width, joint_lines(panels, trajectory))


def draw_progress(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw the path coordinate."""
    ax.plot(samples.t, samples.s, color="black", linewidth=style.LINE_WIDTH)
    dress(ax, trajectory, "$s$")
    ax.set_ylim(-0.04, 1.04)


def draw_tool_speed(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw the tool's speed, and what the task allows where the motion comes near it."""
    ax.plot(
        samples.t,
        samples.tool_speed,
        label="tool",
        color="black",
        linewidth=style.LINE_WIDTH,
    )
    for allowed in near_tool_speeds(trajectory, samples):
        ax.plot(samples.t, allowed, color=style.GREY, **style.LIMIT)
    dress(ax, trajectory, "tool speed (m/s)")
    ax.set_ylim(bottom=0.0)


def dress(ax: Axes, trajectory: Trajectory, ylabel: str) -> None:
    """Set the labels, with time to the right and the knots of the splines as faint ticks."""
    style.dress(ax, r"$t$ (s)", ylabel)
    style.dress_time(ax, trajectory.t_end, knot_times(trajectory))


def _draw_limits(ax: Axes, part: Quantity) -> None:
    """Draw every joint's own limits where it comes near them; joints that share a level share its dashes."""
    reach = REACH * max(float(np.ptp(part.values)), 1e-9)
    levels = np.array([part.lower, part.upper])
    near = (levels >= part.values.min(axis=0) - reach) & (
        levels <= part.values.max(axis=0) + reach
    )
    for level in np.unique(levels[near]):
        sharing = part.joints[np.any((levels == level) & near, axis=0)].tolist()
        for place, joint in enumerate(sharing):
            dashes = style.limit_dashes(place, len(sharing))
            ax.axhline(
                level,
                color=style.joint_style(joint)["color"],
                **{**style.LIMIT, "linestyle": dashes},
            )


@of_motion
def plot_torques(trajectory: Trajectory) -> Figure:
    """Plot the normalised joint torques, and forces, with the band of what is allowed (Fig. 2 of the paper).

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        One column wide. Joints without a limit are left out; where no joint has one, the torques themselves are shown,
        and the forces of prismatic joints in a panel below. The faint ticks are the knots of the splines.

    Examples
    --------
    >>> from brachis import plan
    >>> from brachis.apps.plots import plot_torques, save_figure
    >>> save_figure(plot_torques(plan("examples/01_scara_line.yaml").trajectory), "torques.pdf")  # doctest: +SKIP
    """
    found = shown_torques(trajectory, dense_samples(trajectory))
    figure = style.new_figure(style.COLUMN_WIDTH, 22.0 + 36.0 * len(found))
    panels = style.stack_panels(figure, len(found))
    draw_torques(panels, trajectory, found)
    legend_joints(panels, trajectory, style.COLUMN_WIDTH - 15.0)
    return figure


def shown_torques(trajectory: Trajectory, samples: Samples) -> list[list[Quantity]]:
    """Torques and forces by panels: those with limits in one, all of them apart by unit where no joint has a limit."""
    parts = quantities(trajectory, samples, "torque")
    limited = [ratios for part in parts if (ratios := part.over_limits()) is not None]
    return [limited] if limited else [[part] for part in parts]


def draw_torques(
    panels: Sequence[Axes], trajectory: Trajectory, found: Sequence[Sequence[Quantity]]
) -> None:
    """Draw what `shown_torques` found into as many axes; one labelled line per joint."""
    for ax, parts in zip(panels, found, strict=True):
        if not parts[0].is_limited.all():
            draw_quantity(ax, trajectory, parts[0])
        else:
            _draw_ratios(ax, trajectory, parts)
    label_time_once(panels)
    style.mark_end(panels[-1], trajectory.t_end)


def _draw_ratios(ax: Axes, trajectory: Trajectory, parts: Sequence[Quantity]) -> None:
    """Draw torques and forces over their limits, which may differ in both directions."""
    for part in parts:
        draw_joints(ax, trajectory, part)
    largest = max(float(np.abs(part.values).max()) for part in parts)
    top = 1.15 * max(1.0, largest)
    for level in (-1.0, 1.0):
        style.draw_limit(ax, level, top)
    ax.axhline(0.0, color=style.FAINT, linewidth=0.6, zorder=0.5)
    ax.set_ylim(-top, top)
    labels = (rf"${part.symbol} / {part.symbol}_\mathrm{{max}}$" for part in parts)
    dress(ax, trajectory, ", ".join(labels))
