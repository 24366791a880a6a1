"""Pictures of a moving robot at regular times."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.plots import style
from brachis.plots.curves import dense_samples
from brachis.plots.postures import add_posture_axes, draw_postures
from brachis.plots.skeleton import drawing_plane, skeleton
from brachis.robot import task_map_of
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100
MOST = 5000
"""Frames."""


def frame_times(trajectory: Trajectory, dt: float) -> np.ndarray:
    """Return the times of the pictures, (K,), s: multiples of the period, and the end, at which the last one stands."""
    times = np.arange(np.ceil(trajectory.t_end / dt * (1.0 - 1e-12)) + 1.0) * dt
    return np.minimum(times, trajectory.t_end)


def frames(trajectory: Trajectory, times: np.ndarray) -> Iterator[tuple[Figure, np.ndarray]]:
    """Yield the figure, ever the same one, and its pixels, (height, width, 4) uint8, at every time.

    The robot moves over its tool's path and over postures at regular times, with the time written above.

    Parameters
    ----------
    trajectory : Trajectory
    times : (K,) ndarray
        s.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  (imports in 0.3 s)

    figure = style.new_figure(1.2 * style.COLUMN_WIDTH, style.COLUMN_WIDTH)
    figure.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(figure)
    ax: Any = add_posture_axes(figure, trajectory)
    draw_postures(ax, trajectory, dense_samples(trajectory))
    task_map = task_map_of(trajectory.robot, trajectory.task.task_space)
    view = list(drawing_plane(trajectory.robot, trajectory.q[0], task_map.axes) or (0, 1, 2))
    bones = skeleton(trajectory.robot, trajectory.position(times)).bones[:, :, view]
    (links,) = ax.plot(*bones[0].T, color="black", linewidth=3.0, solid_capstyle="round", zorder=30.0, gid="robot")
    (tool,) = ax.plot(*bones[0, -1:].T, "o", color="black", markersize=6.0, zorder=31.0, gid="tool")
    ax.set_title("t")
    canvas.draw()
    figure.set_layout_engine("none")  # it would find the same layout for every picture anew
    for t, now in zip(times.tolist(), bones, strict=True):
        for artist, points in ((links, now), (tool, now[-1:])):
            artist.set_data(*points.T[:2])
            if points.shape[1] > 2:  # noqa: PLR2004  (in space)
                artist.set_3d_properties(points[:, 2])
        ax.set_title(f"t = {t:.2f} s of {trajectory.t_end:.3f} s", fontsize=style.LABEL_SIZE)
        canvas.draw()
        yield figure, np.asarray(canvas.buffer_rgba())
