"""``brachis robots | new | compose``: what a new user begins with."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option
from typer.core import TyperCommand

import brachis
from brachis.apps.cli.app import BaseFrame, Json, ToolFrame, urdf_of
from brachis.apps.cli.folder import write_one, write_text
from brachis.apps.cli.output import (
    print_answer,
    print_json,
    print_lines,
    print_table,
    show_progress,
)
from brachis.common.files import status_of, writing_errors
from brachis.errors import InputError


def list_robots(json: Json = False) -> None:
    """List the included robots."""
    robots = brachis.robots
    listed = []
    rows = []
    for name in robots.names():
        urdf = robots.path_of(name)
        page = urdf.with_name("README.md").read_text(encoding="utf-8")
        what = page.splitlines()[0].partition(": ")[
            2
        ]  # the heading "# name: what it is"
        joints = list(getattr(robots, name).joint_names)
        listed.append({"name": name, "what": what, "joints": joints, "urdf": str(urdf)})
        rows.append((name, what, len(joints), ", ".join(joints)))
    if json:
        print_json({"robots": listed})
        return
    columns = ("name", "what it is", "joints", "their names")
    print_table("included robots", columns, rows, numbers=("joints",))
    print_lines(
        *(f"{each['name']}: {each['urdf']}" for each in listed),
        "A name may stand for the URDF: brachis inspect scara3, brachis new scara3",
    )


def new(
    urdf: Annotated[
        Path,
        Argument(help="URDF file, or the name of an included robot.", metavar="URDF"),
    ],
    out: Annotated[
        Path, Option(help="Task file to write; it must not exist yet.")
    ] = Path("task.yaml"),
    tool_frame: ToolFrame = None,
    base_frame: BaseFrame = None,
    json: Json = False,
) -> None:
    """Write a first task for a robot, with comments.

    The task starts in a posture away from limits and singularities and follows a short line. It has been planned and
    verified.
    """
    from brachis.apps.starter import starter_task

    with writing_errors(out):
        if status_of(out) is not None:
            raise InputError(
                "the file exists",
                where=str(out),
                allowed="a new file",
                hint="Choose another name with --out",
            )
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
        f"a quick plan of it is verified: the motion lasts {result.t_end:.4f} s; next: brachis plan {out} --out out",
        as_json=json,
    )


Triple = tuple[float, float, float]
_ZERO = (0.0, 0.0, 0.0)


class VectorCommand(TyperCommand):
    """A command whose options of several numbers also take one word: ``0 1 0``, ``0,1,0`` or ``"0 1 0"``."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Split such words before the options are read."""
        options = {
            name
            for parameter in self.params
            if parameter.nargs > 1
            for name in parameter.opts
        }
        return super().parse_args(ctx, split_vectors(args, options))


def split_vectors(args: Sequence[str], options: set[str]) -> list[str]:
    """Split the word after one of `options`, or joined to it by ``=``, at commas and spaces."""
    words: list[str] = []
    for argument in args:
        option, equals, value = argument.partition("=")
        if equals and option in options:
            words.append(option)
        elif words and words[-1] in options:
            value = argument
        else:
            words.append(argument)
            continue
        words += [part for part in re.split(r"[,\s]+", value) if part] or [value]
    return words


def compose(
    arm: Annotated[
        Path,
        Argument(
            help="URDF file of the arm, or the name of an included robot.",
            metavar="ARM",
        ),
    ],
    travel: Annotated[
        tuple[float, float],
        Option("--range", help="Lowest and highest position on the rail, m."),
    ],
    velocity: Annotated[float, Option(help="Velocity limit of the rail, m/s.")],
    force: Annotated[float, Option(help="Force limit of the rail's drive, N.")],
    mass: Annotated[float, Option(help="Mass of the carriage, kg.")],
    out: Annotated[Path, Option(help="URDF file to write.")],
    axis: Annotated[
        Triple, Option(help="Direction of the rail in the world frame: 0 1 0 or 0,1,0.")
    ] = (0.0, 1.0, 0.0),
    mount_xyz: Annotated[
        Triple, Option(help="Position of the arm's root link on the carriage, m.")
    ] = _ZERO,
    mount_rpy_deg: Annotated[
        Triple,
        Option(
            help="Roll, pitch and yaw of this link, degrees; 180 0 0 hangs the arm upside down."
        ),
    ] = _ZERO,
    name: Annotated[str, Option(help="Name of the rail's joint.")] = "rail",
    root: Annotated[
        str, Option(help="Name of the root link, which is the world frame.")
    ] = "world",
    meshes: Annotated[bool, Option(help="Keep or remove the arm's meshes.")] = True,
    json: Json = False,
) -> None:
    """Mount an arm on a linear axis, as a new URDF.

    You state all figures of the axis; none is guessed.
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
        (".urdf",),
        (arm,),
    )
    print_answer(
        {"urdf": str(out), "arm": str(arm), "joint": name, "root": root},
        f"wrote {out}",
        as_json=json,
    )
