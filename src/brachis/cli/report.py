"""``brachis report``."""

from __future__ import annotations

from pathlib import Path

from brachis.cli.folder import write_one
from brachis.cli.output import exit_code, print_error, result_console
from brachis.cli.settings import motion_file
from brachis.report import make_report
from brachis.trajectory import Trajectory

SUFFIX = ".html"


def report_command(result: Path, *, out: Path | None, title: str | None, degrees: bool) -> int:
    """Write the report of a saved motion beside it, or where asked; returns the exit code."""
    result = motion_file(result)
    out = result.with_suffix(SUFFIX) if out is None else out
    trajectory = Trajectory.load(result)
    urdf = trajectory.task.robot.urdf
    title = ", ".join(filter(None, (trajectory.robot.name, result.name))) if title is None else title
    page = make_report(trajectory, title=title, degrees=degrees)
    write_one(out, page.save, (SUFFIX,), [result, None if urdf is None else Path(urdf)])
    result_console().print(f"wrote {out} ({1e-6 * page.size:.1f} MB)")
    if not page.verified:
        print_error("the motion did not pass the verification; the report says so, and what failed")
    return exit_code(page.verified, ())
