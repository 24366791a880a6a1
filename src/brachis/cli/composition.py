"""``brachis compose``."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import typer
from typer.core import TyperCommand

from brachis.cli.folder import write_one
from brachis.cli.output import print_json, result_console

Triple = tuple[float, float, float]


class VectorCommand(TyperCommand):
    """A command whose options of several numbers also take them as one word: ``0 1 0``, ``0,1,0`` or ``"0 1 0"``."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Split such words before the options are read."""
        options = {name for parameter in self.params if parameter.nargs > 1 for name in parameter.opts}
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


def compose_command(
    arm: Path,
    *,
    axis: Triple,
    travel: tuple[float, float],
    velocity: float,
    force: float,
    mass: float,
    mount_xyz: Triple,
    mount_rpy_deg: Triple,
    name: str,
    root: str,
    meshes: bool,
    out: Path,
    as_json: bool,
) -> None:
    """Write the URDF of an arm on a rail."""
    from brachis.compose import on_rail  # noqa: PLC0415  (loads Pinocchio, which no help needs)

    compose = partial(
        on_rail,
        arm,
        axis=axis,
        range=travel,
        velocity=velocity,
        force=force,
        mass=mass,
        mount_xyz=mount_xyz,
        mount_rpy=[math.radians(angle) for angle in mount_rpy_deg],
        name=name,
        root=root,
        meshes=meshes,
    )
    write_one(out, lambda path: compose(output=path), (".urdf",), (arm,))
    if as_json:
        print_json({"urdf": str(out), "arm": str(arm), "joint": name, "root": root})
    else:
        result_console().print(f"wrote {out}")
