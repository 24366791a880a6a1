"""How the command line speaks: results on standard output, the rest on standard error."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from brachis import interrupts

if TYPE_CHECKING:  # loads Pinocchio, which no error message and no help needs
    from brachis.result import Result
    from brachis.verify import Verification


def print_error(message: str) -> None:
    """One message on standard error."""
    Console(stderr=True, soft_wrap=True, highlight=False, markup=False).print(f"brachis: {message}")


def json_text(data: Mapping[str, object]) -> str:
    """One JSON object as text for files and streams; numbers that JSON does not know become null."""
    return json.dumps(_plain(data), indent=2, allow_nan=False) + "\n"


def print_json(data: Mapping[str, object]) -> None:
    """One JSON object on standard output."""
    sys.stdout.write(json_text(data))


def print_failure(message: str, exit_code: int, *, as_json: bool) -> None:
    """Say on standard error what went wrong; with `as_json` also as one JSON object on standard output."""
    if as_json:
        print_json({"verified": False, "status": "error", "error": message, "t_end": None, "exit_code": exit_code})
    print_error(message)


def print_what_was_left(result: Result) -> None:
    """Say on standard error that the search was ended early, and what was left undone."""
    if result.interrupted:
        print_error("the search was ended early; this is the best motion so far")
    for undone in result.undone:
        print_error(f"left undone: {undone}")


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
    for column in ("check", "worst", "allowed", "unit", "joint", "time [s]", ""):
        table.add_column(column, justify="right" if column in ("worst", "allowed", "time [s]") else "left")
    for check in verification.checks:
        ratio = check.unit == "-" and check.allowed > 1.0
        table.add_row(
            check.name,
            f"{check.value:.6f}" if ratio else f"{check.value:.1e}",
            f"{check.allowed:.6g}",
            check.unit,
            check.joint or "",
            "" if check.time is None else f"{check.time:.4f}",
            "ok" if check.passed else "FAILED",
        )
    return table
