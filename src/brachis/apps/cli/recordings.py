"""``brachis import | compare``: recorded motions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

import brachis
from brachis.apps.cli.app import (
    Degrees,
    Json,
    motion_file,
    refuse_options,
    task_space_of,
)
from brachis.apps.cli.folder import Drawing, finish, output_folder, write_one
from brachis.apps.cli.output import (
    print_json,
    print_lines,
    print_table,
    print_verification,
    show_progress,
)
from brachis.errors import InputError

_FILES = ("today.npz", "result.npz", "comparison.json", "comparison.png")
"""Files for the recorded motion, the plan, the comparison and its drawing."""

RecordedFile = Annotated[Path, Argument(metavar="CSV")]

RobotFile = Annotated[Path, Option()]


def import_(
    csv: RecordedFile,
    robot: RobotFile,
    out: Annotated[Path, Option()],
    task_space: str | None = None,
    angle: str | None = None,
    length: str | None = None,
    time: str | None = None,
    tolerance: float | None = None,
    noise: float | None = None,
    degrees: Degrees = False,
    json: Json = False,
) -> None:
    """Turn a recorded motion into a result file.

    Parameters
    ----------
    out : path
        Result file (npz) to write.

    Examples
    --------
    brachis import out/motion.csv --robot task.yaml --out out/today.npz
    """
    from brachis.apps.comparison import bound_ratios

    trajectory = brachis.import_motion(
        csv,
        str(robot),
        task_space=task_space_of(task_space),
        units={"angle": angle, "length": length, "time": time},
        tolerance=tolerance,
        noise=noise,
    )
    write_one(out, trajectory.save, (csv, robot))
    verification = brachis.verify_trajectory(trajectory)
    recovered = trajectory.recovered
    assert recovered is not None
    if json:
        print_json(
            {
                "t_end": trajectory.t_end,
                "verified": verification.passed,
                "file": str(out),
                "recovered": recovered.to_dict(),
                "verification": verification.to_dict(),
            }
        )
        return
    print_lines(f"end time t_E: {trajectory.t_end:.4f} s", *recovered.told)
    print_verification(verification, degrees=degrees)
    print_lines(
        "these ratios belong to the motion interpolated between the rows; the rows alone prove:"
    )
    for proven in bound_ratios(trajectory):
        ratio, subject, instant = proven.worst
        print_lines(f"{proven.limit} ratio {ratio:.4f}, {subject} at {instant:.4f} s")
    print_lines(f"wrote {out}")


def _compare_run(
    csv: Path,
    plan: Path | None,
    profile: str | None,
    units: dict[str, str | None],
    *,
    json: bool,
) -> None:
    """Print how a run differs from its plan."""
    if plan is None or profile is None:
        missing = "--plan" if plan is None else "--profile"
        raise InputError(
            "a run is compared with its plan in the units of a profile",
            where=missing,
            allowed="both --plan RESULT and --profile NAME",
        )
    tracking = brachis.compare_run(csv, motion_file(plan), profile, units=units)
    if json:
        print_json(tracking.to_dict())
    else:
        print_table("run and plan", ("", ""), tracking.summary().items())


def compare(
    csv: RecordedFile,
    robot: Annotated[Path | None, Option()] = None,
    plan: Annotated[Path | None, Option(metavar="RESULT")] = None,
    profile: str | None = None,
    keep_end: Annotated[bool, Option("--keep-end")] = False,
    out: Path | None = None,
    task_space: str | None = None,
    angle: str | None = None,
    length: str | None = None,
    time: str | None = None,
    tolerance: float | None = None,
    noise: float | None = None,
    figures: bool = True,
    json: Json = False,
) -> None:
    """Compare a recorded motion with a plan.

    A motion along the path of the recording is planned. With --plan, the recording is instead compared with the plan
    that was run.

    Parameters
    ----------
    plan : path, optional
        Result file (npz) of the plan that was run, or its folder, to show where the machine differed from it. This
        needs --profile.
    profile : str, optional
        Controller whose axes and units the CSV file uses; see brachis export.
    keep_end : bool, optional
        End in the recorded end posture. By default, any posture with the tool at the end of the path is allowed.
    out : path, optional
        Output folder for today.npz, result.npz, comparison.json and comparison.png.

    Examples
    --------
    brachis compare out/motion.csv --robot task.yaml
    brachis compare out/run.csv --plan out/result.npz --profile kuka_rsi_4ms
    """
    if plan is not None or profile is not None:
        options = {"--robot": robot, "--out": out, "--keep-end": keep_end or None}
        refuse_options(options, "the plan of a run", "--robot")
        units = {"angle": angle, "length": length, "time": time}
        _compare_run(csv, plan, profile, units, json=json)
        return
    if robot is None:
        raise InputError(
            "the robot or the plan is missing",
            where="--robot",
            allowed="--robot FILE, or --plan RESULT with --profile NAME",
        )
    from brachis.apps.comparison import plot_both_motions

    with output_folder(out, _FILES, (csv, robot)), show_progress() as listener:
        comparison = brachis.compare(
            csv,
            str(robot),
            task_space=task_space_of(task_space),
            units={"angle": angle, "length": length, "time": time},
            tolerance=tolerance,
            noise=noise,
            keep_end=keep_end,
            listener=listener,
        )
    drawings: dict[str, Drawing] = {
        "comparison.png": lambda: plot_both_motions(comparison)
    }
    code = finish(
        comparison.to_dict(),
        {"today.npz": comparison.recorded.save, "result.npz": comparison.result.save},
        drawings if figures else {},
        out=out,
        names=_FILES,
        verified=comparison.result.verified,
        json=json,
        show=lambda: print_lines(str(comparison)),
        result=comparison.result,
    )
    raise typer.Exit(code)
