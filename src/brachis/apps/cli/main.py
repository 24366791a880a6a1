"""The command line: all commands, and how they end.

Results go to standard output, everything else to standard error. With ``--json`` standard output gets one JSON object,
also for an error. The exit codes are in `brachis.apps.cli.app`.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from contextlib import redirect_stdout
from contextvars import copy_context
from functools import partial
from typing import TextIO, cast

import typer

from brachis.apps.cli import (
    inspection,
    motions,
    planning,
    recordings,
    starting,
    sweeps,
)
from brachis.apps.cli.app import Verbosity, app, chosen
from brachis.apps.cli.output import (
    StandardOutput,
    open_streams,
    print_failure,
    print_usage_error,
)
from brachis.errors import BrachisError

_UsageError = cast("type[Exception]", typer.BadParameter.__bases__[0])
"""What Typer raises for wrong options; it names it nowhere else."""

_COMMANDS: dict[str, Callable[..., None]] = {
    "robots": starting.list_robots,
    "new": starting.new,
    "plan": planning.plan,
    "bottleneck": planning.bottleneck,
    "verify": motions.verify,
    "export": motions.export,
    "plot": motions.plot,
    "report": motions.report,
    "view": motions.view,
    "inspect": inspection.inspect,
    "compose": starting.compose,
    "import": recordings.import_,
    "compare": recordings.compare,
    "sweep": sweeps.sweep,
    "schema": motions.schema,
}
"""By name, in the order of the help."""

for _name, _command in _COMMANDS.items():
    app.command(_name, cls=starting.VectorCommand if _name == "compose" else None)(
        _command
    )


def main() -> None:
    """Run the command line; no exception leaves it as a traceback."""
    open_streams()
    output = StandardOutput(sys.stdout)
    with redirect_stdout(cast(TextIO, output)):
        code = copy_context().run(
            partial(_run, output, as_json="--json" in sys.argv[1:])
        )
    sys.exit(code if output.finish() else 1)


def _run(output: StandardOutput, *, as_json: bool) -> int | str | None:
    """Run a command and return its exit code."""
    try:
        return cast("int | None", app(prog_name="brachis", standalone_mode=False)) or 0
    except SystemExit as stop:
        return stop.code
    except BrachisError as error:
        return print_failure(str(error), error.exit_code, as_json=as_json)
    except _UsageError as error:
        return print_usage_error(error, as_json=as_json)
    except Exception as error:  # noqa: BLE001  (whatever it is, it is told and not raised)
        if error is output.failure:
            return 1
        if chosen() is Verbosity.VERBOSE:
            traceback.print_exc()
        message = (
            f"internal error: {type(error).__name__}: {error}. This is a fault of brachis; "
            "run again with --verbose for the traceback and report it"
        )
        return print_failure(message, 1, as_json=as_json)
