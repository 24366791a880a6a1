"""Writing files so that a failure leaves the old file, or none, and never half of the new one."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from brachis.errors import InputError


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a temporary file in the folder of `path`; it takes that name once the block has ended without an error.

    Parameters
    ----------
    path : path
        File to write; a symbolic link is followed. Something that is not a regular file (``/dev/stdout``, a named
        pipe) is written in place, for it must not be replaced by a file.

    Yields
    ------
    binary stream

    Raises
    ------
    InputError
        The folder does not exist, or it or the file cannot be written.
    """
    target = Path(path)
    try:
        if target.exists() and not target.is_file():
            with target.open("wb") as stream:
                yield stream
            return
        target = target.resolve()
        temporary = target.with_name(f".{secrets.token_hex(8)}.part")
        try:
            with temporary.open("xb") as stream:  # unlike the tempfile module's, with the permissions of a new file
                yield stream
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise InputError("cannot be written", where=str(path), found=error.strerror or str(error)) from error
