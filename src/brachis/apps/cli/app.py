"""The Typer application: help, exit codes, the options that several commands share, and how their values are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option
from typer.core import TyperGroup

import brachis
from brachis.common import interrupts
from brachis.common.files import is_file, is_folder
from brachis.common.interrupts import INTERRUPTED
from brachis.errors import (
    BrachisError,
    InputError,
    ResultFileError,
    TaskError,
    UnknownNameError,
)

EXIT_CODES = (
    "0    done; of a plan: planned and verified",
    "1    no verified plan; a bug in brachis; standard output that cannot be written",
    "2    wrong input: a file, a key, an option",
    "3    planned and verified, but a figure could not be written",
    "130  interrupted (Ctrl-C) before there was a motion",
)

EXAMPLES: dict[str, tuple[str, ...]] = {
    "": (
        "brachis new scara3                # a task for an included robot",
        "brachis plan task.yaml --out out  # plan, verify, draw",
    ),
    "robots": ("brachis robots", "brachis robots --json"),
    "new": ("brachis new scara3", "brachis new gantry2 --out gantry.yaml"),
    "plan": (
        "brachis plan task.yaml --out out",
        "brachis plan task.yaml --set search.effort=single --set 'path.0.line.by=[0, 0.4]'",
    ),
    "bottleneck": ("brachis bottleneck task.yaml --set search.effort=single",),
    "verify": ("brachis verify out/result.npz",),
    "export": (
        "brachis export out/result.npz --out out/motion.csv --dt 0.004",
        "brachis export out/result.npz --out out/motion.gif --dt 0.1",
    ),
    "import": ("brachis import out/motion.csv --robot task.yaml --out out/today.npz",),
    "compare": ("brachis compare out/motion.csv --robot task.yaml",),
    "plot": ("brachis plot out/result.npz --kind torques --out out/torques.svg",),
    "report": (
        "brachis report out/result.npz",
        "brachis report out/result.npz --title 'cell 3' --out out/cell3.html",
    ),
    "view": ("brachis view out", "brachis view out/result.npz --port 0 --no-browser"),
    "inspect": (
        "brachis inspect task.yaml",
        "brachis inspect tx90l_rail --task-space pose",
    ),
    "compose": (
        "brachis compose iiwa14 --range -2 2 --velocity 2 --force 1500 --mass 50 --out cell.urdf",
    ),
    "schema": (
        "brachis schema --out task.schema.json",
        "brachis schema --of trajectory",
    ),
    "sweep": (
        "brachis sweep lines.yaml --jobs 2",
        "brachis sweep lines.yaml --retry  # continues a sweep, plans failures again",
    ),
}
"""Examples in the help, by command; those of the whole program under "". They work in this order, with a sweep file."""


class Verbosity(IntEnum):
    """How much a command prints besides errors and what was asked for."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


_VERBOSITY = ContextVar("verbosity", default=Verbosity.NORMAL)


def get_verbosity() -> Verbosity:
    """Return what the command line asks for."""
    return _VERBOSITY.get()


class InterruptedByUserError(BrachisError):
    """The user pressed Ctrl-C."""

    exit_code = INTERRUPTED


class _Commands(TyperGroup):
    """Commands that the user may interrupt, with examples in their help, and the options of all commands."""

    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        """Run a command, its imports included; Ctrl-C that nothing else handled ends it as an error."""
        try:
            with interrupts.interruptible():
                return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            message = "; ".join(filter(None, ("interrupted", str(interrupt))))
            raise InterruptedByUserError(message) from interrupt

    def get_command(self, ctx: typer.Context, cmd_name: str) -> Any:  # type: ignore[override]
        """Find a command; add its examples, and the options that all commands have."""
        command = super().get_command(ctx, cmd_name)
        if command is not None and command.epilog is None:
            command.epilog = _paragraphs("Examples", EXAMPLES[cmd_name])
            command.params += [
                each for each in self.params if each.name in {"quiet", "verbose"}
            ]
        return command

    def resolve_command(self, ctx: typer.Context, args: list[str]) -> Any:  # type: ignore[override]
        """Find a command by its name; where a file stands in its place, name the command that is missing."""
        if self.get_command(ctx, args[0]) is None and is_file(args[0]):
            command = "inspect" if Path(args[0]).suffix == ".urdf" else "plan"
            ctx.fail(f"A command comes before a file: brachis {command} {args[0]}")
        return super().resolve_command(ctx, args)


def _paragraphs(title: str, lines: tuple[str, ...]) -> str:
    """Write lines that the help must not wrap, so that each can be copied."""
    return "\n  ".join((f"\b\n{title}:", *lines))


app = typer.Typer(
    name="brachis",
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=_paragraphs("Examples", EXAMPLES[""])
    + "\n\n"
    + _paragraphs("Exit codes", EXIT_CODES),
)


def _print_version(asked: bool) -> None:
    """Print the version and stop."""
    if asked:
        typer.echo(f"brachis {brachis.__version__}")
        raise typer.Exit


def _set_verbosity(option: typer.CallbackParam, asked: bool) -> None:
    """Remember ``--quiet`` or ``--verbose``."""
    if asked:
        _VERBOSITY.set(Verbosity[str(option.name).upper()])


@app.callback()
def options(
    version: Annotated[
        bool,
        Option(
            "--version",
            callback=_print_version,
            is_eager=True,
            help="Print the version.",
        ),
    ] = False,
    quiet: Annotated[
        bool,
        Option(
            "--quiet",
            "-q",
            callback=_set_verbosity,
            expose_value=False,
            help="Print only errors, and JSON with --json.",
        ),
    ] = False,
    verbose: Annotated[
        bool,
        Option(
            "--verbose",
            "-v",
            callback=_set_verbosity,
            expose_value=False,
            help="Write every step and its time to standard error, and tracebacks of errors.",
        ),
    ] = False,
) -> None:
    """Plan minimum-time motions of redundant robots along prescribed paths."""
    del version, quiet, verbose


Json = Annotated[
    bool, Option("--json", help="Print one JSON object on standard output.")
]
Degrees = Annotated[
    bool, Option("--degrees", help="Show angles in degrees; files and JSON keep rad.")
]
Figures = Annotated[
    bool,
    Option(
        "--figures/--no-figures",
        help="Draw the figures too: that takes some seconds, and needs Matplotlib.",
    ),
]
Strict = Annotated[
    bool | None,
    Option(
        "--strict/--no-strict",
        help="Treat implausible figures, such as degrees for rad, as errors or as warnings. Default: only a start "
        "posture that looks like degrees is an error.",
    ),
]
Changes = Annotated[
    list[str] | None,
    Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the task, for example spline.intervals=40 or path.0.line.length=0.5. The value is YAML. "
        "Repeatable.",
    ),
]
Urdf = Annotated[
    Path | None, Option(help="URDF file to use instead of the one in the task.")
]
ToolFrame = Annotated[str | None, Option(help="Link at the end of the chain.")]
BaseFrame = Annotated[str | None, Option(help="Link at the start of the chain.")]
_MOTIONS = ("result.npz", "unverified.npz")
"""Names of a motion in the folder of ``brachis plan --out``."""


def motion_file(result: Path) -> Path:
    """Return the file of a motion: the one named, or the one in the folder named.

    Raises
    ------
    ResultFileError
        The folder holds no motion.
    """
    if not is_folder(result):
        return result
    for name in _MOTIONS:
        if is_file(result / name):
            return result / name
    raise ResultFileError(
        "this folder contains no motion",
        where=str(result),
        allowed=" or ".join(_MOTIONS),
        hint="Run brachis plan --out",
    )


def task_space_of(text: str | None) -> str | list[str] | None:
    """Read ``--task-space``: a word, or a list of rows."""
    from brachis.robot.task_map.protocol import AXES, YAW

    if text is None:
        return None
    rows = [row.strip() for row in text.split(",") if row.strip()]
    return rows[0] if len(rows) == 1 and rows[0] not in (*AXES, YAW) else rows


def load_changed_task(
    path: Path, changes: Sequence[str] | None, *, strict: bool | None = None
) -> brachis.Task:
    """Load a task file with keys set as in ``spline.intervals=40``, and with ``strict`` if it is given."""
    robots = brachis.robots
    if robots.is_robot(str(path)) and path.suffix == "":
        name = robots.path_of(str(path)).parent.name
        raise TaskError(
            "this is the name of a robot, not of a task file",
            where=name,
            allowed="a task file",
            hint=f"brachis new {name} writes a first task for it",
        )
    return brachis.load_task(path, changes=read_changes(changes, strict=strict))


def read_changes(
    changes: Sequence[str] | None, *, strict: bool | None = None
) -> dict[str, object]:
    """Read the keys that ``--set`` and ``--strict`` set, and their values.

    If a key is set twice, the last value counts.
    """
    from brachis.task import read_assignment

    keys = dict(read_assignment(text) for text in changes or ())
    if strict is not None:
        keys["strict"] = strict
    return keys


def refuse_task_options(given: Mapping[str, object], source: str) -> None:
    """Refuse options of a task if the input is not a task file.

    Parameters
    ----------
    given : mapping of str to object
        The options and their values; None: not given.
    source : str
        What the input is, with its article.

    Raises
    ------
    InputError
    """
    for option, value in given.items():
        if value is not None:
            raise InputError(
                f"this option cannot be used with {source}",
                where=option,
                found=value,
                allowed="this option with a task file",
            )


def urdf_of(given: Path) -> Path:
    """Return the URDF file; of a robot that comes with brachis, given by its name, its file.

    Raises
    ------
    UnknownNameError
        There is neither a file nor a robot of this name.
    """
    if is_file(given) or is_folder(given) or given.suffix or len(given.parts) > 1:
        return given
    robots = brachis.robots
    if str(given) not in robots.names():
        raise UnknownNameError("URDF file or robot", str(given), robots.names())
    return robots.path_of(str(given))
