"""A timeline of how much of every limit is used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.bottleneck.saturation import (
    RIPPLE,
    THRESHOLD,
    limit_ratios,
    saturations,
)
from brachis.apps.plots import style
from brachis.apps.plots.motion import dress
from brachis.limits import Limit
from brachis.trajectory import Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.patches import Patch

    ratios = limit_ratios(trajectory, limits)
    found = {entry.label: entry for entry in saturations(ratios)}
    shown = [k for k, label in enumerate(ratios.labels) if found[label].is_half_used]
    labels = [ratios.labels[column] for column in shown]
    figure = style.new_figure(style.PAGE_WIDTH, 26.0 + 5.0 * max(len(shown), 1))
    ax = figure.add_subplot()
    blue: dict[str, Any] = {"cmap": "Blues", "norm": Normalize(0.0, 1.0)}
    orange = style.COLOURS[1]
    thick = 0.84  # of the distance between rows
    for row, (column, label) in enumerate(zip(shown, labels, strict=True)):
        used = np.abs(ratios.values[:, column])
        cells = 0.5 * (used[1:] + used[:-1])[None]
        edges = (row - 0.5 * thick, row + 0.5 * thick)
        ax.pcolormesh(ratios.t, edges, cells, shading="flat", rasterized=True, **blue)
        active = found[label].active
        spans = [(interval.begin, interval.end - interval.begin) for interval in active]
        ax.broken_barh(
            spans, (edges[0], thick), facecolor=orange, edgecolor=orange, linewidth=0.8
        )
    dress(ax, trajectory, "")
    ax.set_ylim(max(len(shown), 1) - 0.5, -0.5)
    names = [f"{style.plain(label.subject)} {label.kind}" for label in labels]
    ax.set_yticks(range(len(shown)), names)
    ax.tick_params(axis="y", length=0.0)
    if not shown:
        style.write(ax, 0.5, 0.5, "no limit is ever used by half", ha="center")
    bar = figure.colorbar(ScalarMappable(**blue), ax=ax, pad=0.01, fraction=0.03)
    bar.set_label("part of the limit", fontsize=style.LABEL_SIZE)
    bar.ax.tick_params(labelsize=style.TICK_SIZE, width=0.6, length=3.0)
    words = f"active: at {100.0 * THRESHOLD:g} % of the limit or beyond, with ripple down to {100.0 * RIPPLE:g} %"
    style.legend_above(ax, style.PAGE_WIDTH - 20.0, {words: Patch(facecolor=orange)})
    end = style.end_text(trajectory.t_end)
    style.write(ax, 1.0, 1.02, end, ha="right", va="bottom")
    return figure
