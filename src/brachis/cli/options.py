"""Options that several commands have."""

from __future__ import annotations

from typing import Annotated

import typer

Strict = Annotated[
    bool | None,
    typer.Option(
        "--strict/--no-strict",
        help="Refuse all implausible figures, such as degrees for rad, or warn of them all; otherwise only a start "
        "posture that looks like degrees is refused.",
    ),
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


def with_strict(changes: list[str] | None, *, strict: bool | None) -> list[str]:
    """Add what ``--strict`` or ``--no-strict`` says to the changes of a task."""
    return [*(changes or []), *([] if strict is None else [f"strict={str(strict).lower()}"])]
