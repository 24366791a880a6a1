"""The formats, in one table."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from brachis.apps.export.animation import export_gif, export_mp4
from brachis.apps.export.controllers import (
    export_mcap,
    export_ros2_yaml,
    export_urscript,
)
from brachis.apps.export.tables import export_csv, export_json, export_parquet
from brachis.errors import InputError, UnknownNameError
from brachis.trajectory import Motion, Trajectory, motion_of


class Exporter(Protocol):
    """Writes samples of a trajectory to one file; for the parameters see `write`."""

    def __call__(
        self,
        trajectory: Trajectory,
        path: str | os.PathLike[str],
        dt: float,
        *,
        last: str = ...,
        joints: Sequence[str] | None = ...,
    ) -> None:
        """Write the file."""
        ...


@dataclass(frozen=True)
class Format:
    """A format of exported motions.

    Attributes
    ----------
    about : str
        What it is, in a few words.
    suffix : str
        By which it is known, with the dot.
    export : Exporter
    dt : float
        Period unless another one is asked for, s.
    last : {"exact", "hold"}
        Last sample unless another one is asked for; see `Trajectory.sample`.
    animated : bool
        Whether it shows the motion, which may go slower than it is.
    """

    about: str
    suffix: str
    export: Exporter
    dt: float = 0.001
    last: str = "exact"
    animated: bool = False


FORMATS: dict[str, Format] = {
    "csv": Format("table of t, q_, qd_, qdd_, tau_ of every joint", ".csv", export_csv),
    "parquet": Format("the same table in binary columns", ".parquet", export_parquet),
    "json": Format("samples, with a schema", ".json", export_json),
    "ros2": Format(
        "trajectory_msgs/JointTrajectory as YAML", ".yaml", export_ros2_yaml, dt=0.01
    ),
    "mcap": Format(
        "trajectory_msgs/JointTrajectory in an MCAP bag", ".mcap", export_mcap, dt=0.01
    ),
    "urscript": Format(
        "program of servoj commands", ".script", export_urscript, dt=0.002, last="hold"
    ),
    "gif": Format("animation", ".gif", export_gif, dt=0.04, animated=True),
    "mp4": Format(
        "animation, where ffmpeg is installed",
        ".mp4",
        export_mp4,
        dt=0.04,
        animated=True,
    ),
}
"""Formats by name."""


def format_of(path: str | os.PathLike[str], name: str | None = None) -> Format:
    """Return the format with a name, or the one of a file's suffix.

    Raises
    ------
    UnknownNameError
        The format does not exist.
    InputError
        The suffix does not belong to a format.
    """
    if name is not None:
        if name not in FORMATS:
            raise UnknownNameError("format", name, FORMATS, where="format")
        return FORMATS[name]
    suffix = Path(path).suffix.lower()
    found = [form for form in FORMATS.values() if form.suffix == suffix]
    if not found:
        raise InputError(
            "cannot tell the format of the file",
            where=str(path),
            found=f"suffix {suffix}" if suffix else "no suffix",
            allowed=", ".join(form.suffix for form in FORMATS.values()),
            hint=f"Or name the format: {', '.join(FORMATS)}",
        )
    return found[0]


def write(
    trajectory: Motion,
    path: str | os.PathLike[str],
    *,
    form: str | None = None,
    dt: float | None = None,
    last: str | None = None,
    joints: Sequence[str] | None = None,
    slower: float = 1.0,
) -> None:
    """Write a motion in one of the `FORMATS`.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        A motion, or its file.
    path : path
        File to write; an older one is replaced, and kept if writing fails.
    form : str, optional
        Name of the format; that of the suffix unless given.
    dt : float, optional
        Period, s. Samples are at 0, dt, 2 dt, ... The format's unless given.
    last : {"exact", "hold"}, optional
        The last sample: at t_end exactly, so that the last period may be shorter; or at the first multiple of `dt` that
        is not before t_end, with the end posture held at rest there. See `Trajectory.sample`. The format's unless
        given.
    joints : sequence of str, optional
        Joints to write, in this order: a controller may drive but some. All of the robot unless given. A joint that
        moves and is left out is warned of, and named in the file.
    slower : float, optional
        How many times slower an animation shows the motion.

    Raises
    ------
    InputError
        The format is unknown or cannot hold the motion, `dt` or `last` cannot be used, a library is missing, or the
        file cannot be written.
    UnknownNameError
        A format or a joint does not exist.

    Examples
    --------
    >>> import brachis
    >>> from brachis import export
    >>> trajectory = brachis.plan("examples/01_scara_line.yaml").trajectory
    >>> export.write(trajectory, "motion.parquet", dt=0.004)  # doctest: +SKIP
    """
    chosen = format_of(path, form)
    if slower != 1.0 and not chosen.animated:
        allowed = ", ".join(each.suffix for each in FORMATS.values() if each.animated)
        raise InputError(
            "only animations may be slower",
            where="slower",
            found=slower,
            allowed=f"1, or {allowed}",
        )
    chosen.export(
        motion_of(trajectory),
        path,
        chosen.dt if dt is None else dt,
        last=chosen.last if last is None else last,
        joints=joints,
        **({"slower": slower} if chosen.animated else {}),
    )
