"""``brachis sweep``: plan a task many times."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import brachis
from brachis.apps.cli.app import Json, Verbosity, get_verbosity
from brachis.apps.cli.folder import Writer, end_cleanly, exit_code, write_files
from brachis.apps.cli.output import (
    print_error,
    print_json,
    print_lines,
    print_table,
    show_progress,
)
from brachis.errors import write_count

if TYPE_CHECKING:
    from brachis.apps.sweeps import SweepResult


def sweep(
    source: Annotated[Path, typer.Argument(help="Sweep file (YAML).", metavar="SWEEP")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for plans, table.parquet, table.csv and sweep.png. Default: one in the current folder, named "
            "as the file. A sweep that was ended continues with what is missing there."
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(help="Processes. Default and largest: the number of processors."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Plan on a cluster: address of a Dask scheduler, such as tcp://host:8786, or its scheduler file."
        ),
    ] = None,
    retry: Annotated[
        bool, typer.Option("--retry", help="Plan stored failures again.")
    ] = False,
    json: Json = False,
) -> None:
    """Plan a task many times, with its keys varied."""
    from brachis.apps.sweeps.plans import VERIFIED

    with end_cleanly(), _progress() as listener:
        result = brachis.sweep(
            source, out, jobs=jobs, scheduler=scheduler, retry=retry, listener=listener
        )
    verified = result.count(VERIFIED) > 0
    figures: dict[str, Writer] = {}
    if result.varied and verified:
        figures["sweep.png"] = lambda path: brachis.plots.save_figure(
            result.plot(), path
        )
    drawn, failures = write_files(result.folder, {}, figures, stale=("sweep.png",))
    files = [*map(str, result.files), *drawn]
    if json:
        print_json({**result.summary(), "keys": list(result.keys), "files": files})
    else:
        _print_sweep(result, files)
    raise typer.Exit(exit_code(verified, failures))


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """Show how far the sweep is: in place on a terminal, otherwise one line on standard error for every 5 %."""
    with show_progress() as status:
        if sys.stderr.isatty() or get_verbosity() is not Verbosity.NORMAL:
            yield status
            return
        last_step = -1

        def listener(text: str) -> None:
            nonlocal last_step
            status(text)
            done = re.match(r"(\d+) of (\d+)", text)
            step = int(done[1]) * 20 // max(1, int(done[2])) if done else -1
            if step != last_step:
                print_error(text)
            last_step = step

        yield listener


def _print_sweep(result: SweepResult, files: Sequence[str]) -> None:
    """Print the sweep for a person."""
    from brachis.apps.sweeps.plans import FAILED, UNVERIFIED, VERIFIED
    from brachis.apps.sweeps.run import write_duration

    found = result.summary()
    counts = ", ".join(
        f"{found[status]} {status}" for status in (VERIFIED, UNVERIFIED, FAILED)
    )
    title = f"sweep: {write_count(found['plans'], 'plan')}, {counts}"
    shown = [name for name in ("best", "median", "worst") if name in found]
    if shown:
        rows = []
        for key in ("t_end_s", "plan", *result.keys):
            heading = "t_end [s]" if key == "t_end_s" else key
            rows.append((heading, *(_write_value(found[name][key]) for name in shown)))
        print_table(title, ("", *shown), rows, numbers=shown)
    else:
        print_lines(title)
    for error, cause in found["failures"].items():
        print_lines(
            f"{cause['plans']} failed with {error}, for example: {cause['message']}"
        )
    print_lines(
        f"planning took {write_duration(found['wall_time_s'])} in all processes together"
    )
    print_lines(*(f"wrote {name}" for name in files))


def _write_value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return "" if value is None else str(value)
