"""``brachis verify | export | plot | schema``.

``brachis report``.

``brachis view``, and ``brachis plan --view``.

``brachis bottleneck``.
"""

from __future__ import annotations

import json
import math
import os
import sys
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brachis import planner
from brachis.apps import bottleneck
from brachis.apps.cli.app import Verbosity, chosen
from brachis.apps.cli.folder import (
    Writer,
    Written,
    make_folder,
    write_files,
    write_one,
    write_text,
)
from brachis.apps.cli.output import (
    exit_code,
    json_text,
    print_error,
    print_json,
    print_verification,
    print_what_was_left,
    progress,
    result_console,
    shown_warnings,
)
from brachis.apps.cli.settings import changed_task, motion_file, urdf_of
from brachis.apps.report import make_report
from brachis.apps.view import LOOPBACK, Viewer
from brachis.common import interrupts
from brachis.common.files import read_file
from brachis.errors import InputError, UnknownNameError
from brachis.optimise.candidate import coordinates
from brachis.result import Result
from brachis.robot.from_task import robot_from_settings
from brachis.task import Task, json_schema
from brachis.trajectory import Trajectory
from brachis.verify import verify_trajectory


def verify_command(
    result: Path, *, urdf: Path | None, degrees: bool, as_json: bool
) -> int:
    """Verify a saved motion; returns the exit code."""
    trajectory = Trajectory.load(motion_file(result))
    robot = (
        None if urdf is None else robot_from_settings(trajectory.task.robot, urdf=urdf)
    )
    verification = verify_trajectory(trajectory, robot=robot)
    if as_json:
        print_json(verification.to_dict())
    else:
        print_verification(result_console(), verification, degrees=degrees)
    return 0 if verification.passed else 1


def export_command(
    result: Path,
    out: Path,
    *,
    form: str | None,
    dt: float | None,
    last: str | None,
    joints: str | None,
    slower: float,
) -> None:
    """Write a saved motion in one of the formats of `brachis.export.FORMATS`."""
    from brachis.apps import export

    result = motion_file(result)
    chosen, trajectory = export.format_of(out, form), Trajectory.load(result)
    names = None if joints is None else [name.strip() for name in joints.split(",")]
    with shown_warnings():
        write_one(
            out,
            lambda path: export.write(
                trajectory,
                path,
                form=form,
                dt=dt,
                last=last,
                joints=names,
                slower=slower,
            ),
            (chosen.suffix,),
            _sources(result, trajectory),
        )
    period = chosen.dt if dt is None else dt
    if period > trajectory.t_end:
        print_error(
            f"the period of {period:g} s is longer than the motion, which takes {trajectory.t_end:.6g} s"
        )
    result_console().print(f"wrote {out}")


def plot_command(result: Path, *, out: Path, kind: str) -> None:
    """Draw a saved motion."""
    from brachis.apps.plots import PLOTS, SUFFIXES, check_suffix, save_figure

    if kind not in PLOTS:
        raise UnknownNameError("figure", kind, PLOTS, where="--kind")
    check_suffix(out)
    result = motion_file(result)
    trajectory = Trajectory.load(result)
    suffixes = [f".{suffix}" for suffix in SUFFIXES]
    write_one(
        out,
        lambda path: save_figure(PLOTS[kind](trajectory), path),
        suffixes,
        _sources(result, trajectory),
    )
    result_console().print(f"wrote {out}")


def _sources(result: Path, trajectory: Trajectory) -> list[Path | None]:
    """List the files that a saved motion is read from or was planned for."""
    urdf = trajectory.task.robot.urdf
    return [result, None if urdf is None else Path(urdf)]


def schema_command(out: Path | None, of: str) -> None:
    """Print or write the JSON schema of task files or of exported trajectories."""
    from brachis.apps.export import samples_schema

    schemas = {"task": json_schema, "trajectory": samples_schema}
    if of not in schemas:
        raise UnknownNameError("schema", of, schemas, where="--of")
    text = json_text(schemas[of]())
    if out is None:
        sys.stdout.write(text)
        return
    write_one(out, lambda path: write_text(text, path), (".json",))
    result_console().print(f"wrote {out}")


SUFFIX = ".html"


def report_command(
    result: Path, *, out: Path | None, title: str | None, degrees: bool
) -> int:
    """Write the report of a saved motion beside it, or where asked; returns the exit code."""
    result = motion_file(result)
    out = result.with_suffix(SUFFIX) if out is None else out
    trajectory = Trajectory.load(result)
    urdf = trajectory.task.robot.urdf
    title = (
        ", ".join(filter(None, (trajectory.robot.name, result.name)))
        if title is None
        else title
    )
    page = make_report(trajectory, title=title, degrees=degrees)
    write_one(out, page.save, (SUFFIX,), [result, None if urdf is None else Path(urdf)])
    result_console().print(f"wrote {out} ({1e-6 * page.size:.1f} MB)")
    if not page.verified:
        print_error(
            "the motion did not pass the verification; the report says so, and what failed"
        )
    return exit_code(page.verified, ())


_LARGEST = 64_000_000
"""Of result.json, bytes."""


def view_command(
    result: Path, *, host: str, port: int | None, browser: bool, degrees: bool
) -> None:
    """Show a saved motion until Ctrl-C."""
    path = motion_file(result)
    trajectory = Trajectory.load(path)
    verified = verify_trajectory(trajectory).passed
    candidates = _candidates_beside(path, trajectory)
    show(
        trajectory,
        candidates,
        verified=verified,
        host=host,
        port=port,
        browser=browser,
        degrees=degrees,
    )


def show(
    trajectory: Trajectory,
    candidates: Sequence[Mapping[str, Any]],
    *,
    verified: bool,
    host: str = LOOPBACK,
    port: int | None = None,
    browser: bool = True,
    degrees: bool = False,
) -> None:
    """Show a motion until Ctrl-C; open the browser where there is a screen, and it is wanted."""
    viewer = Viewer(
        trajectory, candidates, verified=verified, degrees=degrees, host=host, port=port
    )
    with viewer, interrupts.expected():
        if not viewer.local:
            print_error(
                f"warning: whoever reaches {host} can look, and move the slider; leave --host out to be alone"
            )
        if chosen() is not Verbosity.QUIET:
            print_error("Ctrl-C stops the viewer")
        print(f"look at {viewer.url}", flush=True)  # noqa: T201  (what the command is for, however quiet)
        if browser and sys.stdout.isatty() and _has_screen():
            webbrowser.open(viewer.url)
        viewer.wait()


def _candidates_beside(path: Path, trajectory: Trajectory) -> list[dict[str, Any]]:
    """Read the candidates of a motion's search from the JSON that was written with it; none where it is another's."""
    beside = path.with_suffix(".json")
    try:
        data = json.loads(read_file(beside, _LARGEST))
        same = math.isclose(data["t_end"], trajectory.t_end, rel_tol=1e-12)
        return [dict(each) for each in data["candidates"]] if same else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _has_screen() -> bool:
    """Tell whether a browser would have somewhere to open."""
    return sys.platform == "darwin" or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


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
        print_error(
            "the motion found did not pass the verification; what is said of it may not hold"
        )
    return exit_code(motion.verified, written.failures)


def _planned(task: Task, urdf: Path | None, listener: Callable[[str], None]) -> _Motion:
    result = planner.plan(urdf and urdf_of(urdf), task, listener=listener)
    return _Motion(
        result,
        result.trajectory,
        result.verified,
        result.to_dict(),
        result.interrupted,
        result.undone,
    )


def _saved(path: Path, given: Mapping[str, object]) -> _Motion:
    """Load a motion and verify it again; options are for tasks."""
    for option, value in given.items():
        if value:
            problem = (
                "a saved motion belongs to the robot and task that it was planned for"
            )
            raise InputError(
                problem,
                where=option,
                found=value,
                allowed="this option with a task file",
            )
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
    from brachis.apps.plots import plot_timeline, save_figure

    figures_of_merit, timeline = _FILES[motion.verified]
    results: dict[str, Writer] = {
        figures_of_merit: lambda path: write_text(json_text(data), path)
    }
    figures: dict[str, Writer] = {
        timeline: lambda path: save_figure(plot_timeline(motion.trajectory), path)
    }
    return write_files(out, results, figures, stale=_FILES[not motion.verified])


def _show(trajectory: Trajectory, found: str, files: tuple[str, ...]) -> None:
    """Print the report for a person."""
    console = result_console()
    redundant = coordinates(trajectory.redundant_joints, trajectory.branch)
    console.print(
        f"end time t_E: {trajectory.t_end:.4f} s, redundant joints: {redundant}"
    )
    console.print(found)
    for name in files:
        console.print(f"wrote {name}")
