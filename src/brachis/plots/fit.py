"""How far the points of a path are from the curve that was fitted to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.plots import style
from brachis.trajectory import Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from brachis.task import FitReport

_HEIGHT = 45.0
_ROOM = 1.15


@of_motion
def plot_fit(trajectory: Trajectory) -> Figure:
    """Plot the largest distances, and angles where the tool turns, of the points from the path, and the tolerances.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        One column wide, one part for each file or array that the path was fitted to; dotted lines are corners. A path
        that was not fitted gives a figure that says so.
    """
    fits = [fit for fit in trajectory.task.fits if fit.profile]
    figure = style.new_figure(style.COLUMN_WIDTH, _HEIGHT * max(len(fits), 1))
    if not fits:
        figure.text(0.5, 0.5, "the path was not fitted to points", ha="center", va="center", fontsize=style.LABEL_SIZE)
    for i, fit in enumerate(fits):
        _draw(figure.add_subplot(len(fits), 1, i + 1), fit)
    return figure


def _draw(ax: Axes, fit: FitReport) -> None:
    along, distances, angles = np.array(fit.profile).T
    ax.plot(1e3 * along, 1e3 * distances, color=style.COLOURS[0], linewidth=0.6)
    ax.axhline(1e3 * fit.position_tolerance, color=style.COLOURS[0], linewidth=0.8, linestyle="--")
    for corner in fit.corners:
        ax.axvline(1e3 * corner.distance, color=style.GREY, linewidth=0.6, linestyle=":")
    ax.set_xlim(0.0, 1e3 * fit.length)
    ax.set_ylim(0.0, _ROOM * 1e3 * fit.position_tolerance)
    style.dress(ax, "along the path (mm)", "distance (mm)")
    ax.set_title(style.plain(fit.source), fontsize=style.TICK_SIZE)
    if fit.orientation_error > 0.0:
        beside = ax.twinx()
        beside.plot(1e3 * along, np.rad2deg(angles), color=style.COLOURS[1], linewidth=0.6)
        beside.axhline(np.rad2deg(fit.orientation_tolerance), color=style.COLOURS[1], linewidth=0.8, linestyle="--")
        beside.set_ylim(0.0, _ROOM * np.rad2deg(fit.orientation_tolerance))
        style.dress(beside, "", "angle (deg)")
        beside.yaxis.label.set_color(style.COLOURS[1])
        ax.yaxis.label.set_color(style.COLOURS[0])
