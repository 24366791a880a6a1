"""The table of export formats."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
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
        Short description of the format.
    suffix : str
        File suffix, with the dot.
    beginning : bytes
        Pattern of the beginning of files in this format; a file that begins differently is never overwritten.
    writer : callable
        Function that writes `JointRows`, or the `Film` of an animation, to a binary stream.
    dt : float
        Default period, s.
    last : {"exact", "hold"}
        Default for the last sample; see `Trajectory.sample`.
    step : float or None
        For an animation, the period must be a multiple of this time, s.
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
        "animation (needs ffmpeg)",
        ".mp4",
        rb"\x00{3}[\x1c\x20]ftyp",
        write_mp4,
        dt=0.04,
        step=1e-3,
    ),
}
"""Export formats by name."""


def name_format(
    path: str | os.PathLike[str],
    name: str | None,
    suffixes: Mapping[str, str],
    kind: str = "format",
) -> str:
    """Return the name of a format: the given one, or the first one with the suffix of a file.

    Raises
    ------
    UnknownNameError
        The format does not exist.
    InputError
        The suffix does not belong to a format.
    """
    if name is not None:
        check_names(kind, [name], suffixes, "format")
        return name
    suffix = file_name(path, "path").suffix.lower()
    for known, known_suffix in suffixes.items():
        if known_suffix == suffix:
            return known
    raise InputError(
        f"the suffix of the file is not that of a known {kind}",
        where=str(path),
        found=f"suffix {suffix}" if suffix else "no suffix",
        allowed=", ".join(suffixes.values()),
        hint=f"Or name the format: {', '.join(suffixes)}; programs of controllers need a profile",
    )


def format_of(path: str | os.PathLike[str], name: str | None = None) -> Format:
    """Return the format with a given name, or the format that belongs to the suffix of a file; see `name_format`."""
    suffixes = {known: form.suffix for known, form in FORMATS.items()}
    return FORMATS[name_format(path, name, suffixes)]


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
        File to write. An existing file is replaced if it begins like a file of this format by brachis, and kept if
        writing fails.
    form : str, optional
        Name of the format. By default the suffix decides.
    dt : float, optional
        Period, s, by default that of the format. Samples are at 0, dt, 2 dt, ...
    last : {"exact", "hold"}, optional
        Time of the last sample, by default that of the format; see `Trajectory.sample`. ``exact``: at t_end, so that
        the last period may be shorter. ``hold``: at the first multiple of `dt` at or after t_end, at rest in the end
        posture.
    joints : sequence of str, optional
        Joints to write, in this order, because a controller may drive only some. By default all joints of the robot. If
        a joint that moves is left out, there is a warning, and the file names the joint.
    slower : float, optional
        How many times slower an animation shows the motion.
    degrees, mm : bool, optional
        Whether to write angles in degrees, or lengths in mm.

    Raises
    ------
    InputError
        The format is unknown or cannot represent the motion, `dt` or `last` cannot be used, a joint is given twice, a
        library is missing, the file cannot be written, or it exists and is not by brachis.
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
