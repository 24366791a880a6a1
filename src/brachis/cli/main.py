"""The command line: a function for each command, which imports what it needs when it is called.

Results go to standard output, everything else to standard error. With ``--json`` standard output gets one JSON object,
also for an error. The exit codes are in `brachis.cli.examples`.
"""

from __future__ import annotations

import sys
import traceback
from contextlib import redirect_stdout
from contextvars import copy_context
from functools import partial
from pathlib import Path
from typing import Annotated, TextIO, cast

import typer

from brachis import interrupts
from brachis.cli.app import app
from brachis.cli.composition import VectorCommand, compose
from brachis.cli.output import Json, StandardOutput, open_streams, print_failure, print_usage_error
from brachis.cli.today import compare, import_
from brachis.cli.verbosity import Verbosity, chosen
from brachis.errors import BrachisError

_UsageError = cast("type[Exception]", typer.BadParameter.__bases__[0])
"""What Typer raises for wrong options; it names it nowhere else."""

TaskFile = Annotated[Path, typer.Argument(help="Task file (YAML).", metavar="TASK")]
ResultFile = Annotated[
    Path, typer.Argument(help="Result file (npz) written by 'brachis plan --out'.", metavar="RESULT")
]
Host = Annotated[
    str, typer.Option(help="Address that the viewer listens on; 0.0.0.0 lets other machines look.", metavar="ADDRESS")
]
Port = Annotated[
    int | None, typer.Option(help="Port of the viewer; 0 for any free one. Default: the first free one from 8080 on.")
]
Browser = Annotated[
    bool, typer.Option("--browser/--no-browser", help="Open the browser, where there is a screen and a terminal.")
]
Strict = Annotated[
    bool,
    typer.Option("--strict", help="Refuse figures that are hardly meant, such as degrees for rad, instead of warning."),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the task, dotted as in spline.intervals=40 or path.0.line.length=0.5; the value is YAML. "
        "Repeatable.",
    ),
]


@app.command(name="robots")
def list_robots(json: Json = False) -> None:
    """List the robots that come with brachis."""
    with interrupts.postponed():
        from brachis.cli import starting  # noqa: PLC0415  (each command imports what it needs)

    starting.robots_command(as_json=json)


@app.command()
def new(
    urdf: Annotated[Path, typer.Argument(help="URDF file, or the name of a robot that comes along.", metavar="URDF")],
    out: Annotated[Path, typer.Option(help="Task file to write, a new one.")] = Path("task.yaml"),
    tool_frame: Annotated[str | None, typer.Option(help="Link at the chain's end.")] = None,
    base_frame: Annotated[str | None, typer.Option(help="Link at the chain's beginning.")] = None,
    json: Json = False,
) -> None:
    """Write a first task for a robot, with comments.

    It has a posture away from limits and singularities and a short line that can be reached from it, and it has been
    planned and verified.
    """
    with interrupts.postponed():
        from brachis.cli import starting  # noqa: PLC0415

    starting.new_command(urdf, out, tool_frame=tool_frame, base_frame=base_frame, as_json=json)


@app.command()
def plan(
    task: TaskFile,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for result.npz, result.json, overview.png and candidates.png (and fit.png, where the path was "
            "fitted to points); of a motion that fails the verification the names begin with unverified."
        ),
    ] = None,
    urdf: Annotated[Path | None, typer.Option(help="URDF file to use instead of the task's.")] = None,
    changes: Changes = None,
    view: Annotated[bool, typer.Option("--view", help="Show the motion in the browser, until Ctrl-C.")] = False,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Plan a task, verify the motion, and show what came out."""
    with interrupts.postponed():
        from brachis.cli import planning  # noqa: PLC0415

    raise typer.Exit(
        planning.plan_command(task, changes or [], urdf=urdf, out=out, view=view, strict=strict, as_json=json)
    )


@app.command()
def bottleneck(
    task: Annotated[
        Path,
        typer.Argument(
            help="Task file (YAML), or result file (npz) of a motion planned before.", metavar="TASK|RESULT"
        ),
    ],
    check: Annotated[
        bool, typer.Option("--check", help="Solve again with every limit raised by 1 %, and compare.")
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
    urdf: Annotated[Path | None, typer.Option(help="URDF file to use instead of the task's.")] = None,
    changes: Changes = None,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Say what holds a motion back: which limits cost time.

    How much each of them costs, and when it is active, of a task that is planned for it or of a saved motion.
    """
    with interrupts.postponed():
        from brachis.cli import bottleneck as command  # noqa: PLC0415

    raise typer.Exit(
        command.bottleneck_command(
            task, changes or [], urdf=urdf, check=check, reference=reference, out=out, strict=strict, as_json=json
        )
    )


@app.command()
def verify(
    result: ResultFile,
    urdf: Annotated[Path | None, typer.Option(help="Check against this URDF instead of the saved one.")] = None,
    json: Json = False,
) -> None:
    """Check a saved motion again: path, limits, ends."""
    with interrupts.postponed():
        from brachis.cli import results  # noqa: PLC0415

    raise typer.Exit(results.verify_command(result, urdf=urdf, as_json=json))


@app.command()
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
        typer.Option("--format", help="Format, by name: csv, parquet, json, ros2, mcap, urscript, gif or mp4."),
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
        str | None, typer.Option(help="Joints to write, in this order: j1,j2,... Default: all.", show_default=False)
    ] = None,
) -> None:
    """Sample a saved motion for a controller, or animate it."""
    with interrupts.postponed():
        from brachis.cli import results  # noqa: PLC0415

    results.export_command(result, out, form=form, dt=dt, last=last, joints=joints)


@app.command()
def plot(
    result: ResultFile,
    out: Annotated[Path, typer.Option(help="Figure to write: png, pdf or svg.")],
    kind: Annotated[
        str, typer.Option(help="Which figure: torques, postures, motion, overview, timeline or limits.")
    ] = "overview",
) -> None:
    """Draw a saved motion."""
    with interrupts.postponed():
        from brachis.cli import results  # noqa: PLC0415

    results.plot_command(result, out=out, kind=kind)


@app.command()
def report(
    result: ResultFile,
    out: Annotated[
        Path | None, typer.Option(help="HTML file to write; default: beside the result, as result.html.")
    ] = None,
    title: Annotated[str | None, typer.Option(help="Title of the page; default: the result's name.")] = None,
) -> None:
    """Write a saved motion as one HTML page to judge it by."""
    with interrupts.postponed():
        from brachis.cli import report as command  # noqa: PLC0415

    raise typer.Exit(command.report_command(result, out=out, title=title))


@app.command()
def view(
    result: Annotated[
        Path,
        typer.Argument(help="Result file (npz) written by 'brachis plan --out', or the folder.", metavar="RESULT"),
    ],
    host: Host = "127.0.0.1",
    port: Port = None,
    browser: Browser = True,
) -> None:
    """Show a saved motion in the browser.

    Robot, path, tool trace and ghost postures, with plots over the limits that follow a slider. Ctrl-C ends it.
    """
    with interrupts.postponed():
        from brachis.cli import viewing  # noqa: PLC0415

    viewing.view_command(result, host=host, port=port, browser=browser)


@app.command()
def inspect(
    source: Annotated[
        Path,
        typer.Argument(
            help="URDF file or name of a robot; or a task file: its robot with the limits and masses in use, and the "
            "points that its path follows.",
            metavar="URDF|TASK",
        ),
    ],
    task_space: Annotated[
        str | None,
        typer.Option(
            help="What the path prescribes: rows such as x,y or x,z,yaw, or position, pose or pose_free_roll. "
            "Default: the task's, or all that the robot can."
        ),
    ] = None,
    tool_frame: Annotated[str | None, typer.Option(help="Link at the chain's end.")] = None,
    base_frame: Annotated[str | None, typer.Option(help="Link at the chain's beginning.")] = None,
    posture: Annotated[
        str | None, typer.Option(help="Say where the tool is at these joint positions, for example '0, 0.3, 1.2'.")
    ] = None,
    lock: Annotated[list[str] | None, typer.Option(help="Joint held at a position: name=value, repeatable.")] = None,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Show a robot's joints and its closed forms.

    Limits, masses and friction of every joint, and which choices of redundant joints have a closed form.
    """
    with interrupts.postponed():
        from brachis.cli import inspection  # noqa: PLC0415

    inspection.inspect_command(
        source,
        changes or [],
        task_space=task_space,
        tool_frame=tool_frame,
        base_frame=base_frame,
        lock=lock or [],
        posture=posture,
        as_json=json,
    )


app.command(cls=VectorCommand)(compose)
app.command("import")(import_)
app.command()(compare)


@app.command()
def sweep(
    source: Annotated[Path, typer.Argument(help="Sweep file (YAML).", metavar="SWEEP")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for plans, table.parquet, table.csv and sweep.png; by default one in the current folder, "
            "named as the file. A sweep that was ended goes on where it was."
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(help="Processes; by default, and at most, as many as there are processors.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Plan on a cluster: address of a Dask scheduler, such as tcp://host:8786, or its scheduler file; ray, "
            "or ray://host:10001."
        ),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Plan stored failures again.")] = False,
    json: Json = False,
) -> None:
    """Plan a task many times, with its keys varied."""
    with interrupts.postponed():
        from brachis.cli import sweep as command  # noqa: PLC0415

    raise typer.Exit(command.sweep_command(source, out=out, jobs=jobs, scheduler=scheduler, retry=retry, as_json=json))


@app.command()
def schema(
    out: Annotated[Path | None, typer.Option(help="File to write instead of standard output.")] = None,
    of: Annotated[str, typer.Option(help="Of what: task files, or trajectory (exported as JSON).")] = "task",
) -> None:
    """Print the JSON schema of tasks, or of exported JSON."""
    with interrupts.postponed():
        from brachis.cli import results  # noqa: PLC0415

    results.schema_command(out, of)


def main() -> None:
    """Run the command line; no exception leaves it as a traceback."""
    open_streams()
    output = StandardOutput(sys.stdout)
    with redirect_stdout(cast(TextIO, output)):
        code = copy_context().run(partial(_run, output, as_json="--json" in sys.argv[1:]))
    sys.exit(code if output.finish() else 1)


def _run(output: StandardOutput, *, as_json: bool) -> int | str | None:
    """Run a command and return its exit code."""
    try:
        return cast("int | None", app(prog_name="brachis", standalone_mode=False)) or 0
    except SystemExit as stop:
        return stop.code
    except BrachisError as error:
        return print_failure(str(error), error.exit_code, as_json=as_json)
    except _UsageError as error:
        return print_usage_error(error, as_json=as_json)
    except Exception as error:  # noqa: BLE001  (whatever it is, it is told and not raised)
        if error is output.failure:
            return 1
        if chosen() is Verbosity.VERBOSE:
            traceback.print_exc()
        message = (
            f"internal error: {type(error).__name__}: {error}. This is a fault of brachis; "
            "run again with --verbose for the traceback and report it"
        )
        return print_failure(message, 1, as_json=as_json)
