"""Writing files: all results or none, then the figures that can be written. Other files are never overwritten.

The function `finish` completes commands that produce a motion: it writes their files, prints the result and what was
not completed, and returns the exit code.
"""

from __future__ import annotations

import shutil
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import brachis
from brachis.apps.cli.output import (
    json_text,
    print_error,
    print_json,
    print_lines,
    show_progress,
)
from brachis.common.files import (
    BEGINNINGS,
    atomic_write,
    check_beginning,
    is_file,
    is_folder,
    temporary_in,
    writing_errors,
)
from brachis.common.progress import Listener
from brachis.common.words import name_first
from brachis.errors import InputError, NotInstalledError

Writer = Callable[[Path], object]
"""Function that writes one file to a path."""
Drawing = Callable[[], Any]
"""Function that draws a Matplotlib figure."""


def check_output(
    out: Path, inputs: Iterable[Path | None], beginning: bytes = b""
) -> None:
    """Raise an error for an output that cannot be written, or that would replace a file that must be kept.

    An output cannot be written if its folder does not exist. An output must not replace a folder, an input of the
    command or a file of a different kind.

    Parameters
    ----------
    out : Path
        File that will be written. A new file may have any name. Devices such as ``/dev/stdout`` are not checked.
    inputs : iterable of Path or None
        Files that the command reads.
    beginning : bytes, optional
        Pattern that matches the beginning of older files of this kind. The pattern is needed only for checks ahead of
        writing, because writing makes this check itself.

    Raises
    ------
    InputError
    """
    problem = "the file cannot be written"
    if is_folder(out):
        raise InputError(problem, where=str(out), found="a folder of this name")
    if not is_folder(out.parent):
        raise InputError(
            problem,
            where=str(out),
            found=f"no folder {out.parent}",
            hint="Create the folder first",
        )
    if not is_file(out):
        return
    for path in inputs:
        with suppress(OSError):  # an input that cannot be read is a different file
            if path is not None and out.samefile(path):
                raise InputError(
                    "the output would overwrite an input file",
                    where=str(out),
                    found="the same file",
                    allowed="another file name",
                )
    check_beginning(out, beginning)


def write_files(
    out: Path,
    results: Mapping[str, Writer],
    figures: Mapping[str, Writer],
    *,
    listener: Listener,
    stale: Iterable[str] = (),
) -> tuple[list[str], list[InputError]]:
    """Write all results or none, and then the figures that can be written.

    The results are written to a temporary folder and then moved, so that a failure leaves the output folder as it was.
    Older figures are removed before new ones are written, because they show an older result.

    Parameters
    ----------
    out : Path
        Existing folder into which the files are written.
    results, figures : mapping of str to callable
        Functions that write the files, by file name.
    listener : callable
        Function that is called with a text that says which figure is being drawn.
    stale : iterable of str, optional
        Names of older files to remove.

    Returns
    -------
    list of str
        Paths of the files that were written.
    list of InputError
        One error for each figure that could not be written.

    Raises
    ------
    InputError
        A result cannot be written.
    KeyboardInterrupt
        Ctrl-C was pressed while figures were drawn. The text of the exception names the files written before.
    """
    written = [str(out / name) for name in results]
    failures = []
    with end_cleanly():
        _write_results(out, results, (*stale, *figures))
        for name, write in figures.items():
            try:
                listener(f"drawing {name}")
                write(out / name)
                written.append(str(out / name))
            except InputError as error:
                failures.append(error)
            except KeyboardInterrupt as press:
                done = ", ".join(written) or "nothing"
                raise KeyboardInterrupt(f"written before: {done}") from press
    return written, failures


def _write_results(
    out: Path, results: Mapping[str, Writer], stale: Iterable[str]
) -> None:
    """Write results to a temporary folder, remove the `stale` files, and move the results to their places."""
    temporary = temporary_in(out)
    with writing_errors(out):
        temporary.mkdir()
    try:
        for name, write in results.items():
            try:
                write(temporary / name)
            except InputError as error:
                error.where = str(out / name)  # not the temporary file
                raise
        for name in stale:
            with writing_errors(out / name):
                (out / name).unlink(missing_ok=True)
        for name in results:
            with writing_errors(out / name):
                (temporary / name).replace(out / name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_one(
    out: Path,
    write: Writer,
    inputs: Iterable[Path | None] = (),
    beginning: bytes = b"",
) -> Any:
    """Write one file unless it would replace a file that `check_output` protects; return what `write` returns."""
    check_output(out, inputs, beginning)
    with end_cleanly():
        return write(out)


def check_new(out: Path | None) -> None:
    """Refuse an output file that exists."""
    if out is not None and (is_file(out) or is_folder(out)):
        raise InputError(
            "the file exists",
            where=str(out),
            allowed="a new file",
            hint="Choose another name with --out",
        )


def write_text(text: str, path: Path) -> None:
    """Write a text file completely or not at all."""
    with atomic_write(path) as stream:
        stream.write(text.encode())


@contextmanager
def end_cleanly() -> Iterator[None]:
    """Make SIGTERM leave the block like an exception, so that temporary files are removed."""
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


_UNVERIFIED = {
    "result.npz": "unverified.npz",
    "result.json": "unverified.json",
    "overview.png": "unverified.png",
    "today.npz": "today.npz",
}
"""File names for a motion that did not pass the verification. All other files get the prefix ``unverified_``."""


def _unverified(name: str) -> str:
    """Return the name of a file if its motion did not pass the verification."""
    return _UNVERIFIED.get(name, f"unverified_{name}")


@contextmanager
def output_folder(
    out: Path | None, names: Sequence[str], inputs: Sequence[Path | None]
) -> Iterator[None]:
    """Create the folder for a motion's files. If the block fails, say which files of an earlier run remain there.

    If `out` is None, nothing is created.

    Raises
    ------
    InputError
        The folder cannot be created or has the name of an existing file, or it contains a file with one of these names
        that `check_output` does not allow to be replaced.
    """
    if out is None:
        yield
        return
    has_suffix = out.suffix in {Path(name).suffix for name in names}
    if is_file(out) or (has_suffix and not is_folder(out)):
        raise InputError(
            "several files need a folder, but this is the name of a file",
            where="--out",
            found=out,
            allowed="a folder",
            hint=f"Write --out {out.with_suffix('')}" if out.suffix else None,
        )
    with writing_errors(out):
        out.mkdir(parents=True, exist_ok=True)
    both = dict.fromkeys((*names, *map(_unverified, names)))
    for name in both:
        check_output(out / name, inputs, BEGINNINGS[Path(name).suffix])
    try:
        yield
    except (Exception, KeyboardInterrupt):
        older = [name for name in both if is_file(out / name)]
        if older:
            print_error(f"files of an earlier run remain in {out}: {', '.join(older)}")
        raise


def finish(
    data: dict[str, Any],
    results: Mapping[str, Writer],
    figures: Mapping[str, Drawing],
    *,
    out: Path | None,
    names: Sequence[str],
    verified: bool,
    json: bool,
    show: Callable[[], None],
    result: brachis.Result | None,
    complaint: str = "it is marked unverified",
) -> int:
    """Write a motion's files, print the result and what was not completed, and return the exit code.

    Parameters
    ----------
    data : dict
        Result of the command: the content of the JSON file and of the output with ``--json``. With ``--json``, the
        files are also listed.
    results : mapping of str to callable
        Functions that write the files of the motion, by file name.
    figures : mapping of str to callable
        Functions that draw the figures, by file name.
    out : Path or None
        Output folder; if it is None, no files are written.
    names : sequence of str
        Names of all files that the command may write. Older files with these names are removed.
    verified : bool
    json : bool
        Whether the result is printed as JSON.
    show : callable
        Function that prints the result as text for a person.
    result : Result or None
        Result of a search, if there was one.
    complaint : str, optional
        Consequence of a failed verification, for the message.
    """
    failures: list[InputError] = []
    if out is not None:
        name_file = str if verified else _unverified
        files = {name_file(name): write for name, write in results.items()}
        (data_file,) = (name_file(name) for name in names if name.endswith(".json"))
        files[data_file] = partial(write_text, json_text(data))
        drawings = {
            name_file(name): partial(draw, make) for name, make in figures.items()
        }
        stale = {*names, *map(_unverified, names)} - {*files}
        with show_progress() as listener:
            data["files"], failures = write_files(
                out, files, drawings, listener=listener, stale=stale
            )
    if json:
        print_json(data)
    else:
        show()
        print_lines(*(f"wrote {name}" for name in data.get("files", ())))
        if out is None and results:
            print_lines("nothing was saved; use --out FOLDER to save the motion")
    if result is not None:
        if result.interrupted:
            print_error("the search ended early; this is the best motion so far")
        for step in result.not_completed:
            print_error(f"not completed: {step}")
    if not verified:
        checks = () if result is None else result.verification.checks
        failed = [
            f"{check.name} {check.in_words()}" for check in checks if not check.passed
        ]
        named = f" ({name_first(failed, '; ')})" if failed else ""
        print_error(
            f"the motion found did not pass the verification{named}; {complaint}"
        )
    return exit_code(verified, failures)


def draw(make: Drawing, path: Path) -> None:
    """Draw a figure and write it."""
    brachis.plots.save_figure(make(), path)


def exit_code(verified: bool, failures: Iterable[InputError]) -> int:
    """Print which figures could not be written, and return the exit code of a command that produces a motion."""
    code = 0
    for reason, failure in {str(failure): failure for failure in failures}.items():
        print_error(f"the result was written, but its figures were not: {reason}")
        if not isinstance(failure, NotInstalledError):
            code = 3
    return code if verified else 1
