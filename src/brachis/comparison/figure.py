"""Both motions over time: progress, and how much of their limits they use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.bottleneck import limit_ratios
from brachis.comparison.comparison import Comparison
from brachis.plots import style
from brachis.plots.curves import dense_samples

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_today(comparison: Comparison) -> Figure:
    """Plot path coordinate, tool speed, and the largest ratio to any limit over time, of both motions.

    Of today's motion the line is what its rows prove; the band above it is what the motion that was made of them does
    between the rows.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Figure
        One column wide.
    """
    figure = style.new_figure(style.COLUMN_WIDTH, 130.0)
    panels = figure.subplots(3, 1, sharex=True)
    motions = {"today": comparison.today, "planned": comparison.result.trajectory}
    for (name, motion), colour, line in zip(motions.items(), style.COLOURS[1::-1], ("--", "-"), strict=True):
        look = {"color": colour, "linestyle": line, "linewidth": style.LINE_WIDTH}
        samples, ratios = dense_samples(motion), limit_ratios(motion)
        label = f"{name}: {motion.t_end:.4f} s"
        panels[0].plot(samples.t, samples.s, label=label, **look)
        panels[1].plot(samples.t, samples.tool_speed, **look)
        t, largest = ratios.t, np.abs(ratios.values).max(axis=1, initial=0.0)
        if motion is comparison.today and comparison.proven:
            proven = np.max([each.ratios.max(axis=1) for each in comparison.proven], axis=0)
            least = np.interp(t, comparison.proven[0].t, proven)
            label = "today, between its rows: up to"
            panels[2].fill_between(
                t, least, np.maximum(least, largest), color=colour, alpha=0.25, linewidth=0.0, label=label
            )
            t, largest = comparison.proven[0].t, proven
        panels[2].plot(t, largest, **look)
    panels[2].axhline(1.0, color=style.GREY, linewidth=0.8)
    for ax, ylabel in zip(panels, ("$s$", "tool speed (m/s)", "largest ratio to a limit"), strict=True):
        style.dress(ax, r"$t$ (s)" if ax is panels[-1] else "", ylabel)
        ax.set_ylim(bottom=0.0)
    panels[0].set_xlim(0.0, max(motion.t_end for motion in motions.values()))
    style.legend_above(panels[2], style.COLUMN_WIDTH - 15.0)
    style.legend_above(panels[0], style.COLUMN_WIDTH - 15.0)
    panels[0].set_title(comparison.verdict, fontsize=style.LABEL_SIZE, pad=16.0)
    return figure
