"""``brachis plan | bottleneck``: plan a task, show the motion and what holds it back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brachis.apps.cli.app import Changes, Degrees, Strict
from brachis.apps.cli.folder import (
    Writer,
    Written,
    make_folder,
    write_files,
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
from brachis.errors import InputError, write_count

if TYPE_CHECKING:
    from brachis.result import Result
    from brachis.trajectory import Trajectory

_PLANNED = {
    True: ("result.npz", "result.json", "overview.png", "candidates.png", "fit.png"),
    False: (
        "unverified.npz",
        "unverified.json",
        "unverified.png",
        "unverified_candidates.png",
        "unverified_fit.png",
    ),
}
"""Files of a plan: trajectory, figures of merit, drawings of motion, search and fit; by whether it was verified."""
_BOTTLENECK = {
    True: ("bottleneck.json", "timeline.png"),
    False: ("unverified_bottleneck.json", "unverified_timeline.png"),
}
"""Files of a bottleneck report: figures and drawing; by whether the motion was verified."""
_MANY = 40
"""Candidates that are listed on the screen."""

Urdf = Annotated[
    Path | None, typer.Option(help="URDF file to use instead of the task's.")
]


def plan(
    task: Annotated[Path, typer.Argument(help="Task file (YAML).", metavar="TASK")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for result.npz, result.json, overview.png and candidates.png (and fit.png, where the path was "
            "fitted to points); of a motion that fails the verification the names begin with unverified."
        ),
    ] = None,
    urdf: Urdf = None,
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
    with interrupts.defer():
        from brachis import planner
        from brachis.apps.cli.motions import show
        from brachis.apps.cli.settings import changed_task, urdf_of
        from brachis.apps.view import require_viser
    if view:
        require_viser()
    if out is not None:
        make_folder(out, (*_PLANNED[True], *_PLANNED[False]), (task, urdf))
    with shown_warnings(), progress() as listener:
        result = planner.plan(
            urdf and urdf_of(urdf),
            changed_task(task, changes, strict=strict),
            listener=listener,
        )
    data = {**result.to_dict(), "verification": result.verification.to_dict()}
    failures: tuple[InputError, ...] = ()
    if out is not None:
        written = _write_plan(result, data, out)
        failures = written.failures
        data["files"] = list(written.files)
    if json:
        print_json(data)
    else:
        _print_plan(result, data, degrees=degrees)
    print_what_was_left(result.not_completed, interrupted=result.interrupted)
    if not result.verified:
        print_error(
            "the motion found did not pass the verification; it is marked unverified"
        )
    if view:
        show(
            result.trajectory,
            data["candidates"],
            verified=result.verified,
            degrees=degrees,
        )
    raise typer.Exit(exit_code(result.verified, failures))


def _write_plan(result: Result, data: dict[str, object], out: Path) -> Written:
    """Write trajectory, figures of merit and drawings, and remove those of an earlier plan with the other names."""
    from brachis.apps.plots import plot_candidates, plot_fit, plot_overview, save_figure

    names = _PLANNED[result.verified]
    trajectory, figures_of_merit, overview, candidates, fit = names
    results: dict[str, Writer] = {
        trajectory: result.trajectory.save,
        figures_of_merit: lambda path: write_text(json_text(data), path),
    }
    figures: dict[str, Writer] = {
        overview: lambda path: save_figure(plot_overview(result.trajectory), path),
        candidates: lambda path: save_figure(plot_candidates(result.candidates), path),
    }
    if any(report.profile for report in result.fits):
        figures[fit] = lambda path: save_figure(plot_fit(result.trajectory), path)
    stale = (*_PLANNED[not result.verified], fit)
    return write_files(out, results, figures, stale=stale)


def _print_plan(result: Result, data: dict[str, Any], *, degrees: bool) -> None:
    """Print the plan for a person."""
    from brachis.optimise.candidate import coordinates

    console = result_console()
    candidate = result.candidate
    trajectory = result.trajectory
    iterations = sum(report.iterations for report in candidate.reports)
    named = trajectory.branch not in {"", result.family}
    rows = {
        "end time t_E": f"{result.t_end:.4f} s",
        "redundant joints": coordinates(trajectory.redundant_joints, trajectory.branch),
        "branch": f"{trajectory.branch} ({result.family})" if named else result.family,
        "start posture": _posture(data, "start_posture", degrees=degrees),
        "end posture": _posture(data, "end_posture", degrees=degrees),
        **data["in_use"],
        "solver": f"{result.solver_report.solver}, {result.solver_report.status.value}",
        "iterations": f"{iterations} in {write_count(len(candidate.reports), 'solve')} "
        f"(refined to {candidate.collocation_points} collocation points)",
        "wall time": f"{1e3 * result.timing['total']:.0f} ms",
        "least motion": "off"
        if result.least_motion is None
        else result.least_motion.status,
        "worst ratio to a limit": f"{result.verification.worst_ratio:.6f}",
        "path error": f"{result.verification.path_error:.1e} m or rad",
        "verified": "yes" if result.verified else "NO",
    }
    if candidate.time_scaled > 1.0:
        share = 100.0 * (candidate.time_scaled - 1.0)
        rows["end time lengthened by"] = (
            f"{share:.2g} % to meet the limits between collocation points"
        )
    print_table(console, "plan", ("", ""), rows.items(), header=False)
    for fit in result.fits:
        console.print(f"path from {fit}")
    if len(data["candidates"]) > 1:
        _print_candidates(data["candidates"])
    print_verification(console, result.verification, degrees=degrees)
    for name in data.get("files", []):
        console.print(f"wrote {name}")


def _posture(data: dict[str, Any], key: str, *, degrees: bool) -> str:
    """Write a posture with names and units."""
    from brachis.robot.joints import shown_unit

    parts = []
    for name, value, si_unit in zip(
        data["joint_names"], data[key], data["position_units"], strict=True
    ):
        unit, factor = shown_unit(si_unit, degrees=degrees)
        parts.append(f"{name} {factor * value:.4f} {unit}")
    return ", ".join(parts)


def _print_candidates(candidates: Sequence[Mapping[str, Any]]) -> None:
    """Print what the search looked at, one candidate a row, the fastest first; the same motion is shown once."""
    from brachis.search.portfolio import STATUS, TIMES, WORDS, candidate_rows

    rows = candidate_rows(candidates)[:_MANY]
    others = len(candidates) - len(rows)
    more = f", {others} of them in the JSON only" if others else ""
    times = (Column(name, number=True) for name in TIMES)
    title = f"candidates ({len(candidates)}{more})"
    print_table(result_console(), title, (*WORDS, *times, STATUS), rows)


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
    urdf: Urdf = None,
    changes: Changes = None,
    strict: Strict = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Say what holds a motion back: which limits cost time.

    How much each of them costs, and when it is active, of a task that is planned for it or of a saved motion.
    """
    with interrupts.defer():
        from brachis import planner
        from brachis.apps import bottleneck as bottlenecks
        from brachis.apps.cli.settings import changed_task, motion_file, urdf_of
        from brachis.optimise.candidate import coordinates
        from brachis.trajectory import Trajectory
    if out is not None:
        make_folder(out, (*_BOTTLENECK[True], *_BOTTLENECK[False]), (task, urdf))
    source = motion_file(task)
    result = None
    with shown_warnings(), progress() as listener:
        if source.suffix.lower() == ".npz":
            options = {"--urdf": urdf, "--set": changes, "--strict": strict}
            _refuse_options_of_tasks(options)
            trajectory = Trajectory.load(source)
            verified, data = _verify_again(trajectory)
        else:
            result = planner.plan(
                urdf and urdf_of(urdf),
                changed_task(source, changes, strict=strict),
                listener=listener,
            )
            trajectory = result.trajectory
            verified = result.verified
            data = result.to_dict()
        listener("looking for what holds the motion back")
        found = bottlenecks.report(
            result or trajectory, check=check, reference=reference
        )
    data["bottleneck"] = found.to_dict()
    written = Written((), ())
    if out is not None:
        written = _write_bottleneck(trajectory, data, out, verified=verified)
        data["files"] = list(written.files)
    if json:
        print_json(data)
    else:
        console = result_console()
        redundant = coordinates(trajectory.redundant_joints, trajectory.branch)
        console.print(
            f"end time t_E: {trajectory.t_end:.4f} s, redundant joints: {redundant}"
        )
        console.print(found.text(degrees=degrees))
        for name in written.files:
            console.print(f"wrote {name}")
    if result is not None:
        print_what_was_left(result.not_completed, interrupted=result.interrupted)
    if not verified:
        print_error(
            "the motion found did not pass the verification; what is said of it may not hold"
        )
    raise typer.Exit(exit_code(verified, written.failures))


def _refuse_options_of_tasks(given: Mapping[str, object]) -> None:
    """Refuse options that change a task where a saved motion is given."""
    for option, value in given.items():
        if value is not None:
            raise InputError(
                "a saved motion belongs to the robot and task that it was planned for",
                where=option,
                found=value,
                allowed="this option with a task file",
            )


def _verify_again(trajectory: Trajectory) -> tuple[bool, dict[str, Any]]:
    """Verify a saved motion; returns whether it passes, and its figures."""
    from brachis.verify import verify_trajectory

    verification = verify_trajectory(trajectory)
    return verification.passed, {
        "t_end": trajectory.t_end,
        "redundant_joints": list(trajectory.redundant_joints),
        "branch": trajectory.branch,
        "joint_names": list(trajectory.joint_names),
        "verified": verification.passed,
        "worst_ratio": verification.worst_ratio,
        "path_error": verification.path_error,
    }


def _write_bottleneck(
    trajectory: Trajectory, data: dict[str, Any], out: Path, *, verified: bool
) -> Written:
    """Write the figures and the drawing."""
    from brachis.apps.plots import plot_timeline, save_figure

    figures_of_merit, timeline = _BOTTLENECK[verified]
    results: dict[str, Writer] = {
        figures_of_merit: lambda path: write_text(json_text(data), path)
    }
    figures: dict[str, Writer] = {
        timeline: lambda path: save_figure(plot_timeline(trajectory), path)
    }
    return write_files(out, results, figures, stale=_BOTTLENECK[not verified])
