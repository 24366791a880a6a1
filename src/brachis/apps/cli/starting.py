"""``brachis robots | new | compose``: what a new user begins with."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperCommand

from brachis.apps.cli.folder import write_one, write_text
from brachis.apps.cli.output import (
    Column,
    Json,
    print_json,
    print_table,
    progress,
    result_console,
    shown_warnings,
)
from brachis.common import interrupts
from brachis.common.files import status_of, writing_errors
from brachis.errors import InputError


def list_robots(json: Json = False) -> None:
    """List the robots that come with brachis."""
    with interrupts.defer():
        from brachis import robots
    listed = [
        {
            "name": name,
            "what": _what(robots.path_of(name)),
            "joints": list(getattr(robots, name).joint_names),
            "urdf": str(robots.path_of(name)),
        }
        for name in robots.names()
    ]
    if json:
        print_json({"robots": listed})
        return
    console = result_console()
    columns = ("name", "what it is", Column("joints", number=True), "their names")
    rows = [
        (each["name"], each["what"], len(each["joints"]), ", ".join(each["joints"]))
        for each in listed
    ]
    print_table(console, "robots that come with brachis", columns, rows)
    for each in listed:
        console.print(f"{each['name']}: {each['urdf']}")
    console.print(
        "A name may stand for the URDF: brachis inspect scara3, brachis new scara3"
    )


def _what(urdf: Path) -> str:
    """Read what a robot is from the heading of its page, ``# name: what it is``."""
    heading = urdf.with_name("README.md").read_text(encoding="utf-8").partition("\n")[0]
    return heading.partition(": ")[2]


def new(
    urdf: Annotated[
        Path,
        typer.Argument(
            help="URDF file, or the name of a robot that comes along.", metavar="URDF"
        ),
    ],
    out: Annotated[Path, typer.Option(help="Task file to write, a new one.")] = Path(
        "task.yaml"
    ),
    tool_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's end.")
    ] = None,
    base_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's beginning.")
    ] = None,
    json: Json = False,
) -> None:
    """Write a first task for a robot, with comments.

    It has a posture away from limits and singularities and a short line that can be reached from it, and it has been
    planned and verified.
    """
    with interrupts.defer():
        from brachis.apps.cli.settings import urdf_of
        from brachis.apps.starter import starter_task
    with writing_errors(out):
        exists = status_of(out) is not None
    if exists:
        raise InputError(
            "the file exists; it may be somebody's work",
            where=str(out),
            allowed="a new file",
            hint="Name one by --out",
        )
    with shown_warnings(), progress() as listener:
        starter = starter_task(
            urdf_of(urdf),
            folder=out.parent,
            tool_frame=tool_frame,
            base_frame=base_frame,
            listener=listener,
        )
    write_text(starter.text, out)
    result, robot = starter.result, starter.robot
    if json:
        print_json(
            {
                "file": str(out),
                "joint_names": list(robot.joint_names),
                "tool_frame": robot.tool_frame,
                "t_end": result.t_end,
                "verified": result.verified,
            }
        )
        return
    console = result_console()
    console.print(
        f"wrote {out}: {robot.base_frame} -> {robot.tool_frame} with {', '.join(robot.joint_names)}"
    )
    console.print(
        f"a quick plan of it takes {result.t_end:.4f} s and is verified; next: brachis plan {out} --out out"
    )


Triple = tuple[float, float, float]


class VectorCommand(TyperCommand):
    """A command whose options of several numbers also take them as one word: ``0 1 0``, ``0,1,0`` or ``"0 1 0"``."""

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
    """Split the word that follows one of `options`, or is joined to it by ``=``, at commas and spaces."""
    words: list[str] = []
    for argument in args:
        option, equals, joined = argument.partition("=")
        if equals and option in options:
            words += [option, *_split(joined)]
        elif words and words[-1] in options:
            words += _split(argument)
        else:
            words.append(argument)
    return words


def _split(word: str) -> list[str]:
    return [part for part in re.split(r"[,\s]+", word) if part] or [word]


def compose(
    arm: Annotated[
        Path,
        typer.Argument(
            help="URDF file of the arm, or the name of a robot.", metavar="ARM"
        ),
    ],
    travel: Annotated[
        tuple[float, float],
        typer.Option("--range", help="Lowest and highest position on the rail, m."),
    ],
    velocity: Annotated[float, typer.Option(help="Limit of the rail's speed, m/s.")],
    force: Annotated[float, typer.Option(help="Limit of the rail's drive force, N.")],
    mass: Annotated[float, typer.Option(help="Mass of the carriage, kg.")],
    out: Annotated[Path, typer.Option(help="URDF file to write.")],
    axis: Annotated[
        Triple,
        typer.Option(help="Direction of the rail in the world frame: 0 1 0 or 0,1,0."),
    ] = (
        0.0,
        1.0,
        0.0,
    ),
    mount_xyz: Annotated[
        Triple, typer.Option(help="Where the arm's root link lies on the carriage, m.")
    ] = (
        0.0,
        0.0,
        0.0,
    ),
    mount_rpy_deg: Annotated[
        Triple,
        typer.Option(
            help="Its roll, pitch and yaw, degrees; 180 0 0 hangs the arm upside down."
        ),
    ] = (0.0, 0.0, 0.0),
    name: Annotated[str, typer.Option(help="Name of the rail's joint.")] = "rail",
    root: Annotated[
        str, typer.Option(help="Name of the root link, the world frame.")
    ] = "world",
    meshes: Annotated[
        bool, typer.Option(help="Keep the arm's meshes, or drop them.")
    ] = True,
    json: Json = False,
) -> None:
    """Mount an arm on a linear axis, as a new URDF.

    No figure of the axis is guessed.
    """
    with interrupts.defer():
        from brachis.apps.cli.settings import urdf_of
        from brachis.apps.compose import Rail, on_rail
    rail = Rail(
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
        lambda path: on_rail(arm, rail, meshes=meshes, output=path),
        (".urdf",),
        (arm,),
    )
    if json:
        print_json({"urdf": str(out), "arm": str(arm), "joint": name, "root": root})
    else:
        result_console().print(f"wrote {out}")
