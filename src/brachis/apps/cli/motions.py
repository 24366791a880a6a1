"""``brachis verify | export | plot | report | view | schema``: use a saved motion."""

from __future__ import annotations

import json as json_library
import math
import os
import sys
import warnings
import webbrowser
from collections.abc import Sequence
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
    refuse_options,
    urdf_of,
)
from brachis.apps.cli.folder import (
    Writer,
    check_output,
    draw,
    end_cleanly,
    write_one,
    write_text,
)
from brachis.apps.cli.output import (
    json_text,
    print_error,
    print_json,
    print_lines,
    print_run,
    print_verification,
    show_progress,
)
from brachis.common import interrupts
from brachis.common.files import BEGINNINGS, read_file
from brachis.errors import check_names

if TYPE_CHECKING:
    from brachis.apps.view import Viewer

ResultFile = Annotated[Path, Argument(metavar="RESULT")]


def verify(
    result: ResultFile,
    urdf: Path | None = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Check a saved motion again: path, limits, ends.

    Parameters
    ----------
    urdf : path, optional
        URDF file, or name of an included robot, to check against instead of the saved URDF.

    Examples
    --------
    brachis verify out/result.npz
    """
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
    out: Annotated[Path, Option()],
    form: Annotated[str | None, Option("--format")] = None,
    dt: float | None = None,
    last: str | None = None,
    joints: str | None = None,
    slower: float = 1.0,
    degrees: Annotated[bool, Option("--degrees")] = False,
    mm: Annotated[bool, Option("--mm")] = False,
    profile: str | None = None,
    moves: str = "joint",
    tolerance: float = 1e-3,
    time_tolerance: float = 0.01,
    json: Json = False,
) -> None:
    """Sample a saved motion for a controller, or animate the motion.

    Parameters
    ----------
    out : path
        File to write. The suffix of the file sets the format: .csv and .parquet (t, then q_, qd_, qdd_, tau_ of every
        joint; SI units), .json, .yaml and .mcap (JointTrajectory of ROS 2), .script (URScript), .gif and .mp4.
    form : str, optional
        Name of the format: csv, parquet, json, ros2, mcap, urscript, gif or mp4.
    dt : float, optional
        Sampling period, s. Default: 0.001; 0.01 for ROS 2, 0.002 for URScript, 0.04 for animations.
    last : str, optional
        Time of the last sample. exact: the end time, even if it is not a multiple of the period. hold: the next
        multiple of the period, with the end posture held until then. Default: exact, or hold for URScript.
    joints : str, optional
        Joints to write, in this order: j1,j2,... Default: all.
    slower : float, optional
        Factor by which an animation shows the motion slower.
    degrees : bool, optional
        Write angles in degrees.
    mm : bool, optional
        Write lengths in mm.
    profile : str, optional
        Controller for which the file is written: ros2_control, franka_1khz, ur_servoj_500hz, kuka_rsi_4ms, abb_egm_4ms,
        fanuc_stream_8ms, staubli_val3, or a YAML file of your own. The profile sets axes, units and period, and the
        motion is verified as the controller runs it. With the suffix of the controller's programs, such as .src, a
        program of positions is written.
    moves : str, optional
        Kind of moves in programs of positions: joint or linear.
    tolerance : float, optional
        Maximum distance of the tool from the path in programs, m and rad.
    time_tolerance : float, optional
        Maximum difference in time in programs, s.

    Examples
    --------
    brachis export out/result.npz --out out/run.csv --profile kuka_rsi_4ms
    brachis export out/result.npz --out out/motion.csv --dt 0.004
    brachis export out/result.npz --out out/motion.gif --dt 0.1
    """
    formats = brachis.export
    result, trajectory = _load(result)
    if profile is not None:
        stated: dict[str, object] = {"--joints": joints, "--last": last}
        stated |= {"--degrees": degrees or None, "--mm": mm or None}
        stated["--slower"] = slower if slower != 1.0 else None
        refuse_options(stated, "a profile", "files without one")
        write_run = partial(
            formats.write_for_controller,
            trajectory,
            profile=profile,
            form=form,
            dt=dt,
            moves=moves,
            tolerance=tolerance,
            time_tolerance=time_tolerance,
        )
        _export_run(out, write_run, _inputs(result, trajectory), json=json)
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
        degrees=degrees,
        mm=mm,
    )
    write_one(out, write, _inputs(result, trajectory))
    period = settings.dt if dt is None else dt
    if period > trajectory.t_end:
        print_error(
            f"the period of {period:g} s is longer than the motion, which takes {trajectory.t_end:.6g} s"
        )
    print_lines(f"wrote {out}")


def _export_run(
    out: Path, write: Writer, inputs: Sequence[Path], *, json: bool
) -> None:
    """Write a file for a controller, and print what the controller makes of the motion."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", brachis.export.RunWarning)  # printed below
        report = write_one(out, write, inputs)
    code = print_run(report, json=json)
    if not json:
        print_lines(f"wrote {out}")
    raise typer.Exit(code)


def plot(
    result: ResultFile,
    out: Annotated[Path, Option()],
    kind: str = "overview",
) -> None:
    """Draw a saved motion.

    Parameters
    ----------
    out : path
        Figure to write: png, pdf or svg.
    kind : str, optional
        Figure to draw: torques, postures, motion, overview, timeline, limits or fit.

    Examples
    --------
    brachis plot out/result.npz --kind torques --out out/torques.svg
    """
    from brachis.apps.plots import check_suffix

    plots = brachis.plots
    check_names("figure", [kind], plots.PLOTS, "--kind")
    check_suffix(out)
    result, trajectory = _load(result)

    write = partial(draw, partial(plots.PLOTS[kind], trajectory))
    with show_progress() as listener:
        listener(f"drawing {out}")
        write_one(out, write, _inputs(result, trajectory))
    print_lines(f"wrote {out}")


def report(
    result: ResultFile,
    out: Path | None = None,
    title: str | None = None,
    degrees: Degrees = False,
) -> None:
    """Write a report of a saved motion as one HTML page.

    Parameters
    ----------
    out : path, optional
        HTML file to write. Default: result.html next to the result.
    title : str, optional
        Title of the page. Default: the names of the robot and the file.

    Examples
    --------
    brachis report out/result.npz
    brachis report out/result.npz --title 'cell 3' --out out/cell3.html
    """
    from brachis.apps.report import check_report_name

    if out is not None:
        check_report_name(out)
    result, trajectory = _load(result)
    out = out or result.with_suffix(".html")
    check_output(out, _inputs(result, trajectory), BEGINNINGS[".html"])
    if title is None:
        title = ", ".join(filter(None, (trajectory.robot.name, result.name)))
    with show_progress() as listener:
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
    """Load a motion from its file or folder; return the file as well."""
    result = motion_file(result)
    return result, brachis.Trajectory.load(result)


def _inputs(result: Path, trajectory: brachis.Trajectory) -> list[Path]:
    """Return the files that no output made from a motion may overwrite: its own file and its URDF."""
    urdf = trajectory.task.robot.urdf
    return [result, Path(urdf)] if urdf else [result]


def view(
    result: ResultFile,
    host: Annotated[str, Option(metavar="ADDRESS")] = "127.0.0.1",
    port: int | None = None,
    browser: bool = True,
    degrees: Degrees = False,
) -> None:
    """Show a saved motion in the browser.

    The viewer shows the robot, the path, the tool trace and ghost postures, and plots of the limits with a time slider.
    Ctrl-C ends the viewer.

    Parameters
    ----------
    host : str, optional
        Address that the viewer listens on; with 0.0.0.0, other machines can connect.
    port : int, optional
        Port of the viewer; 0 chooses any free port. Default: the first free port from 8080 on.
    browser : bool, optional
        Open the browser if there is a screen and a terminal.

    Examples
    --------
    brachis view out
    brachis view out/result.npz --port 0 --no-browser
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
    """Show a motion until Ctrl-C; open the browser if this is wanted and there is a screen."""
    with viewer, interrupts.end_on_interrupt():
        if get_verbosity() is not Verbosity.QUIET:
            print_error("Ctrl-C stops the viewer")
        typer.echo(f"look at {viewer.url}")  # even if quiet
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
    """Read the candidates of a motion's search from the JSON file beside it; none if it belongs to another motion."""
    try:
        data = json_library.loads(read_file(path.with_suffix(".json"), 64_000_000))
        same = math.isclose(data["t_end"], trajectory.t_end, rel_tol=1e-12)
        return [dict(candidate) for candidate in data["candidates"]] if same else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def schema(
    out: Path | None = None,
    of: str = "task",
) -> None:
    """Print the JSON schema of tasks, or of exported JSON.

    Parameters
    ----------
    out : path, optional
        File to write instead of standard output.
    of : str, optional
        Which schema: task (task files) or trajectory (motions exported as JSON).

    Examples
    --------
    brachis schema --out task.schema.json
    brachis schema --of trajectory
    """
    from brachis.apps.export import samples_schema
    from brachis.task import json_schema

    schemas = {"task": json_schema, "trajectory": samples_schema}
    check_names("schema", [of], schemas, "--of")
    data = schemas[of]()
    if out is None:
        print_json(data)
    else:
        write = partial(write_text, json_text(data))
        write_one(out, write, beginning=BEGINNINGS[".json"])
        print_lines(f"wrote {out}")
