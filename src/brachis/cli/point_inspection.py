"""``brachis inspect`` of a task file: the points that its path follows."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import Final

from rich.table import Table

from brachis.cli.output import print_json, result_console
from brachis.task import FitReport, load_task

SUFFIXES: Final = (".yaml", ".yml")


def inspect_points(task: Path, *, as_json: bool) -> None:
    """Print what was read from a task's files, and how near the fitted path is to it."""
    fits = load_task(task).fits
    if as_json:
        print_json({"task": str(task), "fits": [fit.to_dict() for fit in fits]})
        return
    console = result_console()
    if not fits:
        console.print(f"{task}: no part of the path comes from points")
    for fit in fits:
        console.print(_table(fit))
        if fit.corners:
            console.print(_corners(fit))


def _table(fit: FitReport) -> Table:
    table = Table(show_header=False, title=fit.source, title_justify="left")
    table.add_row("points", f"{fit.points} along {1e3 * fit.length:.6g} mm")
    table.add_row("knot intervals", str(fit.intervals))
    if not fit.profile:
        table.add_row("path", "passes all points")
    allowed = f"(allowed {1e3 * fit.position_tolerance:.4g} mm), rms {1e3 * fit.position_rms:.3g} mm"
    table.add_row("position error", f"at most {1e3 * fit.position_error:.4g} mm {allowed}")
    allowed = f"(allowed {degrees(fit.orientation_tolerance):.4g} deg)"
    table.add_row("orientation error", f"at most {degrees(fit.orientation_error):.3g} deg {allowed}")
    for told in (*fit.told, *([fit.doubt] if fit.doubt else [])):
        table.add_row("found", told)
    return table


def _corners(fit: FitReport) -> Table:
    table = Table(title="corners, blended within the tolerance", title_justify="left")
    for column in ("row", "angle [deg]", "at [mm]", "blend [mm]"):
        table.add_column(column, justify="right")
    for corner in fit.corners:
        table.add_row(
            str(corner.row), f"{degrees(corner.angle):.4g}", f"{1e3 * corner.distance:.6g}", f"{1e3 * corner.blend:.4g}"
        )
    return table
