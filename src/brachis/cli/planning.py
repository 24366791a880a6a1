"""``brachis plan``."""

from __future__ import annotations

import math
import secrets
import shutil
from collections.abc import Callable
from pathlib import Path

from rich.table import Table

from brachis import planner
from brachis.cli.output import json_text, print_error, print_json, progress, result_console, verification_table
from brachis.errors import InputError
from brachis.files import atomic_write, writing_errors
from brachis.result import Result

_FILES = {
    True: ("result.npz", "result.json", "overview.png", "candidates.png"),
    False: ("unverified.npz", "unverified.json", "unverified.png", "unverified_candidates.png"),
}
"""Names of the trajectory, the figures of merit, the drawings of motion and search, by whether it was verified."""
_MANY = 40
"""Candidates that are listed on the screen."""


def plan_command(task: Path, *, urdf: Path | None, out: Path | None, as_json: bool) -> int:
    """Plan, show, write; returns the exit code."""
    if out is not None:
        _make_folder(out)
    with progress() as listener:
        result = planner.plan(urdf, task, listener=listener)
    data = {**result.to_dict(), "verification": result.verification.to_dict()}
    if out is not None:
        data["files"] = _write(result, data, out)
    if as_json:
        print_json(data)
    else:
        _show(result, data)
    if result.interrupted:
        print_error("the search was ended early; this is the best motion verified so far")
    if not result.verified:
        print_error("the motion found did not pass the verification; it is marked unverified")
    return 0 if result.verified else 1


def _make_folder(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("the folder cannot be made", where=str(out), found=error.strerror) from error


def _write(result: Result, data: dict[str, object], out: Path) -> list[str]:
    """Write trajectory, figures of merit and drawing; an unverified motion gets names that say so.

    All are written into a temporary folder and then moved, so that a failure leaves the folder as it was. Files of an
    earlier plan with the other names are removed: they would be another motion's.
    """
    from brachis.plots import plot_candidates, plot_overview, save_figure  # noqa: PLC0415  (matplotlib takes 0.7 s)

    names = _FILES[result.verified]
    writers: tuple[Callable[[Path], object], ...] = (
        result.trajectory.save,
        lambda path: _write_text(json_text(data), path),
        lambda path: save_figure(plot_overview(result.trajectory), path),
        lambda path: save_figure(plot_candidates(result.candidates), path),
    )
    for name in names:
        if (out / name).is_dir():
            raise InputError("cannot be written", where=str(out / name), found="a folder of this name")
    temporary = out / f".{secrets.token_hex(8)}.part"
    with writing_errors(out):
        temporary.mkdir()
    try:
        for name, write in zip(names, writers, strict=True):
            try:
                write(temporary / name)
            except InputError as error:  # it names the temporary file
                raise InputError(error.problem, where=str(out / name), found=error.found) from error
        for name in names:
            with writing_errors(out / name):
                (temporary / name).replace(out / name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for name in _FILES[not result.verified]:
        with writing_errors(out / name):
            (out / name).unlink(missing_ok=True)
    return [str(out / name) for name in names]


def _write_text(text: str, path: Path) -> None:
    with atomic_write(path) as stream:
        stream.write(text.encode())


def _show(result: Result, data: dict[str, object]) -> None:
    """Print the plan for a person."""
    console = result_console()
    attempt = result.attempt
    table = Table(show_header=False, title="plan", title_justify="left")
    rows = {
        "end time t_E": f"{result.t_end:.4f} s",
        "redundant joints": ", ".join(result.trajectory.redundant_joints) or "none",
        "branch": f"{result.trajectory.branch} ({result.family})",
        "solver": f"{result.report.solver}, {result.report.status.value}",
        "iterations": f"{sum(r.iterations for r in attempt.reports)} in {len(attempt.reports)} solves (refined to "
        f"{attempt.collocation_points} collocation points)",
        "wall time": f"{1e3 * result.timing['total']:.0f} ms",
        "worst ratio to a limit": f"{result.verification.worst_ratio:.6f}",
        "path error": f"{result.verification.path_error:.1e} m or rad",
        "verified": "yes" if result.verified else "NO",
    }
    if attempt.stretched > 1.0:
        lengthened = f"{100.0 * (attempt.stretched - 1.0):.2g} % to meet the limits between collocation points"
        rows["end time lengthened by"] = lengthened
    for name, value in rows.items():
        table.add_row(name, value)
    console.print(table)
    if len(result.candidates) > 1:
        console.print(_candidates_table(result))
    console.print(verification_table(result.verification))
    for name in data.get("files", []):  # type: ignore[attr-defined]
        console.print(f"wrote {name}")


def _candidates_table(result: Result) -> Table:
    """Lay out what the search looked at, one candidate a row, the fastest first."""
    hidden = len(result.candidates) - _MANY
    title = f"candidates ({len(result.candidates)}" + (
        f", {hidden} of them in result.json only)" if hidden > 0 else ")"
    )
    table = Table(title=title, title_justify="left")
    for column in ("redundant joints", "branch", "guess", "estimate [s]", "planned [s]", "refined [s]", "status"):
        table.add_column(column, justify="right" if column.endswith("[s]") else "left")
    for candidate in result.candidates[:_MANY]:
        times = (candidate.estimate, candidate.coarse, candidate.t_end)
        table.add_row(
            ", ".join(candidate.redundant_joints) or "none",
            candidate.branch,
            candidate.origin,
            *(f"{time:.4f}" if math.isfinite(time) else "" for time in times),
            candidate.status,
        )
    return table
