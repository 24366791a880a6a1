"""Animations: what their periods and parameters must be, and how they are drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from brachis.errors import InputError
from brachis.export.frames import MOST, frame_times, frames
from brachis.trajectory import Trajectory


def pictures(
    trajectory: Trajectory, dt: float, step: float, joints: Sequence[str] | None, slower: float
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
        raise InputError(problem, where="joints", found=", ".join(joints), allowed="all joints")
    if not 0.0 < slower < np.inf:
        raise InputError("out of range", where="slower", found=slower, allowed="> 0: 10 is ten times slower")
    usable = np.isfinite(dt) and dt > 0.0 and slower * trajectory.t_end / dt < MOST
    if not usable or abs(dt / step - round(dt / step)) > 1e-6:  # noqa: PLR2004
        allowed = f"a multiple of {step:g} s, for at most {MOST} pictures"
        raise InputError("is no period of an animation", where="dt", found=f"{dt} s", allowed=allowed)
    for _, pixels in frames(trajectory, frame_times(trajectory, dt / slower), slower):
        yield pixels[:, :, :3].copy()
