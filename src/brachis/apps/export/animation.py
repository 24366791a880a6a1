"""Animations: a robot that moves over its path, as GIF or, by ffmpeg, as MP4."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots import style
from brachis.apps.plots.motion import dense_samples, joint_lines
from brachis.apps.plots.overview import draw_holding
from brachis.apps.plots.postures import (
    add_posture_axes,
    draw_postures,
    plane_of,
    skeleton,
)
from brachis.common.files import atomic_write
from brachis.errors import InputError
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.figure import Figure

_DPI = 100
_MAX_FRAMES = 5000


def frame_times(trajectory: Trajectory, dt: float) -> np.ndarray:
    """Return the times of the pictures, (K,), s: multiples of the period, and the end."""
    times = np.arange(np.ceil(trajectory.t_end / dt * (1.0 - 1e-12)) + 1.0) * dt
    return np.minimum(times, trajectory.t_end)


def frames(
    trajectory: Trajectory, times: np.ndarray, slower: float = 1.0
) -> Iterator[Figure]:
    """Yield the figure, always the same one, at every time.

    The robot moves over its tool's path and over postures at regular times, with the
    time written above. Next to it are the limits that hold the motion, torques for
    example, with a line at the time.

    Parameters
    ----------
    trajectory : Trajectory
    times : (K,) ndarray
        s.
    slower : float, optional
        How many times slower the motion is played, which is written above.
    """
    width = style.PAGE_WIDTH
    figure = style.new_figure(width, 88.0)
    grid = figure.add_gridspec(1, 2)
    samples = dense_samples(trajectory)
    ax: Any = add_posture_axes(figure, trajectory, grid[0])
    draw_postures(ax, trajectory, samples)
    panels = draw_holding(figure, grid[1], trajectory, samples)
    lines = joint_lines(panels, trajectory)
    style.legend_below(figure, width - 10.0, lines)
    view = list(plane_of(trajectory) or (0, 1, 2))
    bones = skeleton(trajectory.robot, trajectory.position(times)).bones[:, :, view]
    (links,) = ax.plot(
        *bones[0].T,
        color="black",
        linewidth=3.0,
        solid_capstyle="round",
        zorder=30.0,
        gid="robot",
    )
    (tool,) = ax.plot(
        *bones[0, -1:].T, "o", color="black", markersize=6.0, zorder=31.0, gid="tool"
    )
    cursors = [
        panel.axvline(0.0, color=style.GREY, linewidth=1.0, gid="now")
        for panel in panels
    ]
    pace = f", {slower:g} times slower" if slower != 1.0 else ""
    title = figure.suptitle(f"t{pace}", fontsize=style.LABEL_SIZE)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout is the same for all pictures
    for t, now in zip(times.tolist(), bones, strict=True):
        for artist, points in ((links, now), (tool, now[-1:])):
            artist.set_data(*points.T[:2])
            if len(view) == 3:
                artist.set_3d_properties(points[:, 2])
        title.set_text(f"t = {t:.2f} s of {trajectory.t_end:.3f} s{pace}")
        for cursor in cursors:
            cursor.set_xdata([t, t])
        yield figure


def _write(
    writer: AbstractMovieWriter,
    name: str,
    path: str | os.PathLike[str],
    all_frames: Iterator[Figure],
    pause: int = 1,
) -> None:
    """Let a writer make a film of figures.

    Parameters
    ----------
    writer : AbstractMovieWriter
    name : str
        Of a temporary file; its suffix tells the writer the format.
    path : path
    all_frames : iterator of Figure
    pause : int, optional
        How many times the last figure is written.
    """
    figure = next(all_frames)
    with tempfile.TemporaryDirectory(prefix="brachis-") as folder:
        film = Path(folder) / name
        with writer.saving(figure, film, _DPI):
            writer.grab_frame()
            for _ in all_frames:
                writer.grab_frame()
            for _ in range(pause - 1):
                writer.grab_frame()
        with atomic_write(path) as stream:
            stream.write(film.read_bytes())


def _checked_frames(
    trajectory: Trajectory,
    dt: float,
    step: float,
    joints: Sequence[str] | None,
    slower: float,
) -> Iterator[Figure]:
    """Return `frames` with a period `dt`, s, which has to be a multiple of `step`, s.

    Raises
    ------
    InputError
        The period or the joints do not fit.
    """
    if joints is not None:
        raise InputError(
            "an animation shows the whole robot",
            where="joints",
            found=", ".join(joints),
            allowed="all joints",
        )
    if not 0.0 < slower < np.inf:
        raise InputError(
            "out of range",
            where="slower",
            found=slower,
            allowed="> 0: 10 is ten times slower",
        )
    usable = 0.0 < dt < np.inf and slower * trajectory.t_end / dt < _MAX_FRAMES
    if not usable or abs(dt / step - round(dt / step)) > 1e-6:
        raise InputError(
            "cannot be the period of an animation",
            where="dt",
            found=f"{dt} s",
            allowed=f"a multiple of {step:g} s, for up to {_MAX_FRAMES} pictures",
        )
    return frames(trajectory, frame_times(trajectory, dt / slower), slower)


def export_gif(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",  # noqa: ARG001  (the last picture is the end posture either way)
    joints: Sequence[str] | None = None,
    slower: float = 1.0,
) -> None:
    """Write the motion as GIF, which counts time in hundredths of a second.

    The motion is shown again and again; its end stays for about a second. The
    parameters are those of `brachis.export.write`.

    Raises
    ------
    InputError
        `dt` is not a multiple of 0.01 s, or `joints` are named.
    """
    from matplotlib.animation import PillowWriter

    all_frames = _checked_frames(trajectory, dt, 0.01, joints, slower)
    writer = PillowWriter(fps=Fraction(100, round(100 * dt)))  # type: ignore[arg-type]
    _write(writer, "film.gif", path, all_frames, pause=int(np.ceil(1.0 / dt)))


def export_mp4(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",  # noqa: ARG001  (the last picture is the end posture either way)
    joints: Sequence[str] | None = None,
    slower: float = 1.0,
) -> None:
    """Write the motion as MP4, with the parameters of `brachis.export.write`.

    Raises
    ------
    InputError
        ffmpeg is missing or cannot encode, `dt` is not a multiple of 1 ms, or `joints`
        are named.
    """
    from matplotlib.animation import FFMpegWriter

    if not FFMpegWriter.isAvailable():
        raise InputError(
            "an MP4 file needs ffmpeg, which is not installed",
            hint="Install ffmpeg, or write a GIF",
        )
    all_frames = _checked_frames(trajectory, dt, 1e-3, joints, slower)
    rate: Any = Fraction(1000, round(1000 * dt))
    writer = FFMpegWriter(
        fps=rate, codec="h264", extra_args=["-movflags", "+faststart"]
    )
    try:
        _write(writer, "film.mp4", path, all_frames)
    except subprocess.CalledProcessError as error:
        raise InputError(
            "ffmpeg cannot make the film",
            found=str(error.stderr).strip(),
        ) from error
