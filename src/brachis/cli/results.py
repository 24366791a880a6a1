"""``brachis verify | export | plot | schema``."""

from __future__ import annotations

import sys
from pathlib import Path

from brachis.cli.folder import write_one, write_text
from brachis.cli.output import json_text, print_error, print_json, print_verification, result_console
from brachis.errors import UnknownNameError
from brachis.robot.from_task import robot_from_settings
from brachis.task import json_schema
from brachis.trajectory import Trajectory
from brachis.verify import VerifyOptions, verify_trajectory


def verify_command(result: Path, *, urdf: Path | None, as_json: bool) -> int:
    """Verify a saved motion; returns the exit code."""
    trajectory = Trajectory.load(result)
    robot = None if urdf is None else robot_from_settings(trajectory.task.robot, urdf=urdf)
    options = VerifyOptions(ratio_tolerance=trajectory.task.refinement.tolerance)
    verification = verify_trajectory(trajectory, options, robot=robot)
    if as_json:
        print_json(verification.to_dict())
    else:
        print_verification(result_console(), verification)
    return 0 if verification.passed else 1


def export_command(result: Path, out: Path, *, form: str, dt: float, last: str) -> None:
    """Write a saved motion in one of the formats of `brachis.export.FORMATS`."""
    from brachis.export import FORMATS  # noqa: PLC0415

    trajectory = Trajectory.load(result)
    write_one(
        out, lambda path: FORMATS[form](trajectory, path, dt, last=last), (f".{form}",), _sources(result, trajectory)
    )
    if dt > trajectory.t_end:
        print_error(f"the period of {dt:g} s is longer than the motion, which takes {trajectory.t_end:.6g} s")
    result_console().print(f"wrote {out}")


def plot_command(result: Path, *, out: Path, kind: str) -> None:
    """Draw a saved motion."""
    from brachis.plots import PLOTS, SUFFIXES, check_suffix, save_figure  # noqa: PLC0415

    if kind not in PLOTS:
        raise UnknownNameError("figure", kind, PLOTS, where="--kind")
    check_suffix(out)
    trajectory = Trajectory.load(result)
    suffixes = [f".{suffix}" for suffix in SUFFIXES]
    write_one(out, lambda path: save_figure(PLOTS[kind](trajectory), path), suffixes, _sources(result, trajectory))
    result_console().print(f"wrote {out}")


def _sources(result: Path, trajectory: Trajectory) -> list[Path | None]:
    """List the files that a saved motion is read from or was planned for."""
    urdf = trajectory.task.robot.urdf
    return [result, None if urdf is None else Path(urdf)]


def schema_command(out: Path | None) -> None:
    """Print or write the JSON schema of task files."""
    text = json_text(json_schema())
    if out is None:
        sys.stdout.write(text)
        return
    write_one(out, lambda path: write_text(text, path), (".json",))
    result_console().print(f"wrote {out}")
