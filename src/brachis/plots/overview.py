"""Everything about one trajectory on one page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from brachis.plots import style
from brachis.plots.curves import dense_samples
from brachis.plots.motion import draw_path_speed, draw_positions, draw_progress, draw_velocities
from brachis.plots.postures import add_posture_axes, draw_postures, legend_postures
from brachis.plots.torques import draw_torques
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DRAWINGS = {
    (0, 1): draw_torques,
    (1, 0): draw_positions,
    (1, 1): draw_velocities,
    (2, 0): draw_progress,
    (2, 1): draw_path_speed,
}


def plot_overview(trajectory: Trajectory) -> Figure:
    """Plot postures, torques, joint positions and velocities, and progress on two columns' width.

    Parameters
    ----------
    trajectory : Trajectory

    Returns
    -------
    Figure
        See `plot_postures`, `plot_torques` and `plot_motion` for what the panels show.
    """
    figure = style.new_figure(style.PAGE_WIDTH, 165.0)
    samples = dense_samples(trajectory)
    grid = figure.add_gridspec(3, 2, height_ratios=[1.7, 1.1, 0.8])
    postures = add_posture_axes(figure, trajectory, grid[0, 0])
    draw_postures(postures, trajectory, samples)
    legend_postures(postures, trajectory, 0.5 * style.PAGE_WIDTH - 10.0)
    panels = {}
    for (row, column), draw in _DRAWINGS.items():
        ax = panels[row, column] = figure.add_subplot(grid[row, column])
        draw(ax, trajectory, samples)
        if row == 1:
            ax.tick_params(labelbottom=False)
            ax.set_xlabel("")
    for column in range(2):
        figure.align_ylabels([ax for place, ax in panels.items() if place[1] == column])
    style.legend_below(figure, style.PAGE_WIDTH - 10.0, *panels[1, 0].get_legend_handles_labels())
    return figure
