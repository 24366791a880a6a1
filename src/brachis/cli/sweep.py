"""``brachis sweep``."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from brachis.cli.folder import ended_cleanly
from brachis.cli.output import exit_code, print_error, print_json, progress, result_console
from brachis.cli.tables import Column, print_table
from brachis.cli.verbosity import Verbosity, chosen
from brachis.errors import InputError, write_count
from brachis.files import writing_errors
from brachis.plots import save_figure
from brachis.sweeps import SweepResult, sweep
from brachis.sweeps.run import in_words
from brachis.sweeps.worker import FAILED, UNVERIFIED, VERIFIED

_STEPS = 20
"""How often progress is told where standard error is no terminal."""
_FIGURE = "sweep.png"


def sweep_command(
    source: Path, *, out: Path | None, jobs: int | None, scheduler: str | None, retry: bool, as_json: bool
) -> int:
    """Run a sweep, show, write; returns the exit code."""
    with ended_cleanly(), _progress() as listener:
        result = sweep(source, out, jobs=jobs, scheduler=scheduler, retry=retry, listener=listener)
    files, failures = [str(path) for path in result.files], []
    figure = result.folder / _FIGURE
    with writing_errors(figure):
        figure.unlink(missing_ok=True)
    if result.varied and result.count(VERIFIED):
        try:
            save_figure(result.plot(), figure)
            files.append(str(figure))
        except InputError as error:
            failures.append(error)
    if as_json:
        print_json({**result.summary(), "keys": list(result.keys), "files": files})
    else:
        _show(result, files)
    return exit_code(result.count(VERIFIED) > 0, failures)


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """Show how far the sweep is: in place on a terminal, else in some lines on standard error, for the logs of jobs."""
    with progress() as status:
        if sys.stderr.isatty() or chosen() is not Verbosity.NORMAL:
            yield status
            return
        told = -1

        def listener(text: str) -> None:
            nonlocal told
            status(text)
            done = re.match(r"(\d+) of (\d+)", text)
            step = int(done[1]) * _STEPS // max(1, int(done[2])) if done else -1
            if step != told:
                print_error(text)
            told = step

        yield listener


def _show(result: SweepResult, files: Sequence[str]) -> None:
    """Print the sweep for a person."""
    console, found = result_console(), result.summary()
    counts = ", ".join(f"{found[status]} {status}" for status in (VERIFIED, UNVERIFIED, FAILED))
    title = f"sweep: {write_count(found['plans'], 'plan')}, {counts}"
    shown = [name for name in ("best", "median", "worst") if name in found]
    if shown:
        keys = {"t_end_s": "t_end [s]", "plan": "plan", **{key: key for key in result.keys}}
        rows = [(words, *(_text(found[name][key]) for name in shown)) for key, words in keys.items()]
        print_table(console, title, ("", *(Column(name, number=True) for name in shown)), rows)
    else:
        console.print(title)
    for error, told in found["failures"].items():
        console.print(f"{told['plans']} failed with {error}, for example: {told['message']}")
    console.print(f"planning took {in_words(found['wall_time_s'])} in all processes together")
    for name in files:
        console.print(f"wrote {name}")


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)
