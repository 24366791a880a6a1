"""Commands on motions; each imports what it needs when it is called.

``brachis import | compare``: their options.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brachis.apps.cli.app import Changes, Degrees, Strict, with_strict
from brachis.apps.cli.output import Json
from brachis.common import interrupts

ResultFile = Annotated[
    Path,
    typer.Argument(
        help="Result file (npz) written by 'brachis plan --out'.", metavar="RESULT"
    ),
]
Host = Annotated[
    str,
    typer.Option(
        help="Address that the viewer listens on; 0.0.0.0 lets other machines look.",
        metavar="ADDRESS",
    ),
]
Port = Annotated[
    int | None,
    typer.Option(
        help="Port of the viewer; 0 for any free one. Default: the first free one from 8080 on."
    ),
]
Browser = Annotated[
    bool,
    typer.Option(
        "--browser/--no-browser",
        help="Open the browser, where there is a screen and a terminal.",
    ),
]


def bottleneck(
    task: Annotated[
        Path,
        typer.Argument(
            help="Task file (YAML), or result file (npz) of a motion planned before.",
            metavar="TASK|RESULT",
        ),
    ],
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Solve again with every limit raised by 1 %, and compare."
        ),
    ] = False,
    reference: Annotated[
        bool,
        typer.Option(
            "--reference",
            help="Compare with the best value known: the same problem with discontinuous torque allowed, on a fine "
            "mesh; not a proven bound. Takes seconds.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for bottleneck.json and timeline.png; of a motion that fails the verification the names "
            "begin with unverified_."
        ),
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option(help="URDF file to use instead of the task's.")
    ] = None,
    changes: Changes = None,
    strict: Strict = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Say what holds a motion back: which limits cost time.

    How much each of them costs, and when it is active, of a task that is planned for it or of a saved motion.
    """
    with interrupts.postponed():
        from brachis.apps.cli import motions

    raise typer.Exit(
        motions.bottleneck_command(
            task,
            with_strict(changes, strict=strict),
            urdf=urdf,
            check=check,
            reference=reference,
            out=out,
            degrees=degrees,
            as_json=json,
        )
    )


def verify(
    result: ResultFile,
    urdf: Annotated[
        Path | None,
        typer.Option(help="Check against this URDF instead of the saved one."),
    ] = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Check a saved motion again: path, limits, ends."""
    with interrupts.postponed():
        from brachis.apps.cli import motions

    raise typer.Exit(
        motions.verify_command(result, urdf=urdf, degrees=degrees, as_json=json)
    )


def export(
    result: ResultFile,
    out: Annotated[
        Path,
        typer.Option(
            help="File to write; its suffix says the format: .csv and .parquet (t, then q_, qd_, qdd_, tau_ of every "
            "joint; SI units), .json, .yaml and .mcap (ROS 2's JointTrajectory), .script (URScript), .gif and .mp4."
        ),
    ],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="Format, by name: csv, parquet, json, ros2, mcap, urscript, gif or mp4.",
        ),
    ] = None,
    dt: Annotated[
        float | None,
        typer.Option(
            help="Period, s. Default: 0.001; 0.01 for ROS 2, 0.002 for URScript, 0.04 for animations.",
            show_default=False,
        ),
    ] = None,
    last: Annotated[
        str | None,
        typer.Option(
            help="Where the rows end: exact, at the end time, which need not be a multiple of the period; or hold, at "
            "the first multiple of it that is not before the end time, with the end posture held at rest. Default: "
            "exact; hold for URScript.",
            show_default=False,
        ),
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(
            help="Joints to write, in this order: j1,j2,... Default: all.",
            show_default=False,
        ),
    ] = None,
    slower: Annotated[
        float, typer.Option(help="How many times slower an animation shows the motion.")
    ] = 1.0,
) -> None:
    """Sample a saved motion for a controller, or animate it."""
    with interrupts.postponed():
        from brachis.apps.cli import motions

    motions.export_command(
        result, out, form=form, dt=dt, last=last, joints=joints, slower=slower
    )


def plot(
    result: ResultFile,
    out: Annotated[Path, typer.Option(help="Figure to write: png, pdf or svg.")],
    kind: Annotated[
        str,
        typer.Option(
            help="Which figure: torques, postures, motion, overview, timeline or limits."
        ),
    ] = "overview",
) -> None:
    """Draw a saved motion."""
    with interrupts.postponed():
        from brachis.apps.cli import motions

    motions.plot_command(result, out=out, kind=kind)


def report(
    result: ResultFile,
    out: Annotated[
        Path | None,
        typer.Option(
            help="HTML file to write; default: beside the result, as result.html."
        ),
    ] = None,
    title: Annotated[
        str | None,
        typer.Option(
            help="Title of the page; default: the robot's name and the file's."
        ),
    ] = None,
    degrees: Degrees = False,
) -> None:
    """Write a saved motion as one HTML page to judge it by."""
    with interrupts.postponed():
        from brachis.apps.cli import motions

    raise typer.Exit(
        motions.report_command(result, out=out, title=title, degrees=degrees)
    )


def view(
    result: Annotated[
        Path,
        typer.Argument(
            help="Result file (npz) written by 'brachis plan --out', or the folder.",
            metavar="RESULT",
        ),
    ],
    host: Host = "127.0.0.1",
    port: Port = None,
    browser: Browser = True,
    degrees: Degrees = False,
) -> None:
    """Show a saved motion in the browser.

    Robot, path, tool trace and ghost postures, with plots over the limits that follow a slider. Ctrl-C ends it.
    """
    with interrupts.postponed():
        from brachis.apps.cli import motions

    motions.view_command(result, host=host, port=port, browser=browser, degrees=degrees)


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
    with interrupts.postponed():
        from brachis.apps.cli import recordings

    recorded = recordings.Recorded(
        csv, robot, task_space, angle, length, time, tolerance, noise
    )
    recordings.import_command(recorded, out=out, degrees=degrees, as_json=json)


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
    with interrupts.postponed():
        from brachis.apps.cli import recordings

    recorded = recordings.Recorded(
        csv, robot, task_space, angle, length, time, tolerance, noise
    )
    raise typer.Exit(
        recordings.compare_command(recorded, keep_end=keep_end, out=out, as_json=json)
    )
