"""How the command line speaks: results on standard output, the rest on standard error."""

from __future__ import annotations

import json
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer
from rich.console import Console
from rich.table import Table

from brachis import interrupts
from brachis.errors import InputError

if TYPE_CHECKING:  # loads Pinocchio, which no error message and no help needs
    from brachis.verify import Verification

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
_NO_FIGURE = 3
"""Exit code of a verified motion whose figures could not all be written."""


def print_error(message: str) -> None:
    """One message on standard error, where that can be written."""
    with suppress(OSError):
        Console(stderr=True, soft_wrap=True, highlight=False, markup=False).print(f"brachis: {message}")


def json_text(data: Mapping[str, object]) -> str:
    """One JSON object as text for files and streams; numbers that JSON does not know become null."""
    return json.dumps(_plain(data), indent=2, allow_nan=False) + "\n"


def print_json(data: Mapping[str, object]) -> None:
    """One JSON object on standard output."""
    sys.stdout.write(json_text(data))


def print_failure(message: str, exit_code: int, *, as_json: bool) -> None:
    """Say on standard error what went wrong; with `as_json` also as one JSON object on standard output."""
    with suppress(OSError):  # `StandardOutput.finish` says so
        if as_json:
            print_json({"verified": False, "status": "error", "error": message, "t_end": None, "exit_code": exit_code})
    print_error(message)


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
    return Console(highlight=False, markup=False, soft_wrap=not sys.stdout.isatty())


@contextmanager
def shown_warnings() -> Iterator[None]:
    """Print warnings of implausible figures as messages on standard error."""
    from brachis.plausibility import PlausibilityWarning  # noqa: PLC0415  (loads Pinocchio)

    with warnings.catch_warnings():
        warnings.simplefilter("always", PlausibilityWarning)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any) -> None:  # noqa: ANN401
            if issubclass(category, PlausibilityWarning):
                print_error(f"warning: {message}")
            else:
                usual(message, category, *where)

        warnings.showwarning = show  # type: ignore[assignment]
        yield


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Give a listener that shows what the planner does on a terminal, and nothing in a pipe; it hears lost Ctrl-C."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _text: interrupts.check()
        return
    with console.status("reading the task") as status:

        def show(text: str) -> None:
            interrupts.check()
            status.update(text, spinner=None)

        yield show


def verification_table(verification: Verification) -> Table:
    """Lay out the checks, one a row."""
    title = "verification: passed" if verification.passed else "verification: FAILED"
    table = Table(title=f"{title} (checked at {verification.points} instants)", title_justify="left")
    for column in ("check", "worst", "allowed", "unit", "of", "time [s]", ""):
        table.add_column(column, justify="right" if column in ("worst", "allowed", "time [s]") else "left")
    for check in verification.checks:
        ratio = check.unit == "-" and check.allowed > 1.0
        table.add_row(
            check.name,
            f"{check.value:.6f}" if ratio else f"{check.value:.1e}",
            f"{check.allowed:.6g}",
            check.unit,
            check.subject or "",
            "" if check.time is None else f"{check.time:.4f}",
            ("ok" if check.passed else "FAILED") + (f" ({check.remark})" if check.remark else ""),
        )
    return table
