"""``brachis robots | new | compose``: the commands with which a new user begins."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

import brachis
from brachis.apps.cli.app import Json, urdf_of
from brachis.apps.cli.folder import check_new, write_one, write_text
from brachis.apps.cli.output import (
    print_answer,
    print_json,
    print_lines,
    print_table,
    show_progress,
)


def robots(json: Json = False) -> None:
    """List the included robots.

    Examples
    --------
    brachis robots
    brachis robots --json
    """
    included = brachis.robots
    listed = []
    rows = []
    for name in included.names():
        urdf = included.path_of(name)
        page = urdf.with_name("README.md").read_text(encoding="utf-8")
        what = page.splitlines()[0].partition(": ")[
            2
        ]  # the heading has the form "# name: what it is"
        joints = list(getattr(included, name).joint_names)
        listed.append({"name": name, "what": what, "joints": joints, "urdf": str(urdf)})
        rows.append((name, what, len(joints), ", ".join(joints)))
    if json:
        print_json({"robots": listed})
        return
    columns = ("name", "what it is", "joints", "their names")
    print_table("included robots", columns, rows, numbers=("joints",))
    print_lines(
        *(f"{entry['name']}: {entry['urdf']}" for entry in listed),
        "A name can be used in place of a URDF file: brachis inspect scara3, brachis new scara3",
    )


def new(
    urdf: Annotated[Path, Argument(metavar="URDF")],
    out: Path = Path("task.yaml"),
    tool_frame: str | None = None,
    base_frame: str | None = None,
    json: Json = False,
) -> None:
    """Write a first task for a robot, with comments.

    The task starts in a posture away from limits and singularities and follows a short line. Before the file is
    written, the task is planned and verified.

    Parameters
    ----------
    urdf : path
        URDF file, or the name of an included robot.
    out : path, optional
        Task file to write. The file must not exist yet.

    Examples
    --------
    brachis new scara3
    brachis new gantry2 --out gantry.yaml
    """
    from brachis.apps.starter import starter_task

    check_new(out)
    with show_progress() as listener:
        starter = starter_task(
            urdf_of(urdf),
            folder=out.parent,
            tool_frame=tool_frame,
            base_frame=base_frame,
            listener=listener,
        )
    write_text(starter.text, out)
    result = starter.result
    robot = starter.robot
    joints = list(robot.joint_names)
    print_answer(
        {
            "file": str(out),
            "joint_names": joints,
            "tool_frame": robot.tool_frame,
            "t_end": result.t_end,
            "verified": result.verified,
        },
        f"wrote {out}: {robot.base_frame} -> {robot.tool_frame} with {', '.join(joints)}",
        f"a quick plan was verified: the motion takes {result.t_end:.4f} s; next: brachis plan {out} --out out",
        as_json=json,
    )


Triple = tuple[float, float, float]
_ZERO = (0.0, 0.0, 0.0)


def compose(
    arm: Annotated[Path, Argument(metavar="ARM")],
    travel: Annotated[tuple[float, float], Option("--range")],
    velocity: Annotated[float, Option()],
    force: Annotated[float, Option()],
    mass: Annotated[float, Option()],
    out: Annotated[Path, Option()],
    axis: Triple = (0.0, 1.0, 0.0),
    mount_xyz: Triple = _ZERO,
    mount_rpy_deg: Triple = _ZERO,
    name: str = "rail",
    root: str = "world",
    meshes: bool = True,
    json: Json = False,
) -> None:
    """Mount an arm on a linear axis, as a new URDF.

    You state all the data of the axis; nothing is guessed.

    Parameters
    ----------
    arm : path
        URDF file of the arm, or the name of an included robot.
    travel : (2,) tuple of float
        Minimum and maximum position on the rail, m.
    velocity : float
        Velocity limit of the rail, m/s.
    force : float
        Force limit of the rail's drive, N.
    mass : float
        Mass of the carriage, kg.
    out : path
        URDF file to write.
    axis : (3,) tuple of float, optional
        Direction of the rail in the world frame, written as 0 1 0 or 0,1,0.
    mount_xyz : (3,) tuple of float, optional
        Position of the arm's root link on the carriage, m.
    mount_rpy_deg : (3,) tuple of float, optional
        Roll, pitch and yaw of the arm's root link on the carriage, degrees. 180 0 0 hangs the arm upside down.
    name : str, optional
        Name of the rail's joint.
    root : str, optional
        Name of the root link, which is the world frame.
    meshes : bool, optional
        Keep the arm's meshes, or remove them.

    Examples
    --------
    brachis compose iiwa14 --range -2 2 --velocity 2 --force 1500 --mass 50 --out cell.urdf
    """
    rail = brachis.compose.Rail(
        axis=axis,
        range=travel,
        velocity=velocity,
        force=force,
        mass=mass,
        mount_xyz=mount_xyz,
        mount_rpy=[math.radians(angle) for angle in mount_rpy_deg],
        name=name,
        root=root,
    )
    arm = urdf_of(arm)
    write_one(
        out,
        lambda path: brachis.compose.on_rail(arm, rail, meshes=meshes, output=path),
        (arm,),
    )
    print_answer(
        {"urdf": str(out), "arm": str(arm), "joint": name, "root": root},
        f"wrote {out}",
        as_json=json,
    )
