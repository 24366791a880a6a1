"""Animations of a robot that moves along its path, as GIF or, through ffmpeg, as MP4.

Matplotlib's own writers redraw every picture, which takes six times as long and makes GIFs five times as large. Here
only moving parts are redrawn, and a GIF has a single palette.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from brachis.apps.bottleneck.saturation import dense_samples
from brachis.apps.export.rows import require_library
from brachis.apps.plots import style
from brachis.apps.plots.motion import draw_holding, lines_of
from brachis.apps.plots.postures import draw_postures, plane_of, skeleton
from brachis.errors import InputError
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def frames(
    trajectory: Trajectory, times: np.ndarray, slower: float = 1.0
) -> Iterator[tuple[Figure, np.ndarray]]:
    """Yield the figure, always the same object, and its pixels, (height, width, 4) uint8, at every time.

    The robot moves in front of its tool path and a few of its postures, with the time above. Beside it are
    plots of active limits, for example torques, with a line at the current time.

    Parameters
    ----------
    trajectory : Trajectory
    times : (K,) ndarray
        Times of the pictures, s.
    slower : float, optional
        How many times slower than real time the motion is played; this is written above the picture.
    """
    figure = style.new_figure(style.PAGE_WIDTH, 88.0)
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_dpi(100)
    canvas: Any = FigureCanvasAgg(figure)
    grid = figure.add_gridspec(1, 2)
    samples = dense_samples(trajectory)
    ax: Any = draw_postures(figure, trajectory, samples, grid[0])
    panels = draw_holding(figure, grid[1], trajectory, samples)
    lines = lines_of(panels, trajectory)
    style.legend_below(figure, lines)
    view = list(plane_of(trajectory) or (0, 1, 2))
    bones = skeleton(trajectory.robot, trajectory.position(times))[:, :, view]
    look = {"color": "black", "animated": True}
    (links,) = ax.plot(
        *bones[0].T,
        linewidth=3.0,
        solid_capstyle="round",
        zorder=30.0,
        gid="robot",
        **look,
    )
    (tool,) = ax.plot(
        *bones[0, -1:].T, "o", markersize=6.0, zorder=31.0, gid="tool", **look
    )
    cursors = [
        panel.axvline(0.0, color=style.GREY, linewidth=1.0, animated=True, gid="now")
        for panel in panels
    ]
    pace = f", {slower:g} times slower" if slower != 1.0 else ""
    title = figure.suptitle(f"t{pace}", fontsize=style.LABEL_SIZE)
    canvas.draw()
    # The layout is the same for all pictures, so the engine need not compute it again.
    figure.set_layout_engine("none")
    title.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for t, now in zip(times.tolist(), bones, strict=True):
        for artist, points in ((links, now), (tool, now[-1:])):
            artist.set_data(*points.T[:2])
            if points.shape[1] > 2:
                artist.set_3d_properties(points[:, 2])
        title.set_text(f"t = {t:.2f} s of {trajectory.t_end:.3f} s{pace}")
        canvas.restore_region(still)
        for cursor in cursors:
            cursor.set_xdata([t, t])
        for artist in (title, links, tool, *cursors):
            figure.draw_artist(artist)
        yield figure, np.asarray(canvas.buffer_rgba())


Film = tuple[Iterator[np.ndarray], float]
"""Pictures of a motion, (height, width, 3) uint8, and the time for which each is shown, s."""


def film_of(
    trajectory: Trajectory,
    dt: float,
    step: float,
    joints: Sequence[str] | None,
    slower: float,
) -> Film:
    """Make a film of a motion.

    Parameters
    ----------
    trajectory : Trajectory
    dt : float
        Time for which each picture is shown, s.
    step : float
        The period must be a multiple of this time, s.
    joints : sequence of str or None
        Must be None, because an animation shows the whole robot.
    slower : float
        How many times slower than real time the motion is played.

    Raises
    ------
    InputError
        The period is not possible, or joints are given.
    """
    if joints is not None:
        raise InputError(
            "an animation cannot leave out joints",
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
    max_pictures = 5000
    usable = np.isfinite(dt) and dt > 0.0
    if not usable or abs(dt / step - round(dt / step)) > 1e-6:
        raise InputError(
            "an animation cannot have this period",
            where="dt",
            found=f"{dt} s",
            allowed=f"a multiple of {step:g} s",
        )
    count = slower * trajectory.t_end / dt
    if count >= max_pictures:
        raise InputError(
            "the animation would have too many pictures",
            where="dt" if slower <= 1.0 else "slower",
            found=f"{count:.6g} pictures: {slower:g} x {trajectory.t_end:.4g} s / {dt:g} s",
            allowed=f"fewer than {max_pictures}",
            hint="Lower slower, or raise dt",
        )
    pictures = frames(trajectory, trajectory.sample(dt / slower).t, slower)
    return (pixels[:, :, :3].copy() for _, pixels in pictures), dt


def write_gif(film: Film, stream: BinaryIO) -> None:
    """Write a film that repeats endlessly; the last picture is shown for 1 s."""
    pillow = require_library("PIL.Image", "a GIF", library="Pillow", extra="plots")
    pictures, period = film
    images = [pillow.fromarray(picture) for picture in pictures]
    palette = images[len(images) // 2].quantize(128)
    first, *following = (
        image.quantize(palette=palette, dither=pillow.Dither.NONE) for image in images
    )
    first.save(
        stream,
        format="GIF",
        save_all=True,
        append_images=following,
        duration=[*[round(1e3 * period)] * len(following), 1000],
        loop=0,
        optimize=True,
    )


def write_mp4(film: Film, stream: BinaryIO) -> None:
    """Write a film with ffmpeg.

    Raises
    ------
    InputError
        ffmpeg is not installed, or cannot encode.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        raise InputError(
            "an MP4 file needs ffmpeg, which is not installed",
            hint="Install ffmpeg, or write a GIF",
        )
    pictures, period = film
    first = next(pictures)
    # H.264 halves the resolution of colours, so width and height must be even.
    height, width = (2 * (size // 2) for size in first.shape[:2])
    source = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r 1000/{round(1e3 * period)} -i -"
    target = "-an -pix_fmt yuv420p -movflags +faststart"
    with tempfile.TemporaryDirectory(prefix="brachis-") as folder:
        # MP4 needs a named file, because it is not written from beginning to end.
        file = Path(folder) / "film.mp4"
        arguments = f"-v error -nostdin {source} {target}".split()
        with subprocess.Popen(  # noqa: S603  (no shell, and nothing of the user's in the arguments)
            [program, *arguments, file],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as process:
            assert process.stdin is not None
            with suppress(BrokenPipeError):  # its messages give the reason
                for picture in chain([first], pictures):
                    process.stdin.write(picture[:height, :width].tobytes())
            _, messages = process.communicate()
        if process.returncode:
            raise InputError(
                "ffmpeg failed to write the film",
                found=messages.decode(errors="replace").strip(),
            )
        stream.write(file.read_bytes())
