"""``brachis bottleneck``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brachis import bottleneck, planner
from brachis.attempt import coordinates
from brachis.cli.folder import Writer, Written, make_folder, write_files, write_text
from brachis.cli.output import (
    exit_code,
    json_text,
    print_error,
    print_json,
    print_what_was_left,
    progress,
    result_console,
    shown_warnings,
)
from brachis.cli.settings import changed_task, motion_file, urdf_of
from brachis.errors import InputError
from brachis.result import Result
from brachis.task import Task
from brachis.trajectory import Trajectory
from brachis.verify import verify_trajectory

_FILES = {
    True: ("bottleneck.json", "timeline.png"),
    False: ("unverified_bottleneck.json", "unverified_timeline.png"),
}
"""Names of the figures and the drawing, by whether the motion passed the verification."""
_SAVED = ".npz"
"""Suffix by which a saved motion is told from a task."""


@dataclass(frozen=True)
class _Motion:
    """A motion, planned now or before; ``made`` is what the report is made of."""

    made: Result | Trajectory
    trajectory: Trajectory
    verified: bool
    data: dict[str, Any]
    interrupted: bool = False
    undone: tuple[str, ...] = ()


def bottleneck_command(
    source: Path,
    changes: Sequence[str],
    *,
    urdf: Path | None,
    check: bool,
    reference: bool,
    out: Path | None,
    degrees: bool,
    as_json: bool,
) -> int:
    """Plan a task or take a saved motion, find the bottlenecks, show, write; returns the exit code."""
    if out is not None:
        make_folder(out, (*_FILES[True], *_FILES[False]), (source, urdf))
    source = motion_file(source)
    with shown_warnings(), progress() as listener:
        if source.suffix.lower() == _SAVED:
            motion = _saved(source, {"--urdf": urdf, "--set": changes})
        else:
            motion = _planned(changed_task(source, changes), urdf, listener)
        listener("looking for what holds the motion back")
        found = bottleneck.report(motion.made, check=check, reference=reference)
    data = {**motion.data, "bottleneck": found.to_dict()}
    written = Written((), ())
    if out is not None:
        written = _write(motion, data, out)
        data["files"] = list(written.files)
    if as_json:
        print_json(data)
    else:
        _show(motion.trajectory, found.text(degrees=degrees), written.files)
    print_what_was_left(motion.undone, interrupted=motion.interrupted)
    if not motion.verified:
        print_error("the motion found did not pass the verification; what is said of it may not hold")
    return exit_code(motion.verified, written.failures)


def _planned(task: Task, urdf: Path | None, listener: Callable[[str], None]) -> _Motion:
    result = planner.plan(urdf and urdf_of(urdf), task, listener=listener)
    return _Motion(result, result.trajectory, result.verified, result.to_dict(), result.interrupted, result.undone)


def _saved(path: Path, given: Mapping[str, object]) -> _Motion:
    """Load a motion and verify it again; options are for tasks."""
    for option, value in given.items():
        if value:
            problem = "a saved motion belongs to the robot and task that it was planned for"
            raise InputError(problem, where=option, found=value, allowed="this option with a task file")
    trajectory = Trajectory.load(path)
    verification = verify_trajectory(trajectory)
    data = {
        "t_end": trajectory.t_end,
        "redundant_joints": list(trajectory.redundant_joints),
        "branch": trajectory.branch,
        "joint_names": list(trajectory.joint_names),
        "verified": verification.passed,
        "worst_ratio": verification.worst_ratio,
        "path_error": verification.path_error,
    }
    return _Motion(trajectory, trajectory, verification.passed, data)


def _write(motion: _Motion, data: dict[str, Any], out: Path) -> Written:
    """Write the figures and the drawing; those of an unverified motion get names that say so."""
    from brachis.plots import plot_timeline, save_figure  # noqa: PLC0415  (matplotlib takes 0.7 s)

    figures_of_merit, timeline = _FILES[motion.verified]
    results: dict[str, Writer] = {figures_of_merit: lambda path: write_text(json_text(data), path)}
    figures: dict[str, Writer] = {timeline: lambda path: save_figure(plot_timeline(motion.trajectory), path)}
    return write_files(out, results, figures, stale=_FILES[not motion.verified])


def _show(trajectory: Trajectory, found: str, files: tuple[str, ...]) -> None:
    """Print the report for a person."""
    console = result_console()
    redundant = coordinates(trajectory.redundant_joints, trajectory.branch)
    console.print(f"end time t_E: {trajectory.t_end:.4f} s, redundant joints: {redundant}")
    console.print(found)
    for name in files:
        console.print(f"wrote {name}")
