"""Output of the command line: results go to standard output, everything else to standard error."""

from __future__ import annotations

import json
import math
import os
import sys
import time
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.cells import cell_len
from rich.console import Console, JustifyMethod
from rich.table import Table
from rich.text import Text

from brachis.apps.cli.app import Verbosity, get_verbosity
from brachis.common import interrupts
from brachis.errors import BrachisWarning, InputError

if TYPE_CHECKING:
    from brachis.apps.controller import RunReport
    from brachis.apps.export import ProgramReport
    from brachis.path import Path as ToolPath
    from brachis.task import FitReport
    from brachis.verify import Verification

_BEGAN = time.perf_counter()
"""Time at which the command line was loaded, s. Verbose output counts the time of each step from this moment."""


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    numbers: Collection[str] = (),
) -> None:
    """Print a table that fits the terminal. Text is wrapped; numbers are neither cut nor wrapped.

    A table that is too wide is printed without lines. If the table is still too wide, its columns are spread over
    several tables, each of which repeats the first column.

    Parameters
    ----------
    title : str
    columns : sequence of str
        Headings, with units. The first column says what each row is about. If all headings are empty, the table has no
        header.
    rows : iterable of sequences
        Each row has one cell per column.
    numbers : collection of str, optional
        Headings of the columns that contain numbers.
    """
    console = result_console()
    cells = [[str(cell) for cell in row] for row in rows]
    least = []
    for i, name in enumerate(columns):
        texts = [row[i] for row in cells]
        is_number = name in numbers
        words = " ".join([name] if is_number else [name, *texts]).split()
        shortened = [min(cell_len(word), 24) for word in words]  # longer ones break
        uncut = map(cell_len, texts if is_number else ())
        least.append(max((1, *shortened, *uncut)))
    is_lined = sum(width + 3 for width in least) + 1 <= console.width
    column_groups = [[*range(len(columns))]]
    if not is_lined:
        column_groups = _split_columns(least, console.width)
    for number, indices in enumerate(column_groups, start=1):
        count = f" ({number} of {len(column_groups)})" if len(column_groups) > 1 else ""
        table = Table(
            title=title + count,
            title_justify="left",
            show_header=any(columns),
            box=box.HEAVY_HEAD if is_lined else None,
            padding=(0, 1),
            pad_edge=is_lined,
        )
        for i in indices:
            is_number = columns[i] in numbers
            side: JustifyMethod = "right" if is_number else "left"
            table.add_column(columns[i], justify=side, overflow="fold")
        for row in cells:
            table.add_row(*(row[i] for i in indices))
        unlimited = console.options.update_width(10_000)
        if console.measure(table, options=unlimited).maximum > console.width:
            for i, column in zip(indices, table.columns, strict=True):
                column.width = least[i] if columns[i] in numbers else None
        console.print(table)


def _split_columns(least: Sequence[int], width: int) -> list[list[int]]:
    """Distribute the columns over tables without lines that fit the width. Each table contains the first column."""
    column_groups = [[0]]
    for i in range(1, len(least)):
        indices = [*column_groups[-1], i]
        if len(indices) > 2 and sum(least[k] + 2 for k in indices) - 2 > width:
            column_groups.append([0, i])
        else:
            column_groups[-1] = indices
    return column_groups


def print_verification(verification: Verification, *, degrees: bool) -> None:
    """Print the checks of a verification, one per row."""
    from brachis.verify import POSITION_SCALE

    verdict = "passed" if verification.passed else "FAILED"
    rows = []
    scales = []
    for check in verification.checks:
        outcome = "ok" if check.passed else "FAILED"
        if check.remark == POSITION_SCALE:
            scales.append(f"{check.name}: {check.remark}")
        elif check.remark:
            outcome += f" ({check.remark})"
        time_text = "" if check.time is None else f"{check.time:.4f}"
        figures = check.figures(degrees=degrees)
        rows.append((check.name, *figures, check.subject or "", time_text, outcome))
    print_table(
        f"verification: {verdict} (checked at {verification.points} instants)",
        ("check", "worst", "allowed", "unit", "of", "time [s]", ""),
        rows,
        numbers=("worst", "allowed", "time [s]"),
    )
    print_lines(*scales)
    print_lines(
        *(f"{margin.name}: {margin.in_words()}" for margin in verification.margins)
    )


def print_run(report: RunReport | ProgramReport, *, json: bool) -> int:
    """Print how a motion runs on a controller; return the exit code."""
    from brachis.apps.controller import RunReport

    remedies: tuple[str, ...] = ()
    if json:
        print_json(report.to_dict())
    elif isinstance(report, RunReport):
        print_lines(
            f"as {report.controller} runs it, every {1e3 * report.period:g} ms:"
        )
        print_verification(report, degrees=False)
        remedies = report.remedies
    else:
        print_table("program", ("", ""), report.summary().items())
    if report.passed:
        return 0
    reasons = ("the motion exceeds limits as it is run", *report.failures)
    print_error("\n".join([*reasons, *remedies]))
    return 1


def print_segments(path: ToolPath) -> None:
    """Print, for a tool path of several segments, s and the distance from the path's start where each segment ends."""
    ends = {
        span.segments: f"path[{span.segments[0]}] at s = {s:.4g} ({1e3 * path.between(0.0, s).length:.4g} mm)"
        for span, s in zip(path.spans, path.breaks[1:], strict=True)
        if len(span.segments) == 1 and path.positions
    }
    if len(ends) > 1:
        print_lines(f"ends of the segments: {', '.join(ends.values())}")


def print_fit(fit: FitReport) -> None:
    """Print what was read from a file of points, how close the fitted path is to the points, and the path's corners."""
    print_lines(f"path from {fit}")
    if fit.corners:
        is_blended = any(corner.blend for corner in fit.corners)
        what = (
            "rounded within the tolerance" if is_blended else "at which the tool stops"
        )
        columns = ("row", "angle [deg]", "at [mm]", "blend [mm]")
        rows = [
            (
                corner.row,
                f"{math.degrees(corner.angle):.4g}",
                f"{1e3 * corner.distance:.6g}",
                f"{1e3 * corner.blend:.4g}",
            )
            for corner in fit.corners
        ]
        print_table(f"corners, {what}", columns, rows, numbers=columns)


def write_posture(data: Mapping[str, Any], key: str, *, degrees: bool) -> str:
    """Write a posture with joint names and units; None stands for a free posture."""
    from brachis.robot.joints import shown_unit

    if data[key] is None:
        return "free"
    positions = []
    columns = (data["joint_names"], data[key], data["position_units"])
    for name, value, si_unit in zip(*columns, strict=True):
        unit, factor = shown_unit(si_unit, degrees=degrees)
        positions.append(f"{name} {factor * value:z.4f} {unit}")
    return ", ".join(positions)


def print_error(message: str) -> None:
    """Print one message on standard error, if it can be written to."""
    with suppress(OSError):
        sys.stderr.write(f"brachis: {message}\n")
        sys.stderr.flush()


def json_text(data: Mapping[str, object]) -> str:
    """Return one JSON object as text. NaN and infinities, which JSON lacks, become null."""
    # The module json writes NaN and infinities as constants; here it reads them back as None.
    plain = json.loads(json.dumps(data), parse_constant=lambda _: None)
    return json.dumps(plain, indent=2) + "\n"


def print_json(data: Mapping[str, object]) -> None:
    """Print one JSON object on standard output."""
    sys.stdout.write(json_text(data))


def print_failure(message: str, code: int, *, as_json: bool) -> int:
    """Print an error on standard error, and with `as_json` also as JSON on standard output; return the exit code."""
    print_error(message)
    if as_json:
        failure = {
            "verified": False,
            "status": "error",
            "error": message,
            "t_end": None,
            "exit_code": code,
        }
        print_json(failure)
    return code


def print_usage_error(error: Any, *, as_json: bool) -> int:
    """Print why the command line was not understood, and where to find help; return the exit code."""
    if type(error).__name__ == "NoArgsIsHelpError":
        with suppress(OSError):
            sys.stderr.write(f"{error.ctx.get_help()}\n")
        return InputError.exit_code
    message = str(error.format_message()).rstrip(".")
    message = message[:1].lower() + message[1:]
    if error.ctx is not None:
        message += f"; see {error.ctx.command_path} --help"
    return print_failure(message, InputError.exit_code, as_json=as_json)


def report_closed_output(error: OSError) -> None:
    """Say why standard output cannot be written, unless a pipe was closed.

    The rest of the output goes to the null device, so that the interpreter does not try to write this output at exit.
    """
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if not isinstance(error, BrokenPipeError):
        print_error(f"standard output cannot be written: {error.strerror}")


def open_streams() -> None:
    """Open standard output and standard error if they are closed, and let them print any file name."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever started this program
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115  (open as long as the program runs)
        reconfigure = getattr(getattr(sys, name), "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


def result_console() -> Console:
    """Return the console on which results are printed."""
    return Console(
        highlight=False,
        markup=False,
        emoji=False,
        soft_wrap=not sys.stdout.isatty(),
        quiet=get_verbosity() is Verbosity.QUIET,
    )


def print_lines(*lines: str) -> None:
    """Print the lines of a result."""
    for line in lines:
        result_console().print(line)


def print_answer(data: Mapping[str, object], *lines: str, as_json: bool) -> None:
    """Print a result, either as JSON or as lines for a person."""
    if as_json:
        print_json(data)
    else:
        print_lines(*lines)


@contextmanager
def show_warnings() -> Iterator[None]:
    """Print warnings of brachis as messages on standard error. A quiet command prints no warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", BrachisWarning)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
            """Print a warning of brachis as a message, and any other warning as usual."""
            if not issubclass(category, BrachisWarning):
                usual(message, category, *where)
            elif get_verbosity() is not Verbosity.QUIET:
                print_error(f"warning: {message}")

        warnings.showwarning = show  # type: ignore[assignment]
        yield


@contextmanager
def show_progress() -> Iterator[Callable[[str], None]]:
    """Yield a listener that shows the current step and notices Ctrl-C.

    On a terminal, the listener shows only the current step. A verbose command prints every step with the time since the
    command line was loaded.
    """
    verbosity = get_verbosity()
    is_shown = verbosity is Verbosity.NORMAL
    # On a terminal, a quiet console would swallow the output of other writers.
    console = Console(
        stderr=True, quiet=not is_shown, force_terminal=None if is_shown else False
    )
    with console.status("working") as status:

        def show(text: str) -> None:
            """Show the current step as the verbosity requires."""
            interrupts.check()
            if verbosity is Verbosity.VERBOSE:
                print_error(f"{time.perf_counter() - _BEGAN:.2f} s: {text}")
            else:
                status.update(Text(text))  # a name may contain brackets

        yield show
