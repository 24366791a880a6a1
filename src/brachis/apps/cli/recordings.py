"""``brachis import | compare``: recorded motions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brachis.apps.cli.app import Degrees
from brachis.apps.cli.folder import (
    Writer,
    Written,
    make_folder,
    write_files,
    write_one,
    write_text,
)
from brachis.apps.cli.output import (
    Column,
    Json,
    exit_code,
    json_text,
    print_error,
    print_json,
    print_table,
    print_verification,
    print_what_was_left,
    progress,
    result_console,
    shown_warnings,
)
from brachis.common import interrupts

if TYPE_CHECKING:
    from brachis.apps.comparison import Comparison
    from brachis.trajectory import Trajectory

_FILES = {
    True: ("today.npz", "result.npz", "comparison.json", "comparison.png"),
    False: (
        "today.npz",
        "unverified.npz",
        "unverified_comparison.json",
        "unverified_comparison.png",
    ),
}
"""Names of today's motion, the plan, the figures and the drawing, by whether the plan was verified."""

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
    typer.Option(
        "--robot",
        help="URDF file; or a task file (.yaml), whose robot, limits and settings hold.",
    ),
]

RecordedSpace = Annotated[
    str | None,
    typer.Option(
        help="What of the motion is its path: rows such as x,y, or position, pose, pose_free_roll, joints. Default: "
        "the task's, or all that the robot can prescribe.",
        show_default=False,
    ),
]

AngleUnit = Annotated[
    str | None,
    typer.Option("--angle", help="Unit of angles whose column states none: rad, deg."),
]

LengthUnit = Annotated[
    str | None,
    typer.Option("--length", help="Unit of lengths whose column states none: m, mm."),
]

TimeUnit = Annotated[
    str | None,
    typer.Option("--time", help="Unit of a time whose column states none: s, ms."),
]

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
    with interrupts.defer():
        from brachis.apps.comparison import bound_ratios
        from brachis.verify import verify_trajectory
    trajectory = _load(csv, robot, task_space, angle, length, time, tolerance, noise)
    write_one(out, trajectory.save, (".npz",), (csv, robot))
    verification = verify_trajectory(trajectory)
    assert trajectory.recovered is not None
    if json:
        print_json(
            {
                "t_end": trajectory.t_end,
                "verified": verification.passed,
                "file": str(out),
                "recovered": trajectory.recovered.to_dict(),
                "verification": verification.to_dict(),
            }
        )
        return
    console = result_console()
    console.print(f"end time t_E: {trajectory.t_end:.4f} s")
    for line in trajectory.recovered.told:
        console.print(line)
    print_verification(console, verification, degrees=degrees)
    console.print(
        "these ratios are of the motion that was made of the rows; the rows alone prove:"
    )
    for proven in bound_ratios(trajectory):
        ratio, subject, instant = proven.worst
        console.print(f"{proven.limit} ratio {ratio:.4f}, {subject} at {instant:.4f} s")
    console.print(f"wrote {out}")


def compare(
    csv: RecordedFile,
    robot: RobotFile,
    keep_end: Annotated[
        bool,
        typer.Option(
            "--keep-end",
            help="End in today's end posture, not in any whose tool is there.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for today.npz, result.npz, comparison.json and comparison.png."
        ),
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
    with interrupts.defer():
        from brachis.apps import comparison
    if out is not None:
        make_folder(out, (*_FILES[True], *_FILES[False]), (csv, robot))
    with shown_warnings(), progress() as listener:
        trajectory = _load(
            csv, robot, task_space, angle, length, time, tolerance, noise
        )
        found = comparison.compare(trajectory, keep_end=keep_end, listener=listener)
    data = found.to_dict()
    written = Written((), ())
    if out is not None:
        written = _write(found, data, out)
        data["files"] = list(written.files)
    if json:
        print_json(data)
    else:
        _print_comparison(found, written.files)
    print_what_was_left(
        found.result.not_completed, interrupted=found.result.interrupted
    )
    if not found.result.verified:
        print_error(
            "the motion found did not pass the verification; it is marked unverified"
        )
    raise typer.Exit(exit_code(found.result.verified, written.failures))


def _load(
    file: Path,
    robot: Path,
    task_space: str | None,
    angle: str | None,
    length: str | None,
    time: str | None,
    tolerance: float | None,
    noise: float | None,
) -> Trajectory:
    """Import a recorded motion."""
    with interrupts.defer():
        from brachis.apps.cli.settings import task_space_of
        from brachis.apps.recording import import_motion
    units = {"angle": angle, "length": length, "time": time}
    return import_motion(
        file,
        str(robot),
        task_space=None if task_space is None else task_space_of(task_space),
        units={name: unit for name, unit in units.items() if unit is not None},
        tolerance=tolerance,
        noise=noise,
    )


def _write(found: Comparison, data: dict[str, Any], out: Path) -> Written:
    """Write both motions, the figures and the drawing."""
    from brachis.apps.comparison import plot_today
    from brachis.apps.plots import save_figure

    today, planned, figures_of_merit, drawing = _FILES[found.result.verified]
    results: dict[str, Writer] = {
        today: found.today.save,
        planned: found.result.trajectory.save,
        figures_of_merit: lambda path: write_text(json_text(data), path),
    }
    figures: dict[str, Writer] = {
        drawing: lambda path: save_figure(plot_today(found), path)
    }
    return write_files(
        out, results, figures, stale=_FILES[not found.result.verified][1:]
    )


def _print_comparison(found: Comparison, files: tuple[str, ...]) -> None:
    """Print the comparison for a person."""
    console = result_console()
    assert found.today.recovered is not None
    console.print(found.verdict)
    exceeded = (
        f"{len(found.exceeded)} exceeded"
        if found.exceeded
        else "kept, as far as rows tell"
    )
    if not found.proven:
        exceeded = "not known"
    rows = [
        (
            "end time t_E",
            f"{found.today.t_end:.4f} s",
            "",
            f"{found.result.t_end:.4f} s",
        ),
        *(
            (
                f"{use.limit}, used",
                f"{100 * use.today:.2f} % {use.today_at}",
                f"{100 * use.today_up_to:.2f} %",
                f"{100 * use.planned:.2f} % {use.planned_at}",
            )
            for use in found.uses
        ),
        (
            "limits",
            exceeded,
            "",
            "kept and verified" if found.result.verified else "NOT verified",
        ),
    ]
    columns = ("today", "between its rows up to", "planned")
    print_table(
        console, "", ("", *(Column(name, number=True) for name in columns)), rows
    )
    for line in (*found.remarks, *found.today.recovered.told):
        console.print(line)
    for name in files:
        console.print(f"wrote {name}")
