"""``brachis verify | export | plot | report | view | schema``: use a saved motion."""

from __future__ import annotations

import json as json_library
import math
import os
import sys
import webbrowser
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

import brachis
from brachis.apps.cli.app import (
    Degrees,
    Json,
    Verbosity,
    get_verbosity,
    motion_file,
    urdf_of,
)
from brachis.apps.cli.folder import (
    check_output,
    draw,
    end_cleanly,
    write_one,
    write_text,
)
from brachis.apps.cli.output import (
    WRITING,
    json_text,
    print_error,
    print_json,
    print_lines,
    print_verification,
    show_progress,
)
from brachis.common import interrupts
from brachis.common.files import read_file
from brachis.errors import UnknownNameError

if TYPE_CHECKING:
    from brachis.apps.view import Viewer

ResultFile = Annotated[
    Path,
    Argument(
        help="Result file (npz) of 'brachis plan --out', or its folder.",
        metavar="RESULT",
    ),
]


def verify(
    result: ResultFile,
    urdf: Annotated[
        Path | None,
        Option(
            help="Check against this URDF, or included robot, instead of the saved one."
        ),
    ] = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Check a saved motion again: path, limits, ends."""
    from brachis.robot.from_task import robot_from_settings

    _, trajectory = _load(result)
    settings = trajectory.task.robot
    robot = robot_from_settings(settings, urdf=urdf_of(urdf)) if urdf else None
    verification = brachis.verify_trajectory(trajectory, robot=robot)
    if json:
        print_json(verification.to_dict())
    else:
        print_verification(verification, degrees=degrees)
    raise typer.Exit(0 if verification.passed else 1)


def export(
    result: ResultFile,
    out: Annotated[
        Path,
        Option(
            help="File to write. Its suffix sets the format: .csv and .parquet (t, then q_, qd_, qdd_, tau_ of every "
            "joint; SI units), .json, .yaml and .mcap (ROS 2's JointTrajectory), .script (URScript), .gif and .mp4."
        ),
    ],
    form: Annotated[
        str | None,
        Option(
            "--format",
            help="Name of the format: csv, parquet, json, ros2, mcap, urscript, gif or mp4.",
        ),
    ] = None,
    dt: Annotated[
        float | None,
        Option(
            help="Sampling period, s. Default: 0.001; 0.01 for ROS 2, 0.002 for URScript, 0.04 for animations."
        ),
    ] = None,
    last: Annotated[
        str | None,
        Option(
            help="Time of the last sample. exact: the end time, even if it is not a multiple of the period. hold: the "
            "next multiple of the period; the end posture is held until then. Default: exact; hold for URScript."
        ),
    ] = None,
    joints: Annotated[
        str | None,
        Option(help="Joints to write, in this order: j1,j2,... Default: all."),
    ] = None,
    slower: Annotated[
        float, Option(help="How many times slower an animation shows the motion.")
    ] = 1.0,
) -> None:
    """Sample a saved motion for a controller, or animate it."""
    formats = brachis.export
    result, trajectory = _load(result)
    settings = formats.format_of(out, form)
    names = None if joints is None else [name.strip() for name in joints.split(",")]

    write = partial(
        formats.write,
        trajectory,
        form=form,
        dt=dt,
        last=last,
        joints=names,
        slower=slower,
    )
    write_one(out, write, (settings.suffix,), _inputs(result, trajectory))
    period = settings.dt if dt is None else dt
    if period > trajectory.t_end:
        print_error(
            f"the period of {period:g} s is longer than the motion, which takes {trajectory.t_end:.6g} s"
        )
    print_lines(f"wrote {out}")


def plot(
    result: ResultFile,
    out: Annotated[Path, Option(help="Figure to write: png, pdf or svg.")],
    kind: Annotated[
        str,
        Option(
            help="Figure to draw: torques, postures, motion, overview, timeline, limits or fit."
        ),
    ] = "overview",
) -> None:
    """Draw a saved motion."""
    from brachis.apps.plots import SUFFIXES, check_suffix

    plots = brachis.plots
    if kind not in plots.PLOTS:
        raise UnknownNameError("figure", kind, plots.PLOTS, where="--kind")
    check_suffix(out)
    result, trajectory = _load(result)

    write = partial(draw, partial(plots.PLOTS[kind], trajectory))
    suffixes = [f".{suffix}" for suffix in SUFFIXES]
    with show_progress(WRITING) as listener:
        listener(f"drawing {out}")
        write_one(out, write, suffixes, _inputs(result, trajectory))
    print_lines(f"wrote {out}")


def report(
    result: ResultFile,
    out: Annotated[
        Path | None,
        Option(help="HTML file to write. Default: result.html next to the result."),
    ] = None,
    title: Annotated[
        str | None,
        Option(help="Title of the page. Default: the names of the robot and the file."),
    ] = None,
    degrees: Degrees = False,
) -> None:
    """Write a report of a saved motion as one HTML page."""
    from brachis.apps.report import check_report_name

    if out is not None:
        check_report_name(out)
    result, trajectory = _load(result)
    out = out or result.with_suffix(".html")
    check_output(out, (".html",), _inputs(result, trajectory))
    if title is None:
        title = ", ".join(filter(None, (trajectory.robot.name, result.name)))
    with show_progress(WRITING) as listener:
        listener(f"drawing {out}")
        page = brachis.report.make_report(trajectory, title=title, degrees=degrees)
        with end_cleanly():
            page.save(out)
    print_lines(f"wrote {out} ({1e-6 * page.size:.1f} MB)")
    if not page.verified:
        print_error(
            "the motion did not pass the verification; the report lists the checks that failed"
        )
    raise typer.Exit(0 if page.verified else 1)


def _load(result: Path) -> tuple[Path, brachis.Trajectory]:
    """Load a motion from its file or folder; returns the file too."""
    result = motion_file(result)
    return result, brachis.Trajectory.load(result)


def _inputs(result: Path, trajectory: brachis.Trajectory) -> list[Path]:
    """Return the files that nothing made of a motion may overwrite: the motion's and its URDF."""
    urdf = trajectory.task.robot.urdf
    return [result, Path(urdf)] if urdf else [result]


def view(
    result: ResultFile,
    host: Annotated[
        str,
        Option(
            help="Address that the viewer listens on; 0.0.0.0 lets other machines look.",
            metavar="ADDRESS",
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        Option(
            help="Port of the viewer; 0 for any free one. Default: the first free one from 8080 on."
        ),
    ] = None,
    browser: Annotated[
        bool,
        Option(
            "--browser/--no-browser",
            help="Open the browser if there is a screen and a terminal.",
        ),
    ] = True,
    degrees: Degrees = False,
) -> None:
    """Show a saved motion in the browser.

    It shows robot, path, tool trace and ghost postures, and plots of the limits with a time slider. Ctrl-C ends it.
    """
    from brachis.apps.view import Viewer

    path, trajectory = _load(result)
    viewer = Viewer(
        trajectory,
        _read_candidates(path, trajectory),
        verified=brachis.verify_trajectory(trajectory).passed,
        degrees=degrees,
        host=host,
        port=port,
    )
    if not viewer.local:
        print_error(
            f"warning: anyone who can reach {host} can watch and move the slider; leave out --host to prevent this"
        )
    show(viewer, browser=browser)


def show(viewer: Viewer, *, browser: bool = True) -> None:
    """Show a motion until Ctrl-C; open the browser if it is wanted and there is a screen."""
    with viewer, interrupts.end_on_interrupt():
        if get_verbosity() is not Verbosity.QUIET:
            print_error("Ctrl-C stops the viewer")
        typer.echo(f"look at {viewer.url}")  # what the command is for, however quiet
        has_screen = (
            sys.platform == "darwin"
            or os.environ.get("DISPLAY")
            or os.environ.get("WAYLAND_DISPLAY")
        )
        if browser and sys.stdout.isatty() and has_screen:
            webbrowser.open(viewer.url)
        viewer.wait()


def _read_candidates(
    path: Path, trajectory: brachis.Trajectory
) -> list[dict[str, Any]]:
    """Read the candidates of a motion's search from the JSON written with it; an empty list if it is another's."""
    try:
        data = json_library.loads(read_file(path.with_suffix(".json"), 64_000_000))
        same = math.isclose(data["t_end"], trajectory.t_end, rel_tol=1e-12)
        return [dict(each) for each in data["candidates"]] if same else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def schema(
    out: Annotated[
        Path | None, Option(help="File to write instead of standard output.")
    ] = None,
    of: Annotated[
        str,
        Option(
            help="Which schema: task (task files) or trajectory (motions exported as JSON)."
        ),
    ] = "task",
) -> None:
    """Print the JSON schema of tasks, or of exported JSON."""
    from brachis.apps.export import samples_schema
    from brachis.task import json_schema

    schemas = {"task": json_schema, "trajectory": samples_schema}
    if of not in schemas:
        raise UnknownNameError("schema", of, schemas, where="--of")
    data = schemas[of]()
    if out is None:
        print_json(data)
    else:
        write_one(out, partial(write_text, json_text(data)), (".json",))
        print_lines(f"wrote {out}")
