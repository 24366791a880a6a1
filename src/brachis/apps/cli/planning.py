"""``brachis plan``.

``brachis sweep``.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from brachis import planner
from brachis.apps.cli.app import Verbosity, chosen
from brachis.apps.cli.folder import (
    Writer,
    Written,
    ended_cleanly,
    make_folder,
    write_files,
    write_text,
)
from brachis.apps.cli.motions import show
from brachis.apps.cli.output import (
    Column,
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
from brachis.apps.cli.settings import changed_task, urdf_of
from brachis.apps.plots import save_figure
from brachis.apps.sweeps import SweepResult, sweep
from brachis.apps.sweeps.pools import FAILED, UNVERIFIED, VERIFIED
from brachis.apps.sweeps.run import in_words
from brachis.apps.view import require_viser
from brachis.common.files import writing_errors
from brachis.errors import InputError, write_count
from brachis.optimise.candidate import coordinates
from brachis.result import Result
from brachis.robot.joints import shown_unit
from brachis.search.record import STATUS, TIMES, WORDS, candidate_rows

_FILES = {
    True: ("result.npz", "result.json", "overview.png", "candidates.png", "fit.png"),
    False: (
        "unverified.npz",
        "unverified.json",
        "unverified.png",
        "unverified_candidates.png",
        "unverified_fit.png",
    ),
}
"""Names of the trajectory, the figures of merit, the drawings of motion, search and fit, by whether it was verified."""
_MANY = 40
"""Candidates that are listed on the screen."""


def plan_command(
    task: Path,
    changes: Sequence[str],
    *,
    urdf: Path | None,
    out: Path | None,
    view: bool,
    degrees: bool,
    as_json: bool,
) -> int:
    """Plan, show, write; returns the exit code."""
    if view:
        require_viser()
    if out is not None:
        make_folder(out, (*_FILES[True], *_FILES[False]), (task, urdf))
    with shown_warnings(), progress() as listener:
        result = planner.plan(
            urdf and urdf_of(urdf), changed_task(task, changes), listener=listener
        )
    data = {**result.to_dict(), "verification": result.verification.to_dict()}
    failures: tuple[InputError, ...] = ()
    if out is not None:
        written = _write(result, data, out)
        data["files"], failures = list(written.files), written.failures
    if as_json:
        print_json(data)
    else:
        _show(result, data, degrees=degrees)
    print_what_was_left(result.undone, interrupted=result.interrupted)
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
    return exit_code(result.verified, failures)


def _write(result: Result, data: dict[str, object], out: Path) -> Written:
    """Write trajectory, figures of merit and drawing; an unverified motion gets names that say so.

    Files of an earlier plan with the other names are removed: they would be another motion's.
    """
    from brachis.apps.plots import plot_candidates, plot_fit, plot_overview, save_figure

    trajectory, figures_of_merit, overview, candidates, fit = _FILES[result.verified]
    results: dict[str, Writer] = {
        trajectory: result.trajectory.save,
        figures_of_merit: lambda path: write_text(json_text(data), path),
    }
    figures: dict[str, Writer] = {
        overview: lambda path: save_figure(plot_overview(result.trajectory), path),
        candidates: lambda path: save_figure(plot_candidates(result.candidates), path),
    }
    if any(told.profile for told in result.fits):
        figures[fit] = lambda path: save_figure(plot_fit(result.trajectory), path)
    return write_files(out, results, figures, stale=(*_FILES[not result.verified], fit))


def _show(result: Result, data: dict[str, Any], *, degrees: bool) -> None:
    """Print the plan for a person."""
    console = result_console()
    attempt, trajectory = result.attempt, result.trajectory
    named = trajectory.branch not in {"", result.family}
    rows = {
        "end time t_E": f"{result.t_end:.4f} s",
        "redundant joints": coordinates(trajectory.redundant_joints, trajectory.branch),
        "branch": f"{trajectory.branch} ({result.family})" if named else result.family,
        "start posture": _posture(data, "start_posture", degrees=degrees),
        "end posture": _posture(data, "end_posture", degrees=degrees),
        **data["in_use"],
        "solver": f"{result.solver_report.solver}, {result.solver_report.status.value}",
        "iterations": f"{sum(r.iterations for r in attempt.reports)} in {write_count(len(attempt.reports), 'solve')} "
        f"(refined to {attempt.collocation_points} collocation points)",
        "wall time": f"{1e3 * result.timing['total']:.0f} ms",
        "least motion": "off"
        if result.least_motion is None
        else result.least_motion.status,
        "worst ratio to a limit": f"{result.verification.worst_ratio:.6f}",
        "path error": f"{result.verification.path_error:.1e} m or rad",
        "verified": "yes" if result.verified else "NO",
    }
    if attempt.time_scaled > 1.0:
        lengthened = f"{100.0 * (attempt.time_scaled - 1.0):.2g} % to meet the limits between collocation points"
        rows["end time lengthened by"] = lengthened
    print_table(console, "plan", ("", ""), rows.items(), header=False)
    for fit in result.fits:
        console.print(f"path from {fit}")
    if len(data["candidates"]) > 1:
        _print_candidates(console, data["candidates"])
    print_verification(console, result.verification, degrees=degrees)
    for name in data.get("files", []):
        console.print(f"wrote {name}")


def _posture(data: dict[str, Any], key: str, *, degrees: bool) -> str:
    """Write a posture with names and units."""
    parts = []
    for name, value, si_unit in zip(
        data["joint_names"], data[key], data["position_units"], strict=True
    ):
        unit, factor = shown_unit(si_unit, degrees=degrees)
        parts.append(f"{name} {factor * value:.4f} {unit}")
    return ", ".join(parts)


def _print_candidates(
    console: Console, candidates: Sequence[Mapping[str, Any]]
) -> None:
    """Print what the search looked at, one candidate a row, the fastest first; the same motion is shown once."""
    rows = candidate_rows(candidates)
    others = len(candidates) - len(rows[:_MANY])
    title = f"candidates ({len(candidates)}" + (
        f", {others} of them in the JSON only)" if others else ")"
    )
    times = (Column(name, number=True) for name in TIMES)
    print_table(console, title, (*WORDS, *times, STATUS), rows[:_MANY])


_STEPS = 20
"""How often progress is told where standard error is no terminal."""
_FIGURE = "sweep.png"


def sweep_command(
    source: Path,
    *,
    out: Path | None,
    jobs: int | None,
    scheduler: str | None,
    retry: bool,
    as_json: bool,
) -> int:
    """Run a sweep, show, write; returns the exit code."""
    with ended_cleanly(), _progress() as listener:
        result = sweep(
            source, out, jobs=jobs, scheduler=scheduler, retry=retry, listener=listener
        )
    files, failures = [str(path) for path in result.files], []
    figure = result.folder / _FIGURE
    with writing_errors(figure):
        figure.unlink(missing_ok=True)
    if result.varied and result.count(VERIFIED):
        try:
            save_figure(result.plot(), figure)
            files.append(str(figure))
        except InputError as error:
            failures.append(error)
    if as_json:
        print_json({**result.summary(), "keys": list(result.keys), "files": files})
    else:
        _show_sweep(result, files)
    return exit_code(result.count(VERIFIED) > 0, failures)


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """Show how far the sweep is: in place on a terminal, else in some lines on standard error, for the logs of jobs."""
    with progress() as status:
        if sys.stderr.isatty() or chosen() is not Verbosity.NORMAL:
            yield status
            return
        told = -1

        def listener(text: str) -> None:
            nonlocal told
            status(text)
            done = re.match(r"(\d+) of (\d+)", text)
            step = int(done[1]) * _STEPS // max(1, int(done[2])) if done else -1
            if step != told:
                print_error(text)
            told = step

        yield listener


def _show_sweep(result: SweepResult, files: Sequence[str]) -> None:
    """Print the sweep for a person."""
    console, found = result_console(), result.summary()
    counts = ", ".join(
        f"{found[status]} {status}" for status in (VERIFIED, UNVERIFIED, FAILED)
    )
    title = f"sweep: {write_count(found['plans'], 'plan')}, {counts}"
    shown = [name for name in ("best", "median", "worst") if name in found]
    if shown:
        keys = {
            "t_end_s": "t_end [s]",
            "plan": "plan",
            **{key: key for key in result.keys},
        }
        rows = [
            (words, *(_text(found[name][key]) for name in shown))
            for key, words in keys.items()
        ]
        print_table(
            console, title, ("", *(Column(name, number=True) for name in shown)), rows
        )
    else:
        console.print(title)
    for error, told in found["failures"].items():
        console.print(
            f"{told['plans']} failed with {error}, for example: {told['message']}"
        )
    console.print(
        f"planning took {in_words(found['wall_time_s'])} in all processes together"
    )
    for name in files:
        console.print(f"wrote {name}")


def _text(value: object) -> str:
    return (
        f"{value:.6g}"
        if isinstance(value, float)
        else ""
        if value is None
        else str(value)
    )
