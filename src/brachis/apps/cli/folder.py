"""Writing files: the results all or none, figures beside them where they can be, and nothing over other files."""

from __future__ import annotations

import shutil
import signal
import stat
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from brachis.common.files import (
    atomic_write,
    is_folder,
    status_of,
    temporary_in,
    writing_errors,
)
from brachis.errors import InputError

Writer = Callable[[Path], object]
"""Writes one file to a path."""

_SCHEMA = b'{\n  "$schema": "https://json-schema.org/draft/2020-12/schema",\n  "$id": "urn:brachis:'
BEGINNINGS = {
    ".csv": (b"t,q_", b"# brachis: "),
    ".html": (b"<!doctype html>\n<!-- brachis report -->",),
    ".gif": (b"GIF8",),
    ".json": (b'{\n  "t_end"', b'{\n  "$schema": "urn:brachis:', _SCHEMA),
    ".mcap": (b"\x89MCAP0",),
    ".mp4": (b"\0\0\0\x1cftyp", b"\0\0\0\x20ftyp"),
    ".npz": (b"PK",),
    ".parquet": (b"PAR1",),
    ".pdf": (b"%PDF",),
    ".png": (b"\x89PNG",),
    ".script": (b"def brachis_motion():",),
    ".svg": (b"<?xml", b"<svg"),
    ".urdf": (b"<?xml", b"<robot"),
    ".yaml": (b"# trajectory_msgs/msg/JointTrajectory",),
}
"""How files of our own begin, by suffix; what begins otherwise is somebody else's and is not written over."""


@dataclass(frozen=True)
class Written:
    """What became of files.

    Attributes
    ----------
    files : tuple of str
        Paths of those that were written.
    failures : tuple of InputError
        One for each figure that could not be written.
    """

    files: tuple[str, ...]
    failures: tuple[InputError, ...]


def check_output(
    out: Path, suffixes: Iterable[str], inputs: Iterable[Path | None]
) -> None:
    """Refuse to write over one of the command's inputs, or over a file that is not of the kind that it writes.

    Parameters
    ----------
    out : Path
        What will be written. A new file may have any name, and what is no regular file (``/dev/stdout``) is not looked
        at.
    suffixes : iterable of str
        Those of the format, of `BEGINNINGS`.
    inputs : iterable of Path or None
        Files that the command reads.

    Raises
    ------
    InputError
    """
    with writing_errors(out):
        status = status_of(out)
    if status is None or not stat.S_ISREG(status.st_mode):
        return
    for path in inputs:
        if path is not None and _same(out, path):
            raise InputError(
                "would be written over an input",
                where=str(out),
                found="the same file",
                allowed="another file name",
            )
    suffix, allowed = out.suffix.lower(), tuple(suffixes)
    if suffix not in allowed:
        raise InputError(
            "the file exists and is of another kind",
            where=str(out),
            found=f"suffix {suffix}" if suffix else "no suffix",
            allowed=f"a new file, or one that ends in {' or '.join(allowed)}",
        )
    with writing_errors(out), out.open("rb") as stream:
        beginning = stream.read(max(map(len, BEGINNINGS[suffix])))
    if beginning and not beginning.startswith(BEGINNINGS[suffix]):
        raise InputError(
            "the file exists and was not written by brachis",
            where=str(out),
            found=f"a file that begins with {beginning!r}",
            allowed="a new file, or an older one of the same kind",
        )


def _same(out: Path, path: Path) -> bool:
    """Tell whether two names are of one file; one that cannot be looked at is not the one that we can write."""
    try:
        return out.samefile(path)
    except OSError:
        return False


def make_folder(out: Path, names: Iterable[str], inputs: Iterable[Path | None]) -> None:
    """Make a folder where there is none, and refuse what `check_output` refuses for files of these names.

    Raises
    ------
    InputError
        It cannot be made, or one of the files is not ours to write.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        found = getattr(error, "strerror", None) or str(error)
        raise InputError(
            "the folder cannot be made", where=str(out), found=found
        ) from error
    inputs = tuple(inputs)
    for name in names:
        check_output(out / name, (Path(name).suffix,), inputs)


def write_files(
    out: Path,
    results: Mapping[str, Writer],
    figures: Mapping[str, Writer],
    *,
    stale: Iterable[str] = (),
) -> Written:
    """Write results, all or none, and then the figures that can be written.

    The results are written into a temporary folder and then moved, so that a failure leaves the folder as it was. Then
    all older figures are removed before new ones are written: they belong to another result.

    Parameters
    ----------
    out : Path
        Folder that exists.
    results, figures : mapping of str to callable
        Names, and what writes each.
    stale : iterable of str, optional
        Files that are removed: the new ones take their place.

    Returns
    -------
    Written

    Raises
    ------
    InputError
        A result cannot be written.
    """
    for name in (*results, *figures):
        if is_folder(out / name):
            raise InputError(
                "cannot be written",
                where=str(out / name),
                found="a folder of this name",
            )
    with ended_cleanly():
        _write_results(out, results, (*stale, *figures))
        failures = []
        for name, write in figures.items():
            try:
                write(out / name)
            except InputError as error:
                failures.append(error)
    failed = {error.where for error in failures}
    paths = (str(out / name) for name in (*results, *figures))
    return Written(tuple(path for path in paths if path not in failed), tuple(failures))


def _write_results(
    out: Path, results: Mapping[str, Writer], others: Iterable[str]
) -> None:
    """Write files aside, remove `others`, and move the new files to their places."""
    temporary = temporary_in(out)
    with writing_errors(out):
        temporary.mkdir()
    try:
        for name, write in results.items():
            try:
                write(temporary / name)
            except InputError as error:  # it names the temporary file
                raise InputError(
                    error.problem, where=str(out / name), found=error.found
                ) from error
        for name in others:
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
    suffixes: Iterable[str],
    inputs: Iterable[Path | None] = (),
) -> None:
    """Write one file, unless it would take the place of what `check_output` protects."""
    check_output(out, suffixes, inputs)
    with ended_cleanly():
        write(out)


def write_text(text: str, path: Path) -> None:
    """Write a text file whole or not at all."""
    with atomic_write(path) as stream:
        stream.write(text.encode())


@contextmanager
def ended_cleanly() -> Iterator[None]:
    """Let SIGTERM leave the block as an exception does, so that temporary files are removed."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


def _leave(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
