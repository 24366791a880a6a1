"""``brachis verify | export | plot | schema``."""

from __future__ import annotations

import sys
from pathlib import Path

from brachis.cli.output import json_text, print_json, result_console, verification_table
from brachis.errors import InputError, UnknownNameError
from brachis.files import atomic_write
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
        result_console().print(verification_table(verification))
    return 0 if verification.passed else 1


def export_command(result: Path, out: Path, *, form: str, dt: float) -> None:
    """Write a saved motion in one of the formats of `brachis.export.FORMATS`."""
    from brachis.export import FORMATS  # noqa: PLC0415

    _keep(result, out)
    FORMATS[form](Trajectory.load(result), out, dt)
    result_console().print(f"wrote {out}")


def plot_command(result: Path, *, out: Path, kind: str) -> None:
    """Draw a saved motion."""
    from brachis.plots import PLOTS, save_figure  # noqa: PLC0415

    if kind not in PLOTS:
        raise UnknownNameError("figure", kind, PLOTS, where="--kind")
    _keep(result, out)
    save_figure(PLOTS[kind](Trajectory.load(result)), out)
    result_console().print(f"wrote {out}")


def _keep(result: Path, out: Path) -> None:
    """Refuse to write over the motion that is read."""
    if out.resolve() == result.resolve():
        raise InputError(
            "would be written over the saved motion", where=str(out), found="the same file", allowed="another file name"
        )


def schema_command(out: Path | None) -> None:
    """Print or write the JSON schema of task files."""
    text = json_text(json_schema())
    if out is None:
        sys.stdout.write(text)
        return
    with atomic_write(out) as stream:
        stream.write(text.encode())
    result_console().print(f"wrote {out}")
