"""MP4, by ffmpeg."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from brachis.errors import InputError
from brachis.export.animation import pictures
from brachis.files import atomic_write
from brachis.trajectory import Trajectory

_STEP = 1e-3
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
        There is no ffmpeg, it cannot encode, `dt` is no multiple of 1 ms, or `joints` are named.
    """
    program = shutil.which(_PROGRAM)
    if program is None:
        raise InputError("an MP4 file needs ffmpeg, which is not installed", hint="Install ffmpeg, or write a GIF")
    with tempfile.TemporaryDirectory(prefix="brachis-") as folder:
        film = Path(folder) / "film.mp4"  # a file with a name: MP4 is not written from its beginning to its end
        _encode(program, pictures(trajectory, dt, _STEP, joints, slower), dt, film)
        with atomic_write(path) as stream:
            stream.write(film.read_bytes())


def _encode(program: str, all_pictures: Iterator[np.ndarray], dt: float, film: Path) -> None:
    """Let ffmpeg make a film of pictures."""
    first = next(all_pictures)
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2  # H.264 halves the colours' resolution
    given = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r 1000/{round(1e3 * dt)} -i -"
    made = "-an -pix_fmt yuv420p -movflags +faststart"
    with tempfile.TemporaryFile() as told:
        with subprocess.Popen(  # noqa: S603  (no shell, and nothing of the user's in the arguments)
            [program, "-v", "error", "-nostdin", *given.split(), *made.split(), film],
            stdin=subprocess.PIPE,
            stdout=told,
            stderr=told,
        ) as process:
            assert process.stdin is not None  # noqa: S101
            try:
                for picture in (first, *all_pictures):
                    process.stdin.write(picture[:height, :width].tobytes())
                process.stdin.close()
            except BrokenPipeError:  # what ffmpeg says tells more
                pass
        if process.returncode:
            told.seek(0)
            raise InputError("ffmpeg cannot make the film", found=told.read().decode(errors="replace").strip())
