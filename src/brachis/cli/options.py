"""Options that several commands have."""

from __future__ import annotations

from typing import Annotated

import typer

Strict = Annotated[
    bool,
    typer.Option("--strict", help="Refuse figures that are hardly meant, such as degrees for rad, instead of warning."),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the task, dotted as in spline.intervals=40 or path.0.line.length=0.5; the value is YAML. "
        "Repeatable.",
    ),
]
Degrees = Annotated[bool, typer.Option("--degrees", help="Show angles in degrees; files and JSON stay in rad.")]
