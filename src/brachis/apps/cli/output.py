"""How the command line speaks: results on standard output, the rest on standard error.

Tables that fit the terminal: text wraps, numbers are neither cut nor wrapped, and what does not fit goes below.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from brachis.apps.cli.app import Verbosity, chosen
from brachis.common import interrupts
from brachis.errors import BrachisWarning, InputError

if TYPE_CHECKING:
    from brachis.verify import Verification

_LONGEST_WORD = 24
"""Longer words of text may be broken."""
_LINED = (3, 1)
"""Characters that lines and padding take, for each column and besides."""
_PLAIN = (2, -2)


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name : str
        Its heading, with the unit of its numbers.
    number : bool
        Whether its cells are numbers.
    """

    name: str
    number: bool = False


def print_table(
    console: Console,
    title: str,
    columns: Sequence[Column | str],
    rows: Iterable[Sequence[object]],
    *,
    header: bool = True,
) -> None:
    """Print a table as wide as the console at most.

    A table that is too wide loses its lines first; then its columns are printed in parts, each beginning with the
    first column.

    Parameters
    ----------
    console : Console
    title : str
    columns : sequence of Column or str
        Of text, where only the name is given. The first one says what a row is about.
    rows : iterable of sequences
        A cell for each column.
    header : bool, optional
        Whether the names of the columns are shown.
    """
    named = [Column(each) if isinstance(each, str) else each for each in columns]
    cells = [[str(cell) for cell in row] for row in rows]
    texts = [
        ([named[i].name] if header else []) + [row[i] for row in cells]
        for i in range(len(named))
    ]
    least = [
        _least(each, text, header=header)
        for each, text in zip(named, texts, strict=True)
    ]
    most = [max(map(cell_len, text), default=0) for text in texts]
    lined = sum(least) + _LINED[0] * len(named) + _LINED[1] <= console.width
    parts = [list(range(len(named)))] if lined else _parts(least, console.width)
    for number, part in enumerate(parts, start=1):
        free = console.width - _around(len(part), lined=lined)
        widths = _widths(
            [named[i] for i in part],
            [least[i] for i in part],
            [most[i] for i in part],
            free,
        )
        told = f"{title} ({number} of {len(parts)})" if len(parts) > 1 else title
        look = box.HEAVY_HEAD if lined else None
        table = Table(
            title=told,
            title_justify="left",
            show_header=header,
            box=look,
            padding=(0, 1),
            pad_edge=lined,
        )
        for i, width in zip(part, widths, strict=True):
            table.add_column(
                named[i].name,
                justify="right" if named[i].number else "left",
                overflow="fold",
                width=width,
            )
        for row in cells:
            table.add_row(*(row[i] for i in part))
        console.print(table)


def _least(column: Column, texts: Sequence[str], *, header: bool) -> int:
    """Count the characters that a column needs: whole numbers, whole words unless they are very long."""
    name, body = (texts[:1], texts[1:]) if header else ([], texts)
    words = [
        cell_len(word)
        for text in (*name, *([] if column.number else body))
        for word in text.split()
    ]
    numbers = [cell_len(text) for text in body] if column.number else []
    return max((*numbers, *(min(word, _LONGEST_WORD) for word in words)), default=1)


def _around(columns: int, *, lined: bool) -> int:
    """Count the characters of a row that are not its cells'."""
    each, besides = _LINED if lined else _PLAIN
    return each * columns + besides


def _parts(least: Sequence[int], width: int) -> list[list[int]]:
    """Share the columns out to tables that fit without lines; the first column is in each."""
    parts = [[0]]
    for i in range(1, len(least)):
        taken = [*parts[-1], i]
        if (
            len(taken) > 2
            and sum(least[k] for k in taken) + _around(len(taken), lined=False) > width
        ):
            parts.append([0, i])
        else:
            parts[-1] = taken
    return parts


def _widths(
    columns: Sequence[Column], least: Sequence[int], most: Sequence[int], free: int
) -> list[int]:
    """Give every column what it needs, and while there is room widen those that wish for more, the narrowest first.

    Where there is no room for what they need, the widest column of text is narrowed.
    """
    widths = list(least)
    texts = [i for i, column in enumerate(columns) if not column.number]
    while sum(widths) > free and max(widths[i] for i in texts) > 1:
        widths[max(texts, key=lambda i: widths[i])] -= 1
    while sum(widths) < free and any(
        width < wish for width, wish in zip(widths, most, strict=True)
    ):
        wishing = [i for i, width in enumerate(widths) if width < most[i]]
        widths[min(wishing, key=lambda i: widths[i])] += 1
    return widths


Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output.")
]
WRONG_INPUT = 2
"""Exit code of what is refused before anything is done."""
_NO_FIGURE = 3
"""Exit code of a verified motion whose figures could not all be written."""


def print_error(message: str) -> None:
    """One message on standard error, where that can be written."""
    with suppress(OSError):
        Console(
            stderr=True, soft_wrap=True, highlight=False, markup=False, emoji=False
        ).print(f"brachis: {message}")


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
            print_json(
                {
                    "verified": False,
                    "status": "error",
                    "error": message,
                    "t_end": None,
                    "exit_code": code,
                }
            )
    print_error(message)
    return code


def print_usage_error(error: Any, *, as_json: bool) -> int:
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


def exit_code(verified: bool, failures: Sequence[InputError]) -> int:
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

    def __getattr__(self, name: str) -> Any:
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
    return Console(
        highlight=False,
        markup=False,
        emoji=False,
        soft_wrap=not sys.stdout.isatty(),
        quiet=quiet,
    )


@contextmanager
def shown_warnings() -> Iterator[None]:
    """Print warnings of brachis as messages on standard error; a quiet command prints none."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", BrachisWarning)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
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


def print_verification(
    console: Console, verification: Verification, *, degrees: bool
) -> None:
    """Print the checks, one a row."""
    title = "verification: passed" if verification.passed else "verification: FAILED"
    rows = [
        (
            check.name,
            *check.figures(degrees=degrees),
            check.subject or "",
            "" if check.time is None else f"{check.time:.4f}",
            ("ok" if check.passed else "FAILED")
            + (f" ({check.remark})" if check.remark else ""),
        )
        for check in verification.checks
    ]
    number = partial(Column, number=True)
    columns = (
        "check",
        number("worst"),
        number("allowed"),
        "unit",
        "of",
        number("time [s]"),
        "",
    )
    print_table(
        console, f"{title} (checked at {verification.points} instants)", columns, rows
    )
