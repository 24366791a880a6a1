"""Writing several files into a folder, all or none."""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from brachis.errors import InputError
from brachis.files import atomic_write, writing_errors

Writer = Callable[[Path], object]
"""Writes one file to a path."""


def make_folder(out: Path) -> None:
    """Make a folder where there is none.

    Raises
    ------
    InputError
        It cannot be made.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("the folder cannot be made", where=str(out), found=error.strerror) from error


def write_files(out: Path, files: Mapping[str, Writer], *, stale: Iterable[str] = ()) -> list[str]:
    """Write files into a temporary folder and then move them, so that a failure leaves the folder as it was.

    Parameters
    ----------
    out : Path
        Folder that exists.
    files : mapping of str to callable
        Names, and what writes each.
    stale : iterable of str, optional
        Files that are removed in the end: the new ones take their place.

    Returns
    -------
    list of str
        Paths of the files.
    """
    for name in files:
        if (out / name).is_dir():
            raise InputError("cannot be written", where=str(out / name), found="a folder of this name")
    temporary = out / f".{secrets.token_hex(8)}.part"
    with writing_errors(out):
        temporary.mkdir()
    try:
        for name, write in files.items():
            try:
                write(temporary / name)
            except InputError as error:  # it names the temporary file
                raise InputError(error.problem, where=str(out / name), found=error.found) from error
        for name in files:
            with writing_errors(out / name):
                (temporary / name).replace(out / name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for name in stale:
        with writing_errors(out / name):
            (out / name).unlink(missing_ok=True)
    return [str(out / name) for name in files]


def write_text(text: str, path: Path) -> None:
    """Write a text file whole or not at all."""
    with atomic_write(path) as stream:
        stream.write(text.encode())
