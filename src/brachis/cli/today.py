"""``brachis import | compare``: their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brachis import interrupts
from brachis.cli.options import Degrees
from brachis.cli.output import Json

RecordedFile = Annotated[
    Path,
    typer.Argument(
        help="CSV file: time (t, time_ms, ...), joint positions (j1, q_j1, j1_pos [deg], ...), and velocities (qd_j1, "
        "...) and accelerations (qdd_j1, ...) where they are known.",
        metavar="CSV",
    ),
]
RobotFile = Annotated[
    Path,
    typer.Option("--robot", help="URDF file; or a task file (.yaml), whose robot, limits and settings hold."),
]
RecordedSpace = Annotated[
    str | None,
    typer.Option(
        help="What of the motion is its path: rows such as x,y, or position, pose, pose_free_roll, joints. Default: "
        "the task's, or all that the robot can prescribe.",
        show_default=False,
    ),
]
AngleUnit = Annotated[str | None, typer.Option("--angle", help="Unit of angles whose column states none: rad, deg.")]
LengthUnit = Annotated[str | None, typer.Option("--length", help="Unit of lengths whose column states none: m, mm.")]
TimeUnit = Annotated[str | None, typer.Option("--time", help="Unit of a time whose column states none: s, ms.")]
PathTolerance = Annotated[
    float | None,
    typer.Option(
        help="How far the recovered path may be off, m and rad. Default: 1e-6, or what the file's last digits, or the "
        "noise, leave open.",
        show_default=False,
    ),
]
Noise = Annotated[
    float | None,
    typer.Option(
        help="Standard deviation of measured positions, rad or m, which are then smoothed. Default: that of the "
        "file's digits.",
        show_default=False,
    ),
]


def import_(
    csv: RecordedFile,
    robot: RobotFile,
    out: Annotated[Path, typer.Option(help="Result file (npz) to write.")],
    task_space: RecordedSpace = None,
    angle: AngleUnit = None,
    length: LengthUnit = None,
    time: TimeUnit = None,
    tolerance: PathTolerance = None,
    noise: Noise = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Make a result of a motion that runs today."""
    with interrupts.postponed():
        from brachis.cli import recordings  # noqa: PLC0415

    recorded = recordings.Recorded(csv, robot, task_space, angle, length, time, tolerance, noise)
    recordings.import_command(recorded, out=out, degrees=degrees, as_json=json)


def compare(
    csv: RecordedFile,
    robot: RobotFile,
    keep_end: Annotated[
        bool, typer.Option("--keep-end", help="End in today's end posture, not in any whose tool is there.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for today.npz, result.npz, comparison.json and comparison.png.")
    ] = None,
    task_space: RecordedSpace = None,
    angle: AngleUnit = None,
    length: LengthUnit = None,
    time: TimeUnit = None,
    tolerance: PathTolerance = None,
    noise: Noise = None,
    json: Json = False,
) -> None:
    """Show a motion of today beside a plan along its path."""
    with interrupts.postponed():
        from brachis.cli import recordings  # noqa: PLC0415

    recorded = recordings.Recorded(csv, robot, task_space, angle, length, time, tolerance, noise)
    raise typer.Exit(recordings.compare_command(recorded, keep_end=keep_end, out=out, as_json=json))
