"""Everything about one trajectory on one page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from brachis.plots import style
from brachis.plots.curves import dense_samples
from brachis.plots.motion import (
    draw_path_speed,
    draw_progress,
    draw_quantity,
    height_of,
    joint_lines,
    label_time_once,
)
from brachis.plots.postures import add_posture_axes, draw_postures, legend_postures
from brachis.plots.quantities import quantities
from brachis.plots.torques import draw_torques, shown_torques
from brachis.trajectory import Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POSTURES, _JOINTS, _PROGRESS, _FRAME = 74.0, 46.0, 34.0, 11.0
"""Heights of the rows, and of what is around them, mm."""


@of_motion
def plot_overview(trajectory: Trajectory) -> Figure:
    """Plot postures, torques, joint positions and velocities, and progress on two columns' width.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        See `plot_postures`, `plot_torques` and `plot_motion` for what the panels show.
    """
    samples = dense_samples(trajectory)
    rows = {
        draw: quantities(trajectory, samples, kind)
        for kind, draw in (("position", draw_progress), ("velocity", draw_path_speed))
    }
    heights = [_POSTURES, *(_JOINTS * height_of(part) for part in rows[draw_progress]), _PROGRESS]
    figure = style.new_figure(style.PAGE_WIDTH, sum(heights) + _FRAME)
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    postures = add_posture_axes(figure, trajectory, grid[0, 0])
    draw_postures(postures, trajectory, samples)
    legend_postures(postures, trajectory, 0.5 * style.PAGE_WIDTH - 10.0)
    torques = shown_torques(trajectory, samples)
    cells = grid[0, 1].subgridspec(len(torques), 1)
    places = [cells[row] for row in range(len(torques))] if len(torques) > 1 else [grid[0, 1]]
    draw_torques([figure.add_subplot(place) for place in places], trajectory, torques)
    joints = []
    for column, (draw, found) in enumerate(rows.items()):
        panels = [figure.add_subplot(grid[row + 1, column]) for row in range(len(found) + 1)]
        for ax, part in zip(panels, found, strict=False):
            draw_quantity(ax, trajectory, part)
        draw(panels[-1], trajectory, samples)
        label_time_once(panels)
        figure.align_ylabels(panels)
        joints += panels[:-1]
    lines = joint_lines(joints, trajectory)
    style.legend_below(figure, style.PAGE_WIDTH - 10.0, list(lines.values()), list(lines))
    return figure
