"""``brachis verify | export | plot | schema``."""

from __future__ import annotations

import sys
from pathlib import Path

from brachis.cli.folder import write_one, write_text
from brachis.cli.output import json_text, print_error, print_json, print_verification, result_console, shown_warnings
from brachis.cli.settings import motion_file
from brachis.errors import UnknownNameError
from brachis.robot.from_task import robot_from_settings
from brachis.task import json_schema
from brachis.trajectory import Trajectory
from brachis.verify import verify_trajectory


def verify_command(result: Path, *, urdf: Path | None, degrees: bool, as_json: bool) -> int:
    """Verify a saved motion; returns the exit code."""
    trajectory = Trajectory.load(motion_file(result))
    robot = None if urdf is None else robot_from_settings(trajectory.task.robot, urdf=urdf)
    verification = verify_trajectory(trajectory, robot=robot)
    if as_json:
        print_json(verification.to_dict())
    else:
        print_verification(result_console(), verification, degrees=degrees)
    return 0 if verification.passed else 1


def export_command(
    result: Path, out: Path, *, form: str | None, dt: float | None, last: str | None, joints: str | None, slower: float
) -> None:
    """Write a saved motion in one of the formats of `brachis.export.FORMATS`."""
    from brachis import export  # noqa: PLC0415

    result = motion_file(result)
    chosen, trajectory = export.format_of(out, form), Trajectory.load(result)
    names = None if joints is None else [name.strip() for name in joints.split(",")]
    with shown_warnings():
        write_one(
            out,
            lambda path: export.write(trajectory, path, form=form, dt=dt, last=last, joints=names, slower=slower),
            (chosen.suffix,),
            _sources(result, trajectory),
        )
    period = chosen.dt if dt is None else dt
    if period > trajectory.t_end:
        print_error(f"the period of {period:g} s is longer than the motion, which takes {trajectory.t_end:.6g} s")
    result_console().print(f"wrote {out}")


def plot_command(result: Path, *, out: Path, kind: str) -> None:
    """Draw a saved motion."""
    from brachis.plots import PLOTS, SUFFIXES, check_suffix, save_figure  # noqa: PLC0415

    if kind not in PLOTS:
        raise UnknownNameError("figure", kind, PLOTS, where="--kind")
    check_suffix(out)
    result = motion_file(result)
    trajectory = Trajectory.load(result)
    suffixes = [f".{suffix}" for suffix in SUFFIXES]
    write_one(out, lambda path: save_figure(PLOTS[kind](trajectory), path), suffixes, _sources(result, trajectory))
    result_console().print(f"wrote {out}")


def _sources(result: Path, trajectory: Trajectory) -> list[Path | None]:
    """List the files that a saved motion is read from or was planned for."""
    urdf = trajectory.task.robot.urdf
    return [result, None if urdf is None else Path(urdf)]


def schema_command(out: Path | None, of: str) -> None:
    """Print or write the JSON schema of task files or of exported trajectories."""
    from brachis.export import samples_schema  # noqa: PLC0415

    schemas = {"task": json_schema, "trajectory": samples_schema}
    if of not in schemas:
        raise UnknownNameError("schema", of, schemas, where="--of")
    text = json_text(schemas[of]())
    if out is None:
        sys.stdout.write(text)
        return
    write_one(out, lambda path: write_text(text, path), (".json",))
    result_console().print(f"wrote {out}")
