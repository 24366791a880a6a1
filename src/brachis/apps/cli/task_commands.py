"""Commands on robots and tasks; each imports what it needs when it is called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brachis.apps.cli.app import Changes, Degrees, Strict, with_strict
from brachis.apps.cli.output import Json
from brachis.common import interrupts

TaskFile = Annotated[Path, typer.Argument(help="Task file (YAML).", metavar="TASK")]


def list_robots(json: Json = False) -> None:
    """List the robots that come with brachis."""
    with interrupts.postponed():
        from brachis.apps.cli import starting

    starting.robots_command(as_json=json)


def new(
    urdf: Annotated[
        Path,
        typer.Argument(
            help="URDF file, or the name of a robot that comes along.", metavar="URDF"
        ),
    ],
    out: Annotated[Path, typer.Option(help="Task file to write, a new one.")] = Path(
        "task.yaml"
    ),
    tool_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's end.")
    ] = None,
    base_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's beginning.")
    ] = None,
    json: Json = False,
) -> None:
    """Write a first task for a robot, with comments.

    It has a posture away from limits and singularities and a short line that can be reached from it, and it has been
    planned and verified.
    """
    with interrupts.postponed():
        from brachis.apps.cli import starting

    starting.new_command(
        urdf, out, tool_frame=tool_frame, base_frame=base_frame, as_json=json
    )


def plan(
    task: TaskFile,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for result.npz, result.json, overview.png and candidates.png (and fit.png, where the path was "
            "fitted to points); of a motion that fails the verification the names begin with unverified."
        ),
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option(help="URDF file to use instead of the task's.")
    ] = None,
    changes: Changes = None,
    view: Annotated[
        bool,
        typer.Option("--view", help="Show the motion in the browser, until Ctrl-C."),
    ] = False,
    strict: Strict = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Plan a task, verify the motion, and show what came out."""
    with interrupts.postponed():
        from brachis.apps.cli import planning

    raise typer.Exit(
        planning.plan_command(
            task,
            with_strict(changes, strict=strict),
            urdf=urdf,
            out=out,
            view=view,
            degrees=degrees,
            as_json=json,
        )
    )


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
    tool_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's end.")
    ] = None,
    base_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's beginning.")
    ] = None,
    posture: Annotated[
        str | None,
        typer.Option(
            help="Say where the tool is at these joint positions, for example '0, 0.3, 1.2'."
        ),
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(help="Joint held at a position: name=value, repeatable."),
    ] = None,
    degrees: Degrees = False,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Show a robot's joints and its closed forms.

    Limits, masses and friction of every joint, and which choices of redundant joints have a closed form.
    """
    with interrupts.postponed():
        from brachis.apps.cli import inspection

    inspection.inspect_command(
        source,
        changes or [],
        task_space=task_space,
        tool_frame=tool_frame,
        base_frame=base_frame,
        lock=lock or [],
        posture=posture,
        degrees=degrees,
        as_json=json,
    )


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
        int | None,
        typer.Option(
            help="Processes; by default, and at most, as many as there are processors."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Plan on a cluster: address of a Dask scheduler, such as tcp://host:8786, or its scheduler file."
        ),
    ] = None,
    retry: Annotated[
        bool, typer.Option("--retry", help="Plan stored failures again.")
    ] = False,
    json: Json = False,
) -> None:
    """Plan a task many times, with its keys varied."""
    with interrupts.postponed():
        from brachis.apps.cli import planning as command

    raise typer.Exit(
        command.sweep_command(
            source, out=out, jobs=jobs, scheduler=scheduler, retry=retry, as_json=json
        )
    )


def schema(
    out: Annotated[
        Path | None, typer.Option(help="File to write instead of standard output.")
    ] = None,
    of: Annotated[
        str, typer.Option(help="Of what: task files, or trajectory (exported as JSON).")
    ] = "task",
) -> None:
    """Print the JSON schema of tasks, or of exported JSON."""
    with interrupts.postponed():
        from brachis.apps.cli import motions

    motions.schema_command(out, of)
