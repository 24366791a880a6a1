"""The command line: the list of all commands, and what happens when a command fails.

Results go to standard output, everything else to standard error. With ``--json``, a command prints one JSON object on
standard output, even after an error. The exit codes are listed in `brachis.apps.cli.app`.
"""

from __future__ import annotations

import errno
import sys
import traceback
from collections.abc import Callable
from contextvars import copy_context
from functools import wraps
from importlib import import_module
from typing import cast

import typer

from brachis.apps.cli import inspection, motions, planning, recordings, starting
from brachis.apps.cli.app import DocumentedCommand, Verbosity, app, get_verbosity
from brachis.apps.cli.output import (
    open_streams,
    print_failure,
    print_usage_error,
    report_closed_output,
    show_warnings,
)
from brachis.common import interrupts
from brachis.errors import BrachisError

_UsageError = cast("type[Exception]", typer.BadParameter.__bases__[0])
"""Base class of the errors that Typer raises for wrong options. Typer does not export this class."""

_UNWRITABLE = {errno.ENOSPC, errno.EPIPE, errno.EBADF, errno.EIO}
"""Error numbers that mean that a stream cannot be written."""

_COMMANDS: tuple[Callable[..., None], ...] = (
    starting.robots,
    starting.new,
    planning.plan,
    planning.bottleneck,
    motions.verify,
    motions.export,
    motions.plot,
    motions.report,
    motions.view,
    inspection.inspect,
    starting.compose,
    recordings.import_,
    recordings.compare,
    planning.place,
    planning.sweep,
    motions.schema,
)
"""Commands in the order of the help text. Each command has the name of its function."""


def _prepare(command: Callable[..., None]) -> Callable[..., None]:
    """Import the planner before a command runs, and show warnings as messages while it runs.

    Ctrl-C takes effect only after the import, because compiled libraries may swallow it.
    """

    @wraps(command)
    def run(**options: object) -> None:
        """Import the planner, and run the command."""
        with interrupts.defer():
            import_module("brachis.planner")
        with show_warnings():
            command(**options)

    return run


for _command in _COMMANDS:
    _name = _command.__name__.removesuffix("_")
    app.command(_name, cls=DocumentedCommand)(_prepare(_command))


def main() -> None:
    """Run the command line. No exception ends the program with a traceback."""
    open_streams()
    try:
        code = copy_context().run(_run, as_json="--json" in sys.argv[1:])
        sys.stdout.flush()
    except OSError as error:
        report_closed_output(error)
        code = 1
    sys.exit(code)


def _run(*, as_json: bool) -> int:
    """Run a command and return its exit code.

    Raises
    ------
    OSError
        Standard output cannot be written. Errors for other files carry a file name and are not raised.
    """
    try:
        return app(prog_name="brachis", standalone_mode=False) or 0
    except BrachisError as error:
        return print_failure(str(error), error.exit_code, as_json=as_json)
    except _UsageError as error:
        return print_usage_error(error, as_json=as_json)
    except Exception as error:
        is_unnamed = isinstance(error, OSError) and error.filename is None
        if is_unnamed and cast(OSError, error).errno in _UNWRITABLE:
            raise
        if get_verbosity() is Verbosity.VERBOSE:
            traceback.print_exc()
        message = (
            f"internal error: {type(error).__name__}: {error}. This is a bug in brachis; "
            "run again with --verbose for the traceback and report it"
        )
        return print_failure(message, 1, as_json=as_json)
