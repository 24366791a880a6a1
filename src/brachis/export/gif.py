"""Animated GIF."""

from __future__ import annotations

import os
from collections.abc import Sequence

from brachis.export.animation import pictures
from brachis.files import atomic_write
from brachis.trajectory import Trajectory

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
        `dt` is no multiple of 0.01 s, or `joints` are named.
    """
    from PIL import Image  # noqa: PLC0415  (Matplotlib needs it, too)

    images = [Image.fromarray(each) for each in pictures(trajectory, dt, _STEP, joints, slower)]
    palette = images[len(images) // 2].quantize(_COLOURS)
    first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    period = round(1e3 * dt)
    durations = [*[period] * len(others), round(1e3 * _PAUSE)]
    with atomic_write(path) as stream:
        first.save(stream, format="GIF", save_all=True, append_images=others, duration=durations, loop=0, optimize=True)
