"""Writing files so that a failure leaves the old file, or none, and never half of the new one."""

from __future__ import annotations

import io
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from brachis.errors import InputError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


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
        The folder does not exist, or it or the file cannot be written. Other errors of the block are passed on, its
        `OSError` among them.
    """
    with writing_errors(path):
        target = Path(path)
        in_place = target.exists() and not target.is_file()
        target = target if in_place else target.resolve()
        temporary = target if in_place else target.with_name(f".{secrets.token_hex(8)}.part")
        file = _File(temporary, "w" if in_place else "x")  # unlike tempfile's, with the permissions of a new file
    try:
        with io.BufferedWriter(file) as stream:
            yield stream
    except OSError as error:
        if file.failure is None:  # the block's own
            raise
        raise _cannot_be_written(path, file.failure) from error
    else:
        if not in_place:
            with writing_errors(path):
                temporary.replace(target)
    finally:
        if not in_place:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


@contextmanager
def writing_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an `OSError` of the block into an `InputError` that names `path`; for blocks that only write."""
    try:
        yield
    except OSError as error:
        raise _cannot_be_written(path, error) from error


def _cannot_be_written(path: str | os.PathLike[str], error: OSError) -> InputError:
    return InputError("cannot be written", where=str(path), found=error.strerror or str(error))


class _File(io.FileIO):
    """A file that remembers why it could not be written."""

    failure: OSError | None = None

    def write(self, data: ReadableBuffer, /) -> int:
        """Write as `FileIO` does."""
        try:
            return super().write(data)
        except OSError as error:
            self.failure = error
            raise

    def close(self) -> None:
        """Close as `FileIO` does; some file systems report here that a write failed."""
        try:
            super().close()
        except OSError as error:
            self.failure = error
            raise
