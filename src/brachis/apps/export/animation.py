"""Animations: a robot that moves over its path, as GIF or, by ffmpeg, as MP4.

Matplotlib's own writers draw every picture anew, which takes six times as long and makes GIFs five times as large:
here only what moves is drawn anew, and a GIF has one palette.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.bottleneck.saturation import dense_samples
from brachis.apps.plots import style
from brachis.apps.plots.motion import draw_holding, lines_of
from brachis.apps.plots.postures import (
    draw_postures,
    plane_of,
    skeleton,
)
from brachis.common.files import atomic_write
from brachis.errors import InputError
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100
_WIDTH = 183.0
_HEIGHT = 88.0
"""mm."""
MOST = 5000
"""Frames."""


def frame_times(trajectory: Trajectory, dt: float) -> np.ndarray:
    """Return the times of the pictures, (K,), s: multiples of the period, and the end, at which the last one stands."""
    times = np.arange(np.ceil(trajectory.t_end / dt * (1.0 - 1e-12)) + 1.0) * dt
    return np.minimum(times, trajectory.t_end)


def frames(
    trajectory: Trajectory, times: np.ndarray, slower: float = 1.0
) -> Iterator[tuple[Figure, np.ndarray]]:
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
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = style.new_figure(_WIDTH, _HEIGHT)
    figure.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(figure)
    grid = figure.add_gridspec(1, 2)
    samples = dense_samples(trajectory)
    ax: Any = draw_postures(figure, trajectory, samples, grid[0])
    panels = draw_holding(figure, grid[1], trajectory, samples)
    lines = lines_of(panels, trajectory)
    style.legend_below(figure, _WIDTH - 10.0, lines)
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
    figure.set_layout_engine(
        "none"
    )  # it would find the same layout for every picture anew
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


def pictures(
    trajectory: Trajectory,
    dt: float,
    step: float,
    joints: Sequence[str] | None,
    slower: float,
) -> Iterator[np.ndarray]:
    """Yield pictures, (height, width, 3) uint8, of a motion.

    Parameters
    ----------
    trajectory : Trajectory
    dt : float
        Period at which pictures are shown, s.
    step : float
        Of which the format's periods are multiples, s.
    joints : sequence of str or None
        None: an animation shows the whole robot.
    slower : float
        How many times slower than in real time the motion goes.

    Raises
    ------
    InputError
        The period or the joints do not fit.
    """
    if joints is not None:
        problem = "an animation shows the whole robot"
        raise InputError(
            problem, where="joints", found=", ".join(joints), allowed="all joints"
        )
    if not 0.0 < slower < np.inf:
        raise InputError(
            "out of range",
            where="slower",
            found=slower,
            allowed="> 0: 10 is ten times slower",
        )
    usable = np.isfinite(dt) and dt > 0.0 and slower * trajectory.t_end / dt < MOST
    if not usable or abs(dt / step - round(dt / step)) > 1e-6:
        allowed = f"a multiple of {step:g} s, for at most {MOST} pictures"
        raise InputError(
            "cannot be the period of an animation",
            where="dt",
            found=f"{dt} s",
            allowed=allowed,
        )
    for _, pixels in frames(trajectory, frame_times(trajectory, dt / slower), slower):
        yield pixels[:, :, :3].copy()


_STEP = 0.01
"""s: GIF counts time in hundredths of a second."""
_COLOURS = 128
_PAUSE = 1.0
"""For which the last picture stands, s."""


def export_gif(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",  # noqa: ARG001  (the last picture is the end posture either way)
    joints: Sequence[str] | None = None,
    slower: float = 1.0,
) -> None:
    """Write the motion, again and again; see `brachis.export.write` for the parameters.

    Raises
    ------
    InputError
        `dt` is not a multiple of 0.01 s, or `joints` are named.
    """
    from PIL import Image

    images = [
        Image.fromarray(each)
        for each in pictures(trajectory, dt, _STEP, joints, slower)
    ]
    palette = images[len(images) // 2].quantize(_COLOURS)
    first, *others = (
        image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images
    )
    period = round(1e3 * dt)
    durations = [*[period] * len(others), round(1e3 * _PAUSE)]
    with atomic_write(path) as stream:
        first.save(
            stream,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=durations,
            loop=0,
            optimize=True,
        )


_STEP_MP4 = 1e-3
_PROGRAM = "ffmpeg"


def export_mp4(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",  # noqa: ARG001  (the last picture is the end posture either way)
    joints: Sequence[str] | None = None,
    slower: float = 1.0,
) -> None:
    """Write the motion; see `brachis.export.write` for the parameters.

    Raises
    ------
    InputError
        There is no ffmpeg, it cannot encode, `dt` is not a multiple of 1 ms, or `joints` are named.
    """
    program = shutil.which(_PROGRAM)
    if program is None:
        raise InputError(
            "an MP4 file needs ffmpeg, which is not installed",
            hint="Install ffmpeg, or write a GIF",
        )
    with tempfile.TemporaryDirectory(prefix="brachis-") as folder:
        film = (
            Path(folder) / "film.mp4"
        )  # a file with a name: MP4 is not written from its beginning to its end
        _encode(program, pictures(trajectory, dt, _STEP_MP4, joints, slower), dt, film)
        with atomic_write(path) as stream:
            stream.write(film.read_bytes())


def _encode(
    program: str, all_pictures: Iterator[np.ndarray], dt: float, film: Path
) -> None:
    """Let ffmpeg make a film of pictures."""
    first = next(all_pictures)
    height, width = (
        first.shape[0] // 2 * 2,
        first.shape[1] // 2 * 2,
    )  # H.264 halves the colours' resolution
    given = (
        f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r 1000/{round(1e3 * dt)} -i -"
    )
    made = "-an -pix_fmt yuv420p -movflags +faststart"
    with tempfile.TemporaryFile() as told:
        with subprocess.Popen(  # noqa: S603  (no shell, and nothing of the user's in the arguments)
            [program, "-v", "error", "-nostdin", *given.split(), *made.split(), film],
            stdin=subprocess.PIPE,
            stdout=told,
            stderr=told,
        ) as process:
            assert process.stdin is not None
            try:
                for picture in (first, *all_pictures):
                    process.stdin.write(picture[:height, :width].tobytes())
                process.stdin.close()
            except BrokenPipeError:  # what ffmpeg says tells more
                pass
        if process.returncode:
            told.seek(0)
            raise InputError(
                "ffmpeg cannot make the film",
                found=told.read().decode(errors="replace").strip(),
            )
