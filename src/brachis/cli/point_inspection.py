"""The points that a task's path follows, for ``brachis inspect``."""

from __future__ import annotations

from math import degrees

from rich.console import Console

from brachis.cli.tables import Column, print_table
from brachis.task import FitReport, Task


def print_points(console: Console, task: Task) -> None:
    """Print what was read from a task's files, and how near the fitted path is to it."""
    if not task.fits:
        console.print("no part of the path comes from points")
    for fit in task.fits:
        print_table(console, fit.source, ("", ""), _rows(fit), header=False)
        if fit.corners:
            _print_corners(console, fit)


def _rows(fit: FitReport) -> list[tuple[str, str]]:
    passes = [] if fit.profile else [("path", "passes all points")]
    position = f"(allowed {1e3 * fit.position_tolerance:.4g} mm), rms {1e3 * fit.position_rms:.3g} mm"
    orientation = f"(allowed {degrees(fit.orientation_tolerance):.4g} deg)"
    return [
        ("points", f"{fit.points} along {1e3 * fit.length:.6g} mm"),
        ("knot intervals", str(fit.intervals)),
        *passes,
        ("position error", f"at most {1e3 * fit.position_error:.4g} mm {position}"),
        ("orientation error", f"at most {degrees(fit.orientation_error):.3g} deg {orientation}"),
        *(("found", told) for told in (*fit.told, *([fit.doubt] if fit.doubt else []))),
    ]


def _print_corners(console: Console, fit: FitReport) -> None:
    columns = [Column(name, number=True) for name in ("row", "angle [deg]", "at [mm]", "blend [mm]")]
    rows = [
        (corner.row, f"{degrees(corner.angle):.4g}", f"{1e3 * corner.distance:.6g}", f"{1e3 * corner.blend:.4g}")
        for corner in fit.corners
    ]
    print_table(console, "corners, blended within the tolerance", columns, rows)
