"""Reading files of bounded size, and writing them so that a failure never leaves half of a new one.

What is written has a temporary name first, ``.brachis-<host>-<process>-<random>.part``, which says whose it is: a
process that was killed cannot remove its own, so that the next one that writes into the folder does.

What a file is, told from how it begins, and what to do with it where another kind is expected.

Reading text files, with errors that say why a file cannot be read.
"""

from __future__ import annotations

import codecs
import errno
import hashlib
import io
import os
import re
import secrets
import shutil
import socket
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from brachis.errors import InputError, TaskError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

LARGEST_TEXT = 16_000_000
"""Of a text file that is read, bytes."""

_TEMPORARY = re.compile(r"\.brachis-([0-9a-f]{8})-([0-9]+)-[0-9a-f]{16}\.part")
_KINDS = {
    stat.S_ISDIR: "a folder",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
}


def status_of(path: str | os.PathLike[str]) -> os.stat_result | None:
    """Return the status of what a name stands for, links followed; None where there is nothing of this name.

    Raises
    ------
    OSError
        The system refuses the name: it is too long, ends in a circle of links, or passes what is not a folder.
    """
    try:
        return Path(path).stat()
    except FileNotFoundError:
        return None


def is_file(path: str | os.PathLike[str]) -> bool:
    """Tell whether there is a regular file; False for a name that the system refuses, where `Path.is_file` raises."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: str | os.PathLike[str]) -> bool:
    """Tell whether there is a folder; see `is_file`."""
    return os.path.isdir(path)  # noqa: PTH112


def read_file(
    path: str | os.PathLike[str],
    largest: int = LARGEST_TEXT,
    *,
    beginning: int | None = None,
) -> bytes:
    """Read a regular file of at most `largest` bytes, or its first bytes; what would never end is refused at once.

    Raises
    ------
    OSError
        The file is missing, cannot be read, is not a regular file, or is longer; ``strerror`` says which.
    """
    try:
        descriptor = os.open(
            path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
        )  # so as not to wait for a pipe's writer
    except ValueError as error:
        raise OSError(errno.EINVAL, f"no name of a file: {error}") from error
    refusal = _refusal(os.fstat(descriptor), largest)
    if refusal is not None:
        os.close(descriptor)
        raise OSError(*refusal, os.fspath(path))
    with os.fdopen(descriptor, "rb") as stream:
        content = (
            stream.read(largest + 1 if beginning is None else beginning) or b""
        )  # None: the kernel says no more
    if (
        len(content) > largest
    ):  # files that the kernel makes up as they are read have no size
        raise OSError(
            errno.EFBIG, f"it is longer than {largest / 1e6:g} MB", os.fspath(path)
        )
    return content


def _refusal(status: os.stat_result, largest: int) -> tuple[int, str] | None:
    """Say why what has this status is not read, as number and text of an `OSError`."""
    kind = next(
        (name for is_kind, name in _KINDS.items() if is_kind(status.st_mode)), None
    )
    if kind is not None:
        return errno.EINVAL, f"it is {kind}, no file"
    if status.st_size > largest:
        return (
            errno.EFBIG,
            f"it is {status.st_size / 1e6:.1f} MB long, at most {largest / 1e6:g} MB are read",
        )
    return None


def temporary_in(folder: Path) -> Path:
    """Return a new temporary name in a folder, from which what killed processes left there is removed.

    Only names of this program are looked at whose process is of this host and runs no more.
    """
    with suppress(OSError):
        for path in folder.iterdir():
            found = _TEMPORARY.fullmatch(path.name)
            if found is not None and found[1] == _host() and not _runs(int(found[2])):
                _remove(path)
    return folder / f".brachis-{_host()}-{os.getpid()}-{secrets.token_hex(8)}.part"


def _host() -> str:
    """Tell hosts apart that share a folder: their process numbers say nothing about each other's."""
    return hashlib.sha256(socket.gethostname().encode()).hexdigest()[:8]


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it is somebody else's, or no number of a process
        return True
    return True


def _remove(path: Path) -> None:
    """Remove a temporary file or folder; where that is not possible it stays."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def check_suffix(path: str | os.PathLike[str], allowed: str, hint: str) -> None:
    """Refuse a file name that ends as one of another format; one without a suffix, or in digits, may have any content.

    Raises
    ------
    InputError
    """
    suffix = Path(path).suffix
    if suffix and not suffix[1:].isdigit() and suffix.lower() != allowed:
        problem = "the suffix is that of another format"
        raise InputError(
            problem, where=os.fspath(path), found=suffix, allowed=allowed, hint=hint
        )


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
        status = status_of(path)
        in_place = status is not None and not stat.S_ISREG(status.st_mode)
        target = target if in_place else target.resolve()
        temporary = target if in_place else temporary_in(target.parent)
        file = _File(
            temporary, "w" if in_place else "x"
        )  # unlike tempfile's, with the permissions of a new file
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
    """Turn an `OSError` of the block, or a name that holds a zero, into an `InputError`; for blocks that only write."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise _cannot_be_written(path, error) from error


def _cannot_be_written(
    path: str | os.PathLike[str], error: OSError | ValueError
) -> InputError:
    return InputError(
        "cannot be written",
        where=str(path),
        found=getattr(error, "strerror", None) or str(error),
    )


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


def shipped_folder(folder: str) -> Path:
    """Return a folder of files that come with brachis: within an installed package, or in the source tree beside it.

    Parameters
    ----------
    folder : {"robots", "examples"}
    """
    package = Path(__file__).parents[1]
    installed = package / "data" / folder
    return installed if installed.is_dir() else package.parents[1] / folder


def mesh_file(name: str, folder: Path) -> Path | None:
    """Find a mesh file that a URDF in `folder` names, plainly or as ``file://`` or ``package://``; None if it is not.

    A package is looked for in the folders above the URDF, then where ROS and this Python installation have packages.
    """
    scheme, given, within = name.partition("://")
    within = within if given else name
    above = [folder, *folder.absolute().parents]
    python = [
        Path(place) / share
        for place in (*sys.path, sys.prefix)
        for share in ("cmeel.prefix/share", "share")
    ]
    found = (
        [place / within for place in above]
        + ros_files(within)
        + [place / within for place in python]
    )
    if scheme == "package":  # which may be in a folder of another name
        found += [place / within.partition("/")[2] for place in above]
    return next((path for path in found if is_file(path)), None)


def ros_files(within: str) -> list[Path]:
    """Name the places where ROS may have a file of a package, ``<package>/<file>``."""
    package, _, inner = within.partition("/")
    roots = [
        Path(place)
        for place in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
        if place
    ]
    shares = [
        Path(place, "share")
        for place in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        if place
    ]
    return [root / inner for root in roots if root.name == package] + [
        root / within for root in roots + shares
    ]


TASK_SUFFIXES = (".yaml", ".yml")
"""Suffixes of task files."""
_LOOKED_AT = 16_384
"""Bytes at the beginning of a file."""
_TASK = re.compile(rb"^brachis\s*:", re.MULTILINE)
_SWEEP = re.compile(rb"^sweep\s*:", re.MULTILINE)
_FIGURES = b'{\n  "t_end"'


class Kind(Enum):
    """A kind of file, in words."""

    TASK = "a task file"
    SWEEP = "a sweep file"
    URDF = "a URDF"
    RESULT = "a result"
    FIGURES = "the figures of a plan"


_ADVICE = {
    Kind.TASK: "brachis plan {path} --out out makes a result of it; its key robot.urdf names its URDF",
    Kind.SWEEP: "brachis sweep {path} plans it",
    Kind.URDF: "brachis new {path} writes a task for it",
    Kind.RESULT: "brachis verify, plot and bottleneck take it; it was planned from a task file, for a URDF",
    Kind.FIGURES: "The motion itself is in the npz file beside it",
}


def kind_of(path: str | os.PathLike[str]) -> Kind | None:
    """Tell what a file is; None where it cannot be read, or is something else."""
    try:
        beginning = read_file(
            path, 4 * LARGEST_TEXT, beginning=_LOOKED_AT
        ).removeprefix(codecs.BOM_UTF8)
    except OSError:
        return None
    if beginning.startswith(b"PK"):
        return Kind.RESULT
    if beginning.startswith(_FIGURES):
        return Kind.FIGURES
    if re.search(rb"<robot\b", beginning) and beginning.lstrip().startswith(b"<"):
        return Kind.URDF
    if _SWEEP.search(beginning):
        return Kind.SWEEP
    return Kind.TASK if _TASK.search(beginning) else None


def check_kind(
    path: str | os.PathLike[str], expected: Kind | str, error: type[InputError]
) -> None:
    """Refuse a file that is of another kind than is expected; unknown kinds are for the reader to refuse.

    Parameters
    ----------
    path : path
    expected : Kind or str
        In words where it is a kind that cannot be told.
    error : type
        What is raised.

    Raises
    ------
    InputError
        Of the class `error`.
    """
    found = kind_of(path)
    if found not in (None, expected):
        raise error(
            "the file is of another kind",
            where=os.fspath(path),
            found=found.value,
            allowed=expected.value if isinstance(expected, Kind) else expected,
            hint=_ADVICE[found].format(path=os.fspath(path)),
        )


def read_text(
    path: Path,
    *,
    where: str,
    folder: Path | None = None,
    found: str | None = None,
    largest: int = LARGEST_TEXT,
    hint: str = "",
    error: type[InputError] = TaskError,
) -> str:
    """Return the content of a text file in UTF-8; all line ends become newlines.

    Parameters
    ----------
    path : Path
        The file.
    where : str
        Place that messages name: the file itself, or the key that asks for it.
    folder : Path, optional
        What relative paths are relative to, for the message about a missing file.
    found : str, optional
        The file, for messages whose place is a key.
    largest : int, optional
        Longer files are refused, bytes.
    hint : str, optional
        What to try if the file is too long; without a folder also if it is missing.
    error : type, optional
        What is raised.

    Raises
    ------
    InputError
        Of the class `error`: the file is missing, is not a text file, too long, or cannot be read.
    """
    try:
        content = read_file(path, largest).decode()
        return io.IncrementalNewlineDecoder(None, translate=True).decode(content)
    except FileNotFoundError:
        problem = "there is no such file"
        hint = f"Paths are relative to {folder}" if folder else hint
    except UnicodeDecodeError as refusal:
        problem = f"not a text file in UTF-8: {refusal.reason} at byte {refusal.start}"
        hint = ""
    except OSError as refusal:
        problem = f"the file cannot be read: {refusal.strerror}"
        hint = hint if refusal.errno == errno.EFBIG else ""
    raise error(problem, found=found, where=where, hint=hint or None)
