"""How much of every limit is used over time, a panel for each kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.bottleneck.ratios import LimitRatios, limit_ratios
from brachis.limits import Limit
from brachis.plots import style
from brachis.plots.curves import knot_times
from brachis.trajectory import Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANEL_MM = 34.0
_FRAME_MM = 24.0
_RANGE = 1.15


@of_motion
def plot_limits(trajectory: Trajectory, limits: Sequence[Limit] | None = None) -> Figure:
    """Plot the ratios to all limits, whatever kinds there are; of positions the places in their ranges.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        Any one, a saved one for example.
    limits : sequence of Limit, optional
        Those of the trajectory's task if left out.

    Returns
    -------
    Figure
        One column wide; a panel for every kind, a line for every joint or whatever else it limits. Dashed: the limits.
        The faint ticks are the knots of the splines.

    Examples
    --------
    >>> from brachis import Trajectory
    >>> from brachis.plots import plot_limits, save_figure
    >>> save_figure(plot_limits(Trajectory.load("out/result.npz")), "limits.pdf")  # doctest: +SKIP
    """
    ratios = limit_ratios(trajectory, limits)
    shown = list(dict.fromkeys(label.axis for label in ratios.labels))
    figure = style.new_figure(style.COLUMN_WIDTH, _FRAME_MM + _PANEL_MM * len(shown))
    panels = [figure.add_subplot(len(shown), 1, row + 1) for row in range(len(shown))]
    draw_ratios(panels, trajectory, ratios, shown)
    handles = {label: line for ax in panels for line, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    style.legend_below(figure, style.COLUMN_WIDTH - 10.0, list(handles.values()), list(handles))
    style.mark_end(panels[-1], trajectory.t_end)
    figure.align_ylabels(panels)
    return figure


def draw_ratios(panels: Sequence[Axes], trajectory: Trajectory, ratios: LimitRatios, shown: Sequence[str]) -> None:
    """Draw what is limited, by the titles of its labels, a panel each; a subject looks the same in every panel."""
    subjects = list(dict.fromkeys((*trajectory.joint_names, *(label.subject for label in ratios.labels))))
    for ax, title in zip(panels, shown, strict=True):
        columns = [column for column, label in enumerate(ratios.labels) if label.axis == title]
        for column in columns:
            subject = ratios.labels[column].subject
            look = style.joint_style(subjects.index(subject))
            ax.plot(ratios.t, ratios.values[:, column], label=style.plain(subject), **look)
        values = ratios.values[:, columns]
        top = _RANGE * max(1.0, float(np.abs(values).max()))
        for level in (-1.0, 1.0) if values.min() < 0.0 else (1.0,):
            ax.axhline(level, color=style.GREY, **style.LIMIT)
            ax.axhspan(level, np.sign(level) * top, facecolor=style.FORBIDDEN, edgecolor="none", zorder=0.0)
        ax.set_ylim(-top if values.min() < 0.0 else -0.05 * top, top)
        style.dress(ax, r"$t$ (s)" if ax is panels[-1] else "", title)
        style.dress_time(ax, trajectory.t_end, knot_times(trajectory))
        ax.tick_params(labelbottom=ax is panels[-1])
