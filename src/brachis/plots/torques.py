"""Joint torques over time, as fractions of their limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.plots import style
from brachis.plots.curves import dense_samples, knot_times
from brachis.trajectory import Samples, Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_RANGE = 1.15


def plot_torques(trajectory: Trajectory) -> Figure:
    """Plot the normalised joint torques with the band of what is allowed (Fig. 2 of the paper).

    Parameters
    ----------
    trajectory : Trajectory

    Returns
    -------
    Figure
        One column wide. Joints without a torque limit are left out; where no joint has one, the torques themselves
        are shown. The faint ticks are the knots of the splines.

    Examples
    --------
    >>> from brachis import plan
    >>> from brachis.plots import plot_torques, save_figure
    >>> save_figure(plot_torques(plan("examples/01_scara_line.yaml").trajectory), "torques.pdf")  # doctest: +SKIP
    """
    figure = style.new_figure(style.COLUMN_WIDTH, 58.0)
    ax = figure.add_subplot()
    draw_torques(ax, trajectory, dense_samples(trajectory))
    style.legend_above(ax, style.COLUMN_WIDTH - 15.0)
    return figure


def draw_torques(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw the torques into axes; one labelled line per joint, in chain order."""
    lower, upper = trajectory.robot.limits.both_ways("torque")
    limited = np.isfinite(upper)
    if limited.any():
        shown = np.flatnonzero(limited)
        values, label = samples.tau / np.where(samples.tau > 0.0, upper, -lower), r"$\tau / \tau_\mathrm{max}$"
        _draw_band(ax, np.abs(values[:, shown]).max())
    else:
        shown = np.arange(len(upper))
        units = [{"rad": "Nm", "m": "N"}[unit] for unit in trajectory.robot.position_units]
        values, label = samples.tau, rf"$\tau$ ({style.unit_of(units)})"
    for joint in shown.tolist():
        name = style.plain(trajectory.joint_names[joint])
        ax.plot(samples.t, values[:, joint], label=name, **style.joint_style(joint))
    style.dress(ax, r"$t$ (s)", label)
    style.dress_time(ax, trajectory.t_end, knot_times(trajectory))
    style.mark_end(ax, trajectory.t_end)


def _draw_band(ax: Axes, largest: float) -> None:
    """Shade what is forbidden, so that the band stands out and the lines do not."""
    top = _RANGE * max(1.0, largest)
    for sign in (-1.0, 1.0):
        ax.axhline(sign, color=style.GREY, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1.0)
        ax.axhspan(sign, sign * top, facecolor="#EFEFEF", edgecolor="none", zorder=0.0)
    ax.axhline(0.0, color=style.FAINT, linewidth=0.6, zorder=0.5)
    ax.set_ylim(-top, top)
