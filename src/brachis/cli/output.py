"""How the command line speaks: results on standard output, the rest on standard error."""

from __future__ import annotations

import json
import math
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer
from rich.console import Console
from rich.text import Text

from brachis import interrupts
from brachis.cli.tables import Column, print_table
from brachis.cli.verbosity import Verbosity, chosen
from brachis.errors import BrachisWarning, InputError

if TYPE_CHECKING:  # loads Pinocchio, which no error message and no help needs
    from brachis.verify import Verification

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
WRONG_INPUT = 2
"""Exit code of what is refused before anything is done."""
_NO_FIGURE = 3
"""Exit code of a verified motion whose figures could not all be written."""


def print_error(message: str) -> None:
    """One message on standard error, where that can be written."""
    with suppress(OSError):
        Console(stderr=True, soft_wrap=True, highlight=False, markup=False, emoji=False).print(f"brachis: {message}")


def json_text(data: Mapping[str, object]) -> str:
    """One JSON object as text for files and streams; numbers that JSON does not know become null."""
    return json.dumps(_plain(data), indent=2, allow_nan=False) + "\n"


def print_json(data: Mapping[str, object]) -> None:
    """One JSON object on standard output."""
    sys.stdout.write(json_text(data))


def print_failure(message: str, code: int, *, as_json: bool) -> int:
    """Say on standard error what went wrong; with `as_json` also as one JSON object on standard output.

    Returns the exit code.
    """
    with suppress(OSError):  # `StandardOutput.finish` says so
        if as_json:
            print_json({"verified": False, "status": "error", "error": message, "t_end": None, "exit_code": code})
    print_error(message)
    return code


def print_usage_error(error: Any, *, as_json: bool) -> int:  # noqa: ANN401  (Typer does not name the class)
    """Say that the command line is not understood, and where help is; the exit code of wrong input."""
    if type(error).__name__ == "NoArgsIsHelpError":
        with suppress(OSError):
            sys.stderr.write(f"{error.ctx.get_help()}\n")
        return WRONG_INPUT
    message = str(error.format_message()).rstrip(".")
    message = message[:1].lower() + message[1:]
    context = error.ctx
    more = "" if context is None else f"; see {context.command_path} --help"
    return print_failure(message + more, WRONG_INPUT, as_json=as_json)


def exit_code(verified: bool, failures: Sequence[InputError]) -> int:  # noqa: FBT001  (what the code is of)
    """Say which figures could not be written, and return the exit code of a motion."""
    for failure in failures:
        print_error(f"the result is written, this figure is not: {failure}")
    if not verified:
        return 1
    return _NO_FIGURE if failures else 0


class StandardOutput:
    """Standard output that remembers why it could not be written.

    Parameters
    ----------
    stream : text stream
        What stands behind it.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.failure: OSError | None = None

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  (whatever the stream has)
        """Pass everything else on."""
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write as the stream does."""
        with self._remembered():
            return self._stream.write(text)

    def flush(self) -> None:
        """Write out what the stream still holds."""
        with self._remembered():
            self._stream.flush()

    @contextmanager
    def _remembered(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.failure = error
            raise

    def finish(self) -> bool:
        """Write out the rest; False where something could not be written, which is said unless a pipe was closed.

        What is left then is thrown away, lest the interpreter tries again at its end.
        """
        with suppress(OSError):
            self.flush()
        if self.failure is None:
            return True
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
        if not isinstance(self.failure, BrokenPipeError):
            print_error(f"standard output cannot be written: {self.failure.strerror}")
        return False


def open_streams() -> None:
    """See to it that there are streams, and that they take any name of a file."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever started this program
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115  (open as long as the program runs)
        reconfigure = getattr(getattr(sys, name), "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


def print_what_was_left(undone: Sequence[str], *, interrupted: bool) -> None:
    """Say on standard error that the search was ended early, where it was, and what was left undone."""
    if interrupted:
        print_error("the search was ended early; this is the best motion so far")
    for each in undone:
        print_error(f"left undone: {each}")


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def result_console() -> Console:
    """Console for results."""
    quiet = chosen() is Verbosity.QUIET
    return Console(highlight=False, markup=False, emoji=False, soft_wrap=not sys.stdout.isatty(), quiet=quiet)


@contextmanager
def shown_warnings() -> Iterator[None]:
    """Print warnings of brachis as messages on standard error; a quiet command prints none."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", BrachisWarning)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any) -> None:  # noqa: ANN401
            if not issubclass(category, BrachisWarning):
                usual(message, category, *where)
            elif chosen() is not Verbosity.QUIET:
                print_error(f"warning: {message}")

        warnings.showwarning = show  # type: ignore[assignment]
        yield


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Give a listener that shows what the planner does; it hears lost Ctrl-C.

    On a terminal it shows the present step; in a pipe, and for a quiet command, nothing. For a verbose one it writes
    every step with its time.
    """
    console = Console(stderr=True)
    if chosen() is Verbosity.VERBOSE:
        yield _log()
        return
    if chosen() is Verbosity.QUIET or not console.is_terminal:
        yield lambda _text: interrupts.check()
        return
    with console.status("reading the task") as status:

        def show(text: str) -> None:
            interrupts.check()
            status.update(Text(text))  # a name may hold brackets

        yield show


def _log() -> Callable[[str], None]:
    """Make a listener that writes every step on a line of its own."""
    began = time.perf_counter()

    def show(text: str) -> None:
        interrupts.check()
        print_error(f"{time.perf_counter() - began:.2f} s: {text}")

    return show


def print_verification(console: Console, verification: Verification, *, degrees: bool) -> None:
    """Print the checks, one a row."""
    title = "verification: passed" if verification.passed else "verification: FAILED"
    rows = [
        (
            check.name,
            *check.figures(degrees=degrees),
            check.subject or "",
            "" if check.time is None else f"{check.time:.4f}",
            ("ok" if check.passed else "FAILED") + (f" ({check.remark})" if check.remark else ""),
        )
        for check in verification.checks
    ]
    number = partial(Column, number=True)
    columns = ("check", number("worst"), number("allowed"), "unit", "of", number("time [s]"), "")
    print_table(console, f"{title} (checked at {verification.points} instants)", columns, rows)
