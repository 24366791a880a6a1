"""The points that a task's path follows, for ``brachis inspect``."""

from __future__ import annotations

from math import degrees

from rich.console import Console
from rich.table import Table

from brachis.task import FitReport, Task


def print_points(console: Console, task: Task) -> None:
    """Print what was read from a task's files, and how near the fitted path is to it."""
    if not task.fits:
        console.print("no part of the path comes from points")
    for fit in task.fits:
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
