"""The formats, in one table."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

from brachis.apps.export.animation import film_of, write_gif, write_mp4
from brachis.apps.export.controllers import write_mcap, write_ros2_yaml, write_urscript
from brachis.apps.export.rows import rows_of
from brachis.apps.export.tables import write_csv, write_json, write_parquet
from brachis.common.files import atomic_write, file_name
from brachis.errors import InputError, check_names
from brachis.trajectory import MotionSource, motion_of


@dataclass(frozen=True)
class Format:
    """A format of exported motions.

    Attributes
    ----------
    about : str
        What it is, in a few words.
    suffix : str
        By which it is known, with the dot.
    beginning : bytes
        Pattern of how its files begin; a file that begins otherwise is never overwritten.
    writer : callable
        Writes `JointRows`, or the `Film` of an animation, to a binary stream.
    dt : float
        Default period, s.
    last : {"exact", "hold"}
        Default last sample; see `Trajectory.sample`.
    step : float or None
        Of an animation: periods are multiples of it, s.
    """

    about: str
    suffix: str
    beginning: bytes
    writer: Callable[[Any, BinaryIO], None]
    dt: float = 0.001
    last: str = "exact"
    step: float | None = None


FORMATS: dict[str, Format] = {
    "csv": Format(
        "table of t, q_, qd_, qdd_, tau_ of every joint",
        ".csv",
        rb"t,q_|# brachis: ",
        write_csv,
    ),
    "parquet": Format(
        "the same table in binary columns", ".parquet", rb"PAR1", write_parquet
    ),
    "json": Format(
        "samples, with a schema",
        ".json",
        rb'\{\n  "\$schema": "urn:brachis:',
        write_json,
    ),
    "ros2": Format(
        "trajectory_msgs/JointTrajectory as YAML",
        ".yaml",
        rb"# trajectory_msgs/msg/JointTrajectory",
        write_ros2_yaml,
        dt=0.01,
    ),
    "mcap": Format(
        "trajectory_msgs/JointTrajectory in an MCAP bag",
        ".mcap",
        rb"\x89MCAP0",
        write_mcap,
        dt=0.01,
    ),
    "urscript": Format(
        "program of servoj commands",
        ".script",
        rb"def brachis_motion\(\):",
        write_urscript,
        dt=0.002,
        last="hold",
    ),
    # GIF counts time in hundredths of a second.
    "gif": Format("animation", ".gif", rb"GIF8", write_gif, dt=0.04, step=0.01),
    "mp4": Format(
        "animation, where ffmpeg is installed",
        ".mp4",
        rb"\x00{3}[\x1c\x20]ftyp",
        write_mp4,
        dt=0.04,
        step=1e-3,
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
        check_names("format", [name], FORMATS, "format")
        return FORMATS[name]
    suffix = file_name(path, "path").suffix.lower()
    formats = [form for form in FORMATS.values() if form.suffix == suffix]
    if not formats:
        raise InputError(
            "the suffix of the file is not that of a known format",
            where=str(path),
            found=f"suffix {suffix}" if suffix else "no suffix",
            allowed=", ".join(form.suffix for form in FORMATS.values()),
            hint=f"Or name the format: {', '.join(FORMATS)}; programs of controllers need a profile",
        )
    return formats[0]


def write(
    trajectory: MotionSource,
    path: str | os.PathLike[str],
    *,
    form: str | None = None,
    dt: float | None = None,
    last: str | None = None,
    joints: Sequence[str] | None = None,
    slower: float = 1.0,
    degrees: bool = False,
    mm: bool = False,
) -> None:
    """Write a motion in one of the `FORMATS`.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        A motion, or its file.
    path : path
        File to write. An older one is replaced if it begins as brachis writes this format, and kept if writing fails.
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
    degrees, mm : bool, optional
        Write angles in degrees, or lengths in mm.

    Raises
    ------
    InputError
        The format is unknown or cannot hold the motion, `dt` or `last` cannot be used, a joint is given twice, a
        library is missing, or the file cannot be written or is not of brachis.
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
    motion = motion_of(trajectory)
    period = chosen.dt if dt is None else dt
    content: object
    if chosen.step is not None:
        content = film_of(motion, period, chosen.step, joints, slower)
    elif slower != 1.0:
        animations = [
            animation.suffix for animation in FORMATS.values() if animation.step
        ]
        raise InputError(
            "only animations can be slowed down",
            where="slower",
            found=slower,
            allowed=f"1, or {', '.join(animations)}",
        )
    else:
        rows = rows_of(motion, period, last or chosen.last, joints)
        content = rows.in_units(degrees=degrees, mm=mm)
    with atomic_write(path, chosen.beginning) as stream:
        chosen.writer(content, stream)
