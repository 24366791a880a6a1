"""``brachis import | compare``: recorded motions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

import brachis
from brachis.apps.cli.app import Degrees, Figures, Json, task_space_of
from brachis.apps.cli.folder import Drawing, finish, output_folder, write_one
from brachis.apps.cli.output import (
    print_json,
    print_lines,
    print_table,
    print_verification,
    show_progress,
)

_FILES = ("today.npz", "result.npz", "comparison.json", "comparison.png")
"""The recorded motion, the plan, the figures and the drawing."""

RecordedFile = Annotated[
    Path,
    Argument(
        help="CSV file: time (t, time_ms, ...), joint positions (j1, q_j1, j1_pos [deg], ...), and velocities (qd_j1, "
        "...) and accelerations (qdd_j1, ...) if known.",
        metavar="CSV",
    ),
]

RobotFile = Annotated[
    Path,
    Option(
        help="URDF file; or a task file (.yaml), whose robot, limits and settings are used."
    ),
]

RecordedSpace = Annotated[
    str | None,
    Option(
        help="Task space of the path: rows such as x,y, or position, pose, pose_free_roll, joints. Default: that of "
        "the task, or the most that the robot can prescribe."
    ),
]

AngleUnit = Annotated[
    str | None, Option(help="Unit of angles in columns without a unit: rad, deg.")
]

LengthUnit = Annotated[
    str | None, Option(help="Unit of lengths in columns without a unit: m, mm.")
]

TimeUnit = Annotated[
    str | None, Option(help="Unit of times in a column without a unit: s, ms.")
]

PathTolerance = Annotated[
    float | None,
    Option(
        help="Largest deviation of the recovered path, m and rad. Default: 1e-6, or more if the file's last digits or "
        "the noise are coarser."
    ),
]

Noise = Annotated[
    float | None,
    Option(
        help="Standard deviation of measured positions, rad or m, which are then smoothed. Default: that of rounding "
        "to the file's digits."
    ),
]


def import_(
    csv: RecordedFile,
    robot: RobotFile,
    out: Annotated[Path, Option(help="Result file (npz) to write.")],
    task_space: RecordedSpace = None,
    angle: AngleUnit = None,
    length: LengthUnit = None,
    time: TimeUnit = None,
    tolerance: PathTolerance = None,
    noise: Noise = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Turn a recorded motion into a result file."""
    from brachis.apps.comparison import bound_ratios

    trajectory = brachis.import_motion(
        csv,
        str(robot),
        task_space=task_space_of(task_space),
        units=_units(angle=angle, length=length, time=time),
        tolerance=tolerance,
        noise=noise,
    )
    write_one(out, trajectory.save, (".npz",), (csv, robot))
    verification = brachis.verify_trajectory(trajectory)
    recovered = trajectory.recovered
    assert recovered is not None
    if json:
        print_json(
            {
                "t_end": trajectory.t_end,
                "verified": verification.passed,
                "file": str(out),
                "recovered": recovered.to_dict(),
                "verification": verification.to_dict(),
            }
        )
        return
    print_lines(f"end time t_E: {trajectory.t_end:.4f} s", *recovered.told)
    print_verification(verification, degrees=degrees)
    print_lines(
        "these ratios are of the motion interpolated from the rows; the rows alone prove:"
    )
    for proven in bound_ratios(trajectory):
        ratio, subject, instant = proven.worst
        print_lines(f"{proven.limit} ratio {ratio:.4f}, {subject} at {instant:.4f} s")
    print_lines(f"wrote {out}")


def compare(
    csv: RecordedFile,
    robot: RobotFile,
    keep_end: Annotated[
        bool,
        Option(
            "--keep-end",
            help="End in the recorded end posture, not in any posture with the tool there.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        Option(
            help="Folder for today.npz, result.npz, comparison.json and comparison.png."
        ),
    ] = None,
    task_space: RecordedSpace = None,
    angle: AngleUnit = None,
    length: LengthUnit = None,
    time: TimeUnit = None,
    tolerance: PathTolerance = None,
    noise: Noise = None,
    figures: Figures = True,
    json: Json = False,
) -> None:
    """Compare a recorded motion with a plan along its path."""
    from brachis.apps.comparison import plot_both_motions

    with output_folder(out, _FILES, (csv, robot)), show_progress() as listener:
        found = brachis.compare(
            csv,
            str(robot),
            task_space=task_space_of(task_space),
            units=_units(angle=angle, length=length, time=time),
            tolerance=tolerance,
            noise=noise,
            keep_end=keep_end,
            listener=listener,
        )
    drawings: dict[str, Drawing] = {"comparison.png": lambda: plot_both_motions(found)}
    code = finish(
        found.to_dict(),
        {"today.npz": found.recorded.save, "result.npz": found.result.trajectory.save},
        drawings if figures else {},
        out=out,
        names=_FILES,
        verified=found.result.verified,
        json=json,
        show=lambda: _print_comparison(found),
        result=found.result,
    )
    raise typer.Exit(code)


def _units(**units: str | None) -> dict[str, str]:
    """Return the units that the user states."""
    return {name: unit for name, unit in units.items() if unit is not None}


def _print_comparison(found: brachis.Comparison) -> None:
    """Print the comparison for a person."""
    print_lines(found.verdict)
    kept = "kept at all recorded rows"
    if found.exceeded:
        kept = f"{len(found.exceeded)} exceeded"
    if not found.proven:
        kept = "not known"
    verified = "kept and verified" if found.result.verified else "NOT verified"
    recorded = f"{found.recorded.t_end:.4f} s"
    planned = f"{found.result.t_end:.4f} s"
    uses = [
        (
            f"{use.limit}, used",
            f"{100 * use.recorded:.2f} % {use.recorded_at}",
            f"{100 * use.recorded_up_to:.2f} %",
            f"{100 * use.planned:.2f} % {use.planned_at}",
        )
        for use in found.uses
    ]
    first = ("end time t_E", recorded, "", planned)
    last = ("limits", kept, "", verified)
    columns = ("", "recorded", "between its rows up to", "planned")
    print_table("", columns, [first, *uses, last], numbers=columns[1:])
    print_lines(*found.remarks, *found.recovered.told)
