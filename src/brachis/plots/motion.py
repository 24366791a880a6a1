"""Joint positions, joint velocities and progress along the path over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.plots import style
from brachis.plots.curves import dense_samples, knot_times
from brachis.trajectory import Samples, Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_REACH = 0.3  # of the range of all data


def plot_motion(trajectory: Trajectory) -> Figure:
    """Plot q, dq/dt, s and ds/dt in panels over one time axis.

    Parameters
    ----------
    trajectory : Trajectory

    Returns
    -------
    Figure
        One column wide. Dashed lines are limits, drawn where the motion comes near them; the faint ticks are the
        knots of the splines.
    """
    figure = style.new_figure(style.COLUMN_WIDTH, 145.0)
    samples = dense_samples(trajectory)
    grid = figure.add_gridspec(4, 1, height_ratios=[1.5, 1.5, 1.0, 1.0])
    top = figure.add_subplot(grid[0])
    panels = [top, *(figure.add_subplot(grid[row], sharex=top) for row in range(1, 4))]
    for ax, draw in zip(panels, (draw_positions, draw_velocities, draw_progress, draw_path_speed), strict=True):
        draw(ax, trajectory, samples)
    for ax in panels[:-1]:
        ax.tick_params(labelbottom=False)
        ax.set_xlabel("")
    style.legend_above(top, style.COLUMN_WIDTH - 15.0)
    style.mark_end(panels[-1], trajectory.t_end)
    figure.align_ylabels(panels)
    return figure


def draw_positions(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw joint positions and the ends of their ranges."""
    robot = trajectory.robot
    _draw_joints(ax, trajectory, samples.t, samples.q)
    _draw_limits(ax, np.array([robot.limits.position_lower, robot.limits.position_upper]), samples.q)
    _dress(ax, trajectory, f"$q$ ({style.unit_of(robot.position_units)})")


def draw_velocities(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw joint velocities and their limits."""
    robot = trajectory.robot
    _draw_joints(ax, trajectory, samples.t, samples.qdot)
    _draw_limits(ax, robot.limits.both_ways("velocity"), samples.qdot)
    _dress(ax, trajectory, rf"$\dot{{q}}$ ({style.unit_of(robot.position_units, '/s')})")


def draw_progress(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw the path coordinate."""
    ax.plot(samples.t, samples.s, color="black", linewidth=style.LINE_WIDTH)
    _dress(ax, trajectory, "$s$")
    ax.set_ylim(-0.04, 1.04)


def draw_path_speed(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw the rate of the path coordinate."""
    ax.plot(samples.t, trajectory.path_spline(samples.t, nu=1), color="black", linewidth=style.LINE_WIDTH)
    _dress(ax, trajectory, r"$\dot{s}$ (1/s)")
    ax.set_ylim(bottom=0.0)


def _dress(ax: Axes, trajectory: Trajectory, ylabel: str) -> None:
    style.dress(ax, r"$t$ (s)", ylabel)
    style.dress_time(ax, trajectory.t_end, knot_times(trajectory))


def _draw_joints(ax: Axes, trajectory: Trajectory, t: np.ndarray, values: np.ndarray) -> None:
    for joint, name in enumerate(trajectory.joint_names):
        ax.plot(t, values[:, joint], label=style.plain(name), **style.joint_style(joint))


def _draw_limits(ax: Axes, levels: np.ndarray, values: np.ndarray) -> None:
    """Draw the limits `levels` (2, n) that a joint comes near; one grey line where all joints share one."""
    reach = _REACH * max(float(np.ptp(values)), 1e-9)
    near = (levels >= values.min(axis=0) - reach) & (levels <= values.max(axis=0) + reach)
    for level, close in zip(levels, near, strict=True):
        shared = bool(np.all(level == level[0]))
        for value in np.unique(level[close]):
            joint = int(np.flatnonzero(close & (level == value))[0])
            colour = style.GREY if shared else style.joint_style(joint)["color"]
            ax.axhline(value, color=colour, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1.0)
