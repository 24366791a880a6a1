"""How much of every limit is used over time: a panel for each kind, or a timeline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.apps.bottleneck.saturation import (
    RIPPLE,
    THRESHOLD,
    LimitRatios,
    Saturation,
    limit_ratios,
    saturations_of,
)
from brachis.apps.plots import style
from brachis.apps.plots.motion import dress, label_time_once
from brachis.limits import Label, Limit
from brachis.trajectory import Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@of_motion
def plot_limits(
    trajectory: Trajectory, limits: Sequence[Limit] | None = None
) -> Figure:
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
    >>> from brachis.apps.plots import plot_limits, save_figure
    >>> save_figure(plot_limits(Trajectory.load("out/result.npz")), "limits.pdf")  # doctest: +SKIP
    """
    ratios = limit_ratios(trajectory, limits)
    shown = list(dict.fromkeys(label.axis for label in ratios.labels))
    figure = style.new_figure(style.COLUMN_WIDTH, 24.0 + 34.0 * len(shown))
    panels = style.stack_panels(figure, len(shown))
    draw_ratios(panels, trajectory, ratios, shown)
    style.legend_below(figure, style.COLUMN_WIDTH - 10.0, style.lines_by_label(panels))
    style.mark_end(panels[-1], trajectory.t_end)
    figure.align_ylabels(panels)
    return figure


def draw_ratios(
    panels: Sequence[Axes],
    trajectory: Trajectory,
    ratios: LimitRatios,
    shown: Sequence[str],
) -> None:
    """Draw what is limited, by the titles of its labels, a panel each; a subject looks the same in every panel."""
    subjects = list(
        dict.fromkeys(
            (*trajectory.joint_names, *(label.subject for label in ratios.labels))
        )
    )
    for ax, title in zip(panels, shown, strict=True):
        columns = [
            column for column, label in enumerate(ratios.labels) if label.axis == title
        ]
        for column in columns:
            subject = ratios.labels[column].subject
            look = style.joint_style(subjects.index(subject))
            ax.plot(
                ratios.t, ratios.values[:, column], label=style.plain(subject), **look
            )
        values = ratios.values[:, columns]
        top = 1.15 * max(1.0, float(np.abs(values).max()))
        for level in (-1.0, 1.0) if values.min() < 0.0 else (1.0,):
            style.draw_limit(ax, level, top)
        ax.set_ylim(-top if values.min() < 0.0 else -0.05 * top, top)
        dress(ax, trajectory, title)
    label_time_once(panels)


_SHOWN = 0.5
"""Limits that the motion never comes this near to are left out."""
_COLOURS = "Blues"
_ACTIVE = "#D55E00"
_THICK = 0.84


@of_motion
def plot_timeline(
    trajectory: Trajectory, limits: Sequence[Limit] | None = None
) -> Figure:
    """Plot how near the motion is to each limit over time.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        Any one, a saved one for example.
    limits : sequence of Limit, optional
        Those of the trajectory's task if left out.

    Returns
    -------
    Figure
        Two columns wide; a row for each value of a limit of which the motion ever uses more than half. The
        deeper the blue the nearer to the limit; orange where the limit is active, from 99 % of it on, ripple down to
        95 % included. The faint ticks are the knots of the splines.

    Examples
    --------
    >>> from brachis import Trajectory
    >>> from brachis.apps.plots import plot_timeline, save_figure
    >>> save_figure(plot_timeline(Trajectory.load("out/result.npz")), "timeline.pdf")  # doctest: +SKIP
    """
    ratios = limit_ratios(trajectory, limits)
    found = {entry.label: entry for entry in saturations_of(ratios)}
    shown = [
        column
        for column, label in enumerate(ratios.labels)
        if found[label].peak > _SHOWN
    ]
    figure = style.new_figure(style.PAGE_WIDTH, 26.0 + 5.0 * max(len(shown), 1))
    ax = figure.add_subplot()
    for row, column in enumerate(shown):
        _draw_row(ax, row, ratios, column, found[ratios.labels[column]])
    _dress(figure, ax, trajectory, [ratios.labels[column] for column in shown])
    return figure


def _draw_row(
    ax: Axes, row: int, ratios: LimitRatios, column: int, entry: Saturation
) -> None:
    """Draw one limit: its ratio as colour, and the stretches on which it is active."""
    used = np.abs(ratios.values[:, column])
    edges = row - 0.5 * _THICK, row + 0.5 * _THICK
    cells = 0.5 * (used[1:] + used[:-1])[None]
    ax.pcolormesh(
        ratios.t,
        edges,
        cells,
        cmap=_COLOURS,
        vmin=0.0,
        vmax=1.0,
        shading="flat",
        rasterized=True,
    )
    spans = [(stretch.begin, stretch.end - stretch.begin) for stretch in entry.active]
    ax.broken_barh(
        spans,
        (edges[0], _THICK),
        facecolor=_ACTIVE,
        edgecolor=_ACTIVE,
        linewidth=0.8,
        label="active",
    )


def _dress(
    figure: Figure, ax: Axes, trajectory: Trajectory, labels: list[Label]
) -> None:
    """Label rows, time and colours."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.patches import Patch

    dress(ax, trajectory, "")
    ax.set_ylim(max(len(labels), 1) - 0.5, -0.5)
    ax.set_yticks(
        range(len(labels)),
        [f"{style.plain(label.subject)} {label.kind}" for label in labels],
    )
    ax.tick_params(axis="y", length=0.0)
    if not labels:
        text = "no limit is ever used by half"
        ax.text(
            0.5,
            0.5,
            text,
            transform=ax.transAxes,
            fontsize=style.TICK_SIZE,
            ha="center",
            va="center",
        )
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, 1.0), _COLOURS), ax=ax, pad=0.01, fraction=0.03
    )
    bar.set_label("part of the limit", fontsize=style.LABEL_SIZE)
    bar.ax.tick_params(labelsize=style.TICK_SIZE, width=0.6, length=3.0)
    words = f"active: at {100.0 * THRESHOLD:g} % of the limit or beyond, with ripple down to {100.0 * RIPPLE:g} %"
    style.legend_above(ax, style.PAGE_WIDTH - 20.0, {words: Patch(facecolor=_ACTIVE)})
    ax.text(
        1.0,
        1.02,
        rf"$t_\mathrm{{E}} = {trajectory.t_end:.3f}$ s",
        transform=ax.transAxes,
        fontsize=style.TICK_SIZE,
        ha="right",
        va="bottom",
    )
