"""``brachis bottleneck``."""

from __future__ import annotations

from pathlib import Path

from brachis import bottleneck, planner
from brachis.cli.folder import Writer, make_folder, write_files, write_text
from brachis.cli.output import (
    json_text,
    print_error,
    print_json,
    print_what_was_left,
    progress,
    result_console,
)
from brachis.result import Result

_FILES = {
    True: ("bottleneck.json", "timeline.png"),
    False: ("unverified_bottleneck.json", "unverified_timeline.png"),
}
"""Names of the figures and the drawing, by whether the motion passed the verification."""


def bottleneck_command(
    task: Path, *, urdf: Path | None, check: bool, reference: bool, out: Path | None, as_json: bool
) -> int:
    """Plan, find the bottlenecks, show, write; returns the exit code."""
    if out is not None:
        make_folder(out)
    with progress() as listener:
        result = planner.plan(urdf, task, listener=listener)
        listener("looking for what holds the motion back")
        found = bottleneck.report(result, check=check, reference=reference)
    data = {**result.to_dict(), "bottleneck": found.to_dict()}
    files = [] if out is None else _write(result, data, out)
    if out is not None:
        data["files"] = files
    if as_json:
        print_json(data)
    else:
        _show(result, found, files)
    print_what_was_left(result)
    if not result.verified:
        print_error("the motion found did not pass the verification; what is said of it may not hold")
    return 0 if result.verified else 1


def _write(result: Result, data: dict[str, object], out: Path) -> list[str]:
    """Write the figures and the drawing; those of an unverified motion get names that say so."""
    from brachis.plots import plot_timeline, save_figure  # noqa: PLC0415  (matplotlib takes 0.7 s)

    writers: tuple[Writer, ...] = (
        lambda path: write_text(json_text(data), path),
        lambda path: save_figure(plot_timeline(result.trajectory), path),
    )
    files = dict(zip(_FILES[result.verified], writers, strict=True))
    return write_files(out, files, stale=_FILES[not result.verified])


def _show(result: Result, found: bottleneck.BottleneckReport, files: list[str]) -> None:
    """Print the report for a person."""
    console = result_console()
    redundant = ", ".join(result.trajectory.redundant_joints) or "none"
    console.print(f"end time t_E: {result.t_end:.4f} s, redundant joints: {redundant}")
    console.print(str(found))
    for name in files:
        console.print(f"wrote {name}")
