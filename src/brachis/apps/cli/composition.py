"""``brachis compose``."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperCommand

from brachis.apps.cli.folder import write_one
from brachis.apps.cli.output import Json, print_json, result_console

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
