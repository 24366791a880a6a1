"""The Typer application: help, exit codes, and the options that several commands share, with their parsing."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from enum import IntEnum
from pathlib import Path
from textwrap import indent
from typing import Annotated, Any

import typer
from typer import Option
from typer.core import TyperCommand, TyperGroup

import brachis
from brachis.common import interrupts
from brachis.common.files import ROBOT_SUFFIXES, is_file, is_folder
from brachis.common.interrupts import INTERRUPTED
from brachis.errors import (
    BrachisError,
    InputError,
    ResultFileError,
    TaskError,
    check_names,
)

_EPILOG = """
\b
Examples:
  brachis new scara3                # a task for an included robot
  brachis plan task.yaml --out out  # plan, verify, draw

\b
Exit codes:
  0    done; for a plan: planned and verified
  1    no verified plan; a bug in brachis; standard output could not be written
  2    wrong input: a file, a key, an option
  3    planned and verified, but a figure could not be written
  130  interrupted (Ctrl-C) before there was a motion
"""


class Verbosity(IntEnum):
    """How much a command prints besides errors and its result."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


_VERBOSITY = ContextVar("verbosity", default=Verbosity.NORMAL)


def get_verbosity() -> Verbosity:
    """Return the verbosity set on the command line."""
    return _VERBOSITY.get()


class InterruptedByUserError(BrachisError):
    """The user pressed Ctrl-C."""

    exit_code = INTERRUPTED


class _Commands(TyperGroup):
    """Group of commands that the user can interrupt. The group adds the options that all commands share."""

    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        """Run a command, including its imports.

        A Ctrl-C that nothing else has handled ends the command with an error.
        """
        try:
            with interrupts.interruptible():
                return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            message = "; ".join(filter(None, ("interrupted", str(interrupt))))
            raise InterruptedByUserError(message) from interrupt

    def get_command(self, ctx: typer.Context, cmd_name: str) -> Any:  # type: ignore[override]
        """Find a command, and add the options that all commands share."""
        command = super().get_command(ctx, cmd_name)
        shared = [
            option for option in self.params if option.name in {"quiet", "verbose"}
        ]
        if command is not None and shared[0] not in command.params:
            command.params += shared
        return command

    def resolve_command(self, ctx: typer.Context, args: list[str]) -> Any:  # type: ignore[override]
        """Find a command by its name. If a file is given in its place, name the command that is missing."""
        if self.get_command(ctx, args[0]) is None and is_file(args[0]):
            command = "inspect" if Path(args[0]).suffix in ROBOT_SUFFIXES else "plan"
            ctx.fail(f"A command comes before a file: brachis {command} {args[0]}")
        return super().resolve_command(ctx, args)


_SHARED = """
json : bool, optional
    Print one JSON object on standard output.
degrees : bool, optional
    Show angles in degrees; files and JSON keep rad.
figures : bool, optional
    Also draw the figures. This takes some seconds and needs Matplotlib.
strict : bool, optional
    Treat implausible values, such as degrees in place of rad, as errors, or with --no-strict as warnings. Default:
    only a start posture that looks like degrees is an error.
changes : list of str, optional
    Change a key of the task, for example spline.intervals=40 or path.0.line.length=0.5. The value is YAML. The option
    can be repeated.
urdf : path, optional
    URDF file to use instead of the one in the task.
tool_frame : str, optional
    Link at the end of the chain.
base_frame : str, optional
    Link at the start of the chain.
result : path
    Result file (npz) of 'brachis plan --out', or its folder.
csv : path
    CSV file with columns for time (t, time_ms, ...) and joint positions (j1, q_j1, j1_pos [deg], ...), and for
    velocities (qd_j1, ...) and accelerations (qdd_j1, ...) if known.
robot : path
    URDF file, or task file (.yaml) whose robot, limits and settings are used.
task_space : str, optional
    Task space of the path: rows such as x,y, or one of the words position, pose, pose_free_roll, joints. Default: the
    task space of the task, or the largest one that the robot allows.
angle : str, optional
    Unit of angles in columns whose heading has no unit: rad or deg.
length : str, optional
    Unit of lengths in columns whose heading has no unit: m or mm.
time : str, optional
    Unit of times in a column whose heading has no unit: s or ms.
tolerance : float, optional
    Maximum deviation of the recovered path from the motion, m and rad. Default: 1e-6, or more if the digits in the file
    or the noise are coarser.
noise : float, optional
    Standard deviation of measured positions, rad or m. The positions are smoothed accordingly. Default: the standard
    deviation due to rounding to the digits in the file.
"""
"""Help texts of options that several commands share."""


class DocumentedCommand(TyperCommand):
    """A command whose help text is its docstring, with its options under Parameters and with examples.

    Options that take several numbers accept them as separate words or as one: ``0 1 0``, ``0,1,0`` or ``"0 1 0"``.
    """

    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        docstring = inspect.getdoc(self.callback) or ""  # empty under python -OO
        titles = r"\n\n(Parameters|Examples)\n-+\n"
        self.help, *titled_texts = re.split(titles, docstring)
        sections = dict(zip(titled_texts[::2], titled_texts[1::2], strict=True))
        # Examples are not wrapped in the help text, so that each can be copied.
        self.epilog = f"\b\nExamples:\n{indent(sections.get('Examples', ''), '  ')}"
        entry = re.compile(r"^(\w+) : .*\n((?: +.*\n?)+)", re.MULTILINE)
        described = sections.get("Parameters", "")
        texts = dict(entry.findall(_SHARED) + entry.findall(described))
        parameters: list[Any] = self.params
        for parameter in parameters:
            parameter.help = " ".join(texts.get(parameter.name, "").split())

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Split words that contain several numbers, then read the options."""
        options = {
            name
            for parameter in self.params
            if parameter.nargs > 1
            for name in parameter.opts
        }
        return super().parse_args(ctx, split_vectors(args, options))


def split_vectors(args: Sequence[str], options: set[str]) -> list[str]:
    """Split words at commas and spaces if they follow one of `options`, or are joined to it by ``=``."""
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
        words += [number for number in re.split(r"[,\s]+", value) if number] or [value]
    return words


app = typer.Typer(
    name="brachis",
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=_EPILOG,
)


def _print_version(is_set: bool) -> None:
    """Print the version and exit."""
    if is_set:
        typer.echo(f"brachis {brachis.__version__}")
        raise typer.Exit


def _set_verbosity(option: typer.CallbackParam, is_set: bool) -> None:
    """Store the verbosity that ``--quiet`` or ``--verbose`` asks for."""
    if is_set:
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
            help="Print only errors, and the JSON object of --json.",
        ),
    ] = False,
    verbose: Annotated[
        bool,
        Option(
            "--verbose",
            "-v",
            callback=_set_verbosity,
            expose_value=False,
            help="Write every step with its time, and tracebacks of errors, to standard error.",
        ),
    ] = False,
) -> None:
    """Plan minimum-time motions of redundant robots along prescribed paths."""
    del version, quiet, verbose


Json = Annotated[bool, Option("--json")]
Degrees = Annotated[bool, Option("--degrees")]
Changes = Annotated[list[str] | None, Option("--set", metavar="KEY=VALUE")]
_MOTIONS = ("result.npz", "unverified.npz")
"""File names that a motion may have in the folder written by ``brachis plan --out``."""


def motion_file(result: Path) -> Path:
    """Return the file of a motion: the given file, or the one in the given folder.

    Raises
    ------
    ResultFileError
        The folder contains no motion.
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
    """Read the value of ``--task-space``: a word, or a list of rows."""
    from brachis.robot.task_map.protocol import ROWS

    if text is None:
        return None
    rows = [row.strip() for row in text.split(",") if row.strip()]
    return rows[0] if len(rows) == 1 and rows[0] not in ROWS else rows


def read_changes(
    changes: Sequence[str] | None, *, strict: bool | None = None
) -> dict[str, object]:
    """Read the keys and values given by ``--set`` and ``--strict``.

    If a key is set twice, the last value is used.
    """
    from brachis.task import read_assignment

    keys = dict(read_assignment(text) for text in changes or ())
    if strict is not None:
        keys["strict"] = strict
    return keys


def load_changed_task(path: Path, keys: Mapping[str, object]) -> brachis.Task:
    """Load a task file with changed keys, as returned by `read_changes`."""
    robots = brachis.robots
    if robots.is_robot(str(path)) and path.suffix == "":
        name = robots.path_of(str(path)).parent.name
        raise TaskError(
            "this is the name of a robot, not of a task file",
            where=name,
            allowed="a task file",
            hint=f"brachis new {name} writes a first task for this robot",
        )
    return brachis.load_task(path, changes=keys)


def refuse_options(values: Mapping[str, object], source: str, allowed: str) -> None:
    """Raise an error for options that do not fit the input.

    Parameters
    ----------
    values : mapping of str to object
        The options and their values; None if an option is not given.
    source : str
        What the input is, with an article, for example "a URDF".
    allowed : str
        The input for which the options are meant.

    Raises
    ------
    InputError
    """
    for option, value in values.items():
        if value is not None:
            raise InputError(
                f"this option cannot be used with {source}",
                where=option,
                found=value,
                allowed=f"this option with {allowed}",
            )


def urdf_of(source: Path) -> Path:
    """Return the path of a URDF, given as a file or as the name of an included robot.

    Raises
    ------
    UnknownNameError
        There is neither a file nor a robot with this name.
    """
    if is_file(source) or is_folder(source) or source.suffix or len(source.parts) > 1:
        return source
    check_names("URDF file or robot", [str(source)], brachis.robots.names(), "URDF")
    return brachis.robots.path_of(str(source))
