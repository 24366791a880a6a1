"""Everything about one trajectory on one page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from brachis.apps.bottleneck import limit_ratios
from brachis.apps.bottleneck.saturation import saturations_of
from brachis.apps.plots import style
from brachis.apps.plots.limits import draw_ratios
from brachis.apps.plots.motion import (
    dense_samples,
    draw_progress,
    draw_quantity,
    draw_tool_speed,
    draw_torques,
    height_of,
    joint_lines,
    label_time_once,
    shown_torques,
)
from brachis.apps.plots.postures import add_posture_axes, draw_postures, legend_postures
from brachis.apps.plots.quantities import quantities
from brachis.trajectory import Samples, Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec


@of_motion
def plot_overview(trajectory: Trajectory) -> Figure:
    """Plot postures, what holds the motion, positions and velocities, progress and tool speed on two columns' width.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        What holds the motion are the kinds of limits that are active longest, at most three; torques and forces where
        they are among these, or no limit is active. See `plot_postures`, `plot_torques`, `plot_limits` and
        `plot_motion` for what the panels show.
    """
    samples = dense_samples(trajectory)
    rows = {
        draw: quantities(trajectory, samples, kind)
        for kind, draw in (("position", draw_progress), ("velocity", draw_tool_speed))
    }
    heights = [
        74.0,
        *(46.0 * height_of(part) for part in rows[draw_progress]),
        34.0,
    ]
    figure = style.new_figure(style.PAGE_WIDTH, sum(heights) + 11.0)
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    postures = add_posture_axes(figure, trajectory, grid[0, 0])
    draw_postures(postures, trajectory, samples)
    legend_postures(postures, trajectory, 0.5 * style.PAGE_WIDTH - 10.0)
    draw_holding(figure, grid[0, 1], trajectory, samples)
    joints = []
    for column, (draw, found) in enumerate(rows.items()):
        panels = [
            figure.add_subplot(grid[row + 1, column]) for row in range(len(found) + 1)
        ]
        for ax, part in zip(panels, found, strict=False):
            draw_quantity(ax, trajectory, part)
        draw(panels[-1], trajectory, samples)
        label_time_once(panels)
        figure.align_ylabels(panels)
        joints += panels[:-1]
    lines = joint_lines(joints, trajectory)
    style.legend_below(figure, style.PAGE_WIDTH - 10.0, lines)
    return figure


def draw_holding(
    figure: Figure, place: SubplotSpec, trajectory: Trajectory, samples: Samples
) -> list[Axes]:
    """Draw the limits that hold the motion, one panel below the other; see `plot_overview`."""
    ratios = limit_ratios(trajectory)
    shares: dict[str, float] = {}
    for found in saturations_of(ratios):
        shares[found.label.axis] = shares.get(found.label.axis, 0.0) + found.share
    torques = shown_torques(trajectory, samples)
    of_torques = {part.share for parts in torques for part in parts}
    longest = [
        title
        for title in sorted(shares, key=shares.__getitem__, reverse=True)
        if shares[title] > 0.0
    ][:3]
    held = [title for title in longest if title not in of_torques]
    if longest and held == longest:
        torques = []
    cells = place.subgridspec(len(torques) + len(held), 1)
    panels = [figure.add_subplot(cells[row]) for row in range(len(torques) + len(held))]
    if torques:
        draw_torques(panels[: len(torques)], trajectory, torques)
    draw_ratios(panels[len(torques) :], trajectory, ratios, held)
    if not torques:
        style.mark_end(panels[0], trajectory.t_end)
    for ax in panels if len(panels) > 2 else ():
        ax.set_ylabel(ax.get_ylabel().replace(" / ", " /\n"), fontsize=style.LABEL_SIZE)
    label_time_once(panels)
    figure.align_ylabels(panels)
    return panels
