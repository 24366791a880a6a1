"""``brachis plan | bottleneck | place | sweep``.

Plan a task, find out what slows the motion down, move the workpiece or the base, plan a task many times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

import brachis
from brachis.apps.cli.app import (
    Changes,
    Degrees,
    Json,
    load_changed_task,
    motion_file,
    read_changes,
    refuse_options,
)
from brachis.apps.cli.folder import (
    Drawing,
    Writer,
    check_new,
    draw,
    end_cleanly,
    exit_code,
    finish,
    output_folder,
    write_files,
    write_text,
)
from brachis.apps.cli.motions import show
from brachis.apps.cli.output import (
    print_json,
    print_lines,
    print_run,
    print_segments,
    print_table,
    print_verification,
    show_progress,
    write_posture,
)
from brachis.common.progress import Listener
from brachis.common.words import write_count

if TYPE_CHECKING:
    from brachis.apps.controller import RunReport

_PLANNED = ("result.npz", "result.json", "overview.png", "candidates.png", "fit.png")
_BOTTLENECK = ("bottleneck.json", "timeline.png")


def plan(
    task: Annotated[Path, Argument(metavar="TASK")],
    out: Path | None = None,
    urdf: Path | None = None,
    changes: Changes = None,
    view: Annotated[bool, Option("--view")] = False,
    profile: str | None = None,
    strict: bool | None = None,
    figures: bool = True,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Plan a task, verify the motion, and print the result.

    Parameters
    ----------
    task : path
        Task file (YAML).
    out : path, optional
        Output folder for result.npz, result.json, overview.png and candidates.png, and for fit.png if the path was
        fitted to points. If the verification fails, the file names begin with unverified.
    view : bool, optional
        Show the motion in the browser until Ctrl-C is pressed.
    profile : str, optional
        Controller that will run the motion; see brachis export. The limits of the controller are added to those of the
        task, and the motion is planned so that it passes the verification as the controller runs it.

    Examples
    --------
    brachis plan task.yaml --out out
    brachis plan task.yaml --set search.effort=single --set 'path.0.line.by=[0, 0.4]'
    """
    from brachis.apps.view import Viewer, require_viser

    if view:
        require_viser()
    with output_folder(out, _PLANNED, (task, urdf)), show_progress() as listener:
        result, run = _plan_task(task, urdf, changes, strict, listener, profile)
    plots = brachis.plots
    trajectory = result.trajectory
    data = {**result.to_dict(), "verification": result.verification.to_dict()}
    if run is not None:
        data["run"] = run.to_dict()
    drawings: dict[str, Drawing] = {
        "overview.png": lambda: plots.plot_overview(trajectory),
        "candidates.png": lambda: plots.plot_candidates(result.candidates),
    }
    if any(report.profile for report in result.fits):
        drawings["fit.png"] = lambda: plots.plot_fit(trajectory)
    code = finish(
        data,
        {"result.npz": result.save},
        drawings if figures else {},
        out=out,
        names=_PLANNED,
        verified=result.verified,
        json=json,
        show=lambda: _print_plan(result, data, degrees=degrees),
        result=result,
    )
    if run is not None:
        code = max(code, 0 if run.passed else 1)
        if not json:
            print_run(run, json=False)
    if view:
        shown = data["candidates"]
        show(Viewer(trajectory, shown, verified=result.verified, degrees=degrees))
    raise typer.Exit(code)


def _plan_task(
    task: Path,
    urdf: Path | None,
    changes: Sequence[str] | None,
    strict: bool | None,
    listener: Listener,
    profile: str | None = None,
) -> tuple[brachis.Result, RunReport | None]:
    """Load a task and plan it, for a controller if there is a profile."""
    from brachis.task import name_task_file

    keys = read_changes(changes, strict=strict)
    changed = load_changed_task(task, keys)
    # If a URDF is given, the robot is not that of the task file.
    with name_task_file(None if urdf else task, keys):
        robot = urdf and str(urdf)
        if profile is None:
            return brachis.plan(robot, changed, listener=listener), None
        plan_for = brachis.plan_for_controller
        return plan_for(profile, robot, changed, listener=listener)


def _print_plan(result: brachis.Result, data: dict[str, Any], *, degrees: bool) -> None:
    """Print the plan as text for a person."""
    from brachis.search.candidate_table import STATUS, TIMES, WORDS, candidate_rows
    from brachis.trajectory import phase_table

    candidate = result.candidate
    trajectory = result.trajectory
    solves = write_count(len(candidate.reports), "solve")
    rows = {
        **result.summary(),
        **({} if result.family == trajectory.branch else {"family": result.family}),
        "start posture": write_posture(data, "start_posture", degrees=degrees),
        "end posture": write_posture(data, "end_posture", degrees=degrees),
        **data["in_use"],
        "solver": f"{result.solver_report.solver}, {result.solver_report.status.value}",
        "iterations": f"{data['iterations']} in {solves} (refined to {data['collocation_points']} collocation points)",
        "least motion": result.smoothing,
    }
    if candidate.time_scaled > 1.0:
        rows["end time lengthened by"] = (
            f"{100.0 * (candidate.time_scaled - 1.0):.2g} % to meet the limits between collocation points"
        )
    print_table("plan", ("", ""), rows.items())
    title, columns, phases = phase_table(trajectory)
    if len(phases) > 1:
        print_table(title, columns, phases)
        print_segments(candidate.problem.path)
    print_lines(*(f"path from {fit}" for fit in result.fits))
    tried = len(result.candidates)
    if tried > 1:
        listed = candidate_rows(data["candidates"])[:40]
        count = str(tried)
        if tried > len(listed):
            count += f", {tried - len(listed)} of them in the JSON only"
        columns = (*WORDS, *TIMES, STATUS)
        print_table(f"candidates ({count})", columns, listed, numbers=TIMES)
    print_verification(result.verification, degrees=degrees)


def bottleneck(
    task: Annotated[Path, Argument(metavar="TASK|RESULT")],
    check: Annotated[bool, Option("--check")] = False,
    reference: Annotated[bool, Option("--reference")] = False,
    out: Path | None = None,
    urdf: Path | None = None,
    changes: Changes = None,
    strict: bool | None = None,
    figures: bool = True,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Report which limits cost time.

    The report says how much time each limit costs, and when the limit is active. If a task is given, it is planned
    first; a saved motion is used as it is.

    Parameters
    ----------
    task : path
        Task file (YAML), or result file (npz) of a saved motion.
    check : bool, optional
        Solve again with each limit raised by 1 %, and compare the result with the prediction.
    reference : bool, optional
        Compare with a reference: the same problem on a fine mesh, with torque that may jump. The reference is the best
        end time known, not a proven bound. Computing it takes some seconds.
    out : path, optional
        Output folder for bottleneck.json and timeline.png. If the verification fails, the file names begin with
        unverified_.

    Examples
    --------
    brachis bottleneck task.yaml --set search.effort=single
    """
    from brachis.search.planned import describe_motion

    result = None
    with output_folder(out, _BOTTLENECK, (task, urdf)), show_progress() as listener:
        source = motion_file(task)
        if source.suffix.lower() == ".npz":
            options = {"--urdf": urdf, "--set": changes, "--strict": strict}
            refuse_options(options, "a saved motion", "a task file")
            trajectory = brachis.Trajectory.load(source)
            verification = brachis.verify_trajectory(trajectory)
            data = describe_motion(trajectory, verification)
        else:
            result, _ = _plan_task(task, urdf, changes, strict, listener)
            trajectory = result.trajectory
            data = result.to_dict()
        report = brachis.bottleneck.report(
            result or trajectory, check=check, reference=reference, listener=listener
        )
    data["bottleneck"] = report.to_dict()
    head = f"end time t_E: {trajectory.t_end:.4f} s, redundant joints: {trajectory.redundancy}"
    drawings: dict[str, Drawing] = {
        "timeline.png": lambda: brachis.plots.plot_timeline(trajectory)
    }
    code = finish(
        data,
        {},
        drawings if figures else {},
        out=out,
        names=_BOTTLENECK,
        verified=data["verified"],
        json=json,
        show=partial(print_lines, head, report.text(degrees=degrees)),
        result=result,
        complaint="its bottlenecks may be wrong",
    )
    raise typer.Exit(code)


def place(
    task: Annotated[Path, Argument(metavar="TASK")],
    move: str = "workpiece",
    ranges: Annotated[
        list[str] | None, Option("--range", metavar="NAME=FROM,TO")
    ] = None,
    starts: int = 4,
    steps: int = 8,
    jobs: int = 1,
    gradients: Annotated[bool, Option("--gradients")] = False,
    out: Path | None = None,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Move a workpiece or the base to where the motion is faster.

    Parameters
    ----------
    task : path
        Task file (YAML).
    move : str, optional
        Name of a frame of the task, base, or workpiece for the frame of all paths. Bodies in the frame move with it.
    ranges : list of str
        Smallest and largest change of a coordinate: x, y or z along the axes of the world, m, or roll_deg, pitch_deg or
        yaw_deg about them, degrees. The option can be repeated.
    starts : int, optional
        Number of places that are tried first.
    steps : int, optional
        Maximum number of steps from each of the best two places.
    jobs : int, optional
        Number of processes for the first places.
    gradients : bool, optional
        Only plan the task, and print the derivatives of the end time with respect to all placements, the payload and
        the process speeds.
    out : path, optional
        File for the changed task. The file must not exist yet.

    Examples
    --------
    brachis place cell.yaml --gradients
    brachis place cell.yaml --range x=-0.2,0.2 --range yaw_deg=-30,30 --out moved.yaml
    brachis place cell.yaml --move base --range z=0,0.4
    """
    from brachis.apps.place import read_range, write_end_time, write_task

    check_new(out)
    if gradients:
        options = {"--out": out, "--range": ranges}
        refuse_options(options, "--gradients", "a search for a faster place")
    limits = dict(read_range(text) for text in ranges or ())
    with end_cleanly(), show_progress() as listener:
        if gradients:
            after, _ = _plan_task(task, None, changes, None, listener)
            data: dict[str, Any] = {"t_end": after.t_end, "verified": after.verified}
        else:
            loaded = load_changed_task(task, read_changes(changes))
            placing = brachis.place(
                loaded,
                move=move,
                ranges=limits,
                starts=starts,
                steps=steps,
                jobs=jobs,
                listener=listener,
            )
            after = placing.after
            data = placing.to_dict()
    entries = after.gradients
    data["gradients"] = [asdict(entry) for entry in entries]
    if out is not None and not gradients:
        write_text(write_task(placing.task), out)
    if json:
        print_json(data)
    else:
        if gradients:
            print_lines(f"end time t_E: {write_end_time(after)}")
        else:
            print_table("placement", ("", ""), placing.summary().items())
        rows = [entry.row for entry in entries]
        print_table("gradients", ("what", "change", "derivative of t_E"), rows)
        if out is not None:
            print_lines(f"wrote {out}")
    raise typer.Exit(0 if after.verified else 1)


def sweep(
    source: Annotated[Path, Argument(metavar="SWEEP")],
    out: Path | None = None,
    jobs: int | None = None,
    part: str | None = None,
    merge: Annotated[bool, Option("--merge")] = False,
    retry: Annotated[bool, Option("--retry")] = False,
    json: Json = False,
) -> None:
    """Plan a task many times with different values of its keys.

    Parameters
    ----------
    source : path
        Sweep file (YAML).
    out : path, optional
        Output folder for the plans, table.parquet, table.csv and sweep.png. Default: a folder in the current folder,
        with the name of the sweep file. An interrupted sweep continues in its folder with the missing plans.
    jobs : int, optional
        Number of processes. Default and maximum: the number of processors.
    part : str, optional
        Plan only part i of n, for example 2/8. On a cluster, each job of an array plans one part; all jobs use the same
        folder.
    merge : bool, optional
        Plan nothing, but collect the plans of all parts in table.parquet and table.csv. If a plan is missing, this
        gives an error.
    retry : bool, optional
        Run the failed plans again.

    Examples
    --------
    brachis sweep lines.yaml --jobs 2
    brachis sweep lines.yaml --retry  # continues a sweep, plans failures again
    brachis sweep lines.yaml --part 1/2  # the first of two jobs on a cluster
    brachis sweep lines.yaml --merge  # after all jobs
    """
    from brachis.apps.sweeps.plans import VERIFIED

    with end_cleanly(), show_progress() as listener:
        result = brachis.sweep(
            source,
            out,
            jobs=jobs,
            part=part,
            merge=merge,
            retry=retry,
            listener=listener,
        )
        verified = result.count(VERIFIED) > 0
        figures: dict[str, Writer] = {}
        if result.varied and verified and part is None:
            figures["sweep.png"] = partial(draw, result.plot)
        drawn, failures = write_files(
            result.folder, {}, figures, listener=listener, stale=("sweep.png",)
        )
    files = [*map(str, result.files), *drawn]
    if json:
        print_json({**result.summary(), "keys": list(result.keys), "files": files})
    else:
        _print_sweep(result, files)
    raise typer.Exit(exit_code(verified, failures))


def _print_sweep(result: brachis.SweepResult, files: Sequence[str]) -> None:
    """Print the result of a sweep as text for a person."""
    from brachis.common.summary import show_value

    summary = result.summary()
    failures = summary.pop("failures")
    rows = []
    for name, value in summary.items():
        if isinstance(value, dict):
            entries = (f"{key}: {show_value(entry)}" for key, entry in value.items())
            rows.append((name, ", ".join(entries)))
        else:
            rows.append((name, show_value(value)))
    print_table("sweep", ("", ""), rows)
    for error, cause in failures.items():
        print_lines(
            f"{cause['plans']} failed with {error}, for example: {cause['message']}"
        )
    print_lines(*(f"wrote {name}" for name in files))
