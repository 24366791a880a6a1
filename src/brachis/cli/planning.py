"""``brachis plan``."""

from __future__ import annotations

import json
from pathlib import Path

from rich.table import Table

from brachis import planner
from brachis.cli.output import print_error, print_json, progress, result_console, verification_table
from brachis.errors import BrachisError, InputError
from brachis.files import atomic_write
from brachis.result import Result


class InterruptedByUserError(BrachisError):
    """The user pressed Ctrl-C."""

    exit_code = 130


def plan_command(task: Path, *, urdf: Path | None, out: Path | None, as_json: bool) -> int:
    """Plan, show, write; returns the exit code."""
    if out is not None:
        _make_folder(out)
    try:
        with progress() as listener:
            result = planner.plan(urdf, task, listener=listener)
    except KeyboardInterrupt as interrupt:
        raise InterruptedByUserError("interrupted; nothing was written") from interrupt
    data = {**result.to_dict(), "verification": result.verification.to_dict()}
    if out is not None:
        data["files"] = _write(result, data, out)
    if as_json:
        print_json(data)
    else:
        _show(result, data)
    if not result.verified:
        print_error("the motion found did not pass the verification; it is marked unverified")
    return 0 if result.verified else 1


def _make_folder(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("the folder cannot be made", where=str(out), found=error.strerror) from error


def _write(result: Result, data: dict[str, object], out: Path) -> list[str]:
    """Write result, figures and figures of merit; an unverified motion gets a name that says so."""
    from brachis.plots import plot_overview, save_figure  # noqa: PLC0415  (matplotlib takes 0.7 s)

    stem = "result" if result.verified else "unverified"
    names = [out / f"{stem}.npz", out / f"{stem}.json", out / "overview.png"]
    result.trajectory.save(names[0])
    with atomic_write(names[1]) as stream:
        stream.write((json.dumps(data, indent=2) + "\n").encode())
    save_figure(plot_overview(result.trajectory), names[2])
    return [str(name) for name in names]


def _show(result: Result, data: dict[str, object]) -> None:
    """Print the plan for a person."""
    console = result_console()
    last = result.attempts[-1]
    table = Table(show_header=False, title="plan", title_justify="left")
    rows = {
        "end time t_E": f"{result.t_end:.4f} s",
        "redundant joints": ", ".join(result.trajectory.redundant_joints) or "none",
        "branch": f"{result.trajectory.branch} ({result.family})",
        "solver": f"{result.report.solver}, {result.report.status.value}",
        "iterations": f"{sum(r.iterations for r in last.reports)} in {len(last.reports)} solves (refined to "
        f"{last.collocation_points} collocation points)",
        "wall time": f"{1e3 * result.timing['total']:.0f} ms",
        "worst ratio to a limit": f"{result.verification.worst_ratio:.6f}",
        "path error": f"{result.verification.path_error:.1e} m or rad",
        "verified": "yes" if result.verified else "NO",
    }
    for name, value in rows.items():
        table.add_row(name, value)
    console.print(table)
    for number, attempt in enumerate(result.attempts[:-1], start=1):
        console.print(f"attempt {number} was given up: {attempt.outcome}")
    console.print(verification_table(result.verification))
    for name in data.get("files", []):  # type: ignore[attr-defined]
        console.print(f"wrote {name}")
