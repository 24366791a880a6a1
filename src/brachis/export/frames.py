"""Pictures of a moving robot at regular times."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.plots import style
from brachis.plots.curves import dense_samples
from brachis.plots.motion import joint_lines
from brachis.plots.overview import draw_holding
from brachis.plots.postures import add_posture_axes, draw_postures
from brachis.plots.skeleton import drawing_plane, skeleton
from brachis.robot import task_map_of
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100
_WIDTH, _HEIGHT = 183.0, 88.0
"""mm."""
MOST = 5000
"""Frames."""


def frame_times(trajectory: Trajectory, dt: float) -> np.ndarray:
    """Return the times of the pictures, (K,), s: multiples of the period, and the end, at which the last one stands."""
    times = np.arange(np.ceil(trajectory.t_end / dt * (1.0 - 1e-12)) + 1.0) * dt
    return np.minimum(times, trajectory.t_end)


def frames(trajectory: Trajectory, times: np.ndarray, slower: float = 1.0) -> Iterator[tuple[Figure, np.ndarray]]:
    """Yield the figure, ever the same one, and its pixels, (height, width, 4) uint8, at every time.

    The robot moves over its tool's path and over postures at regular times, with the time written above. Beside it are
    the limits that hold the motion, torques for example, with a line at the time.

    Parameters
    ----------
    trajectory : Trajectory
    times : (K,) ndarray
        s.
    slower : float, optional
        How many times slower the motion is played, which is written above.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  (imports in 0.3 s)

    figure = style.new_figure(_WIDTH, _HEIGHT)
    figure.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(figure)
    grid, samples = figure.add_gridspec(1, 2), dense_samples(trajectory)
    ax: Any = add_posture_axes(figure, trajectory, grid[0])
    draw_postures(ax, trajectory, samples)
    panels = draw_holding(figure, grid[1], trajectory, samples)
    lines = joint_lines(panels, trajectory)
    style.legend_below(figure, _WIDTH - 10.0, list(lines.values()), list(lines))
    task_map = task_map_of(trajectory.robot, trajectory.task.task_space)
    view = list(drawing_plane(trajectory.robot, trajectory.q[0], task_map.axes) or (0, 1, 2))
    bones = skeleton(trajectory.robot, trajectory.position(times)).bones[:, :, view]
    look = {"color": "black", "animated": True}
    (links,) = ax.plot(*bones[0].T, linewidth=3.0, solid_capstyle="round", zorder=30.0, gid="robot", **look)
    (tool,) = ax.plot(*bones[0, -1:].T, "o", markersize=6.0, zorder=31.0, gid="tool", **look)
    cursors = [panel.axvline(0.0, color=style.GREY, linewidth=1.0, animated=True, gid="now") for panel in panels]
    pace = f", {slower:g} times slower" if slower != 1.0 else ""
    title = figure.suptitle(f"t{pace}", fontsize=style.LABEL_SIZE)
    canvas.draw()
    figure.set_layout_engine("none")  # it would find the same layout for every picture anew
    title.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for t, now in zip(times.tolist(), bones, strict=True):
        for artist, points in ((links, now), (tool, now[-1:])):
            artist.set_data(*points.T[:2])
            if points.shape[1] > 2:  # noqa: PLR2004  (in space)
                artist.set_3d_properties(points[:, 2])
        title.set_text(f"t = {t:.2f} s of {trajectory.t_end:.3f} s{pace}")
        canvas.restore_region(still)
        for cursor in cursors:
            cursor.set_xdata([t, t])
        for artist in (title, links, tool, *cursors):
            figure.draw_artist(artist)
        yield figure, np.asarray(canvas.buffer_rgba())
