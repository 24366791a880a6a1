"""Reading files of bounded size, and writing files so that a failure never leaves an incomplete one.

A new file first has a temporary name, ``.brachis-<host>-<process>-<random>.part``, which tells which process writes it.
A process that is killed cannot remove its temporary file; the next process that writes into the folder removes it.
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
from enum import StrEnum
from pathlib import Path
from typing import BinaryIO

from brachis.errors import InputError, TaskError

LARGEST_TEXT = 16_000_000
"""Maximum size of a text file that brachis reads, bytes."""

COMPOSED = "<!-- brachis compose -->"
"""Second line of a composed URDF, by which it is recognised."""
BEGINNINGS = {
    ".html": rb"<!doctype html>\n<!-- brachis report -->",
    ".json": rb'\{\n  "(t_end"|\$schema": "(https://json-schema[^"]+",\n  "\$id": ")?urn:brachis:)',
    ".npz": rb"PK\x03\x04.{26}meta\.npy",
    ".pdf": rb"%PDF",
    ".png": rb"\x89PNG",
    ".svg": rb"<\?xml|<svg",
    ".urdf": rb'<\?xml version="1\.0"\?>\n' + re.escape(COMPOSED).encode(),
}
"""Patterns for the beginnings of files that brachis writes, by suffix; for exports see `brachis.export.FORMATS`."""

_TEMPORARY = re.compile(r"\.brachis-[0-9a-f]{8}-([0-9]+)-[0-9a-f]{16}\.part")


def is_file(path: str | os.PathLike[str]) -> bool:
    """Return whether a regular file exists; False for a name that the system rejects (`Path.is_file` would raise)."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: str | os.PathLike[str]) -> bool:
    """Return whether a folder exists; see `is_file`."""
    return os.path.isdir(path)  # noqa: PTH112


def read_file(
    path: str | os.PathLike[str],
    largest: int = LARGEST_TEXT,
    *,
    beginning: int | None = None,
) -> bytes:
    """Read a regular file of at most `largest` bytes, or only its first bytes. Pipes and devices are rejected.

    Raises
    ------
    OSError
        The file is missing, cannot be read, is not a regular file, or is too long; ``strerror`` gives the reason.
    """
    try:
        descriptor = os.open(
            path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
        )  # do not wait for a process that writes to a pipe
    except ValueError as error:
        raise OSError(errno.EINVAL, f"not the name of a file: {error}") from error
    try:
        kind = _SPECIAL.get(stat.S_IFMT(os.fstat(descriptor).st_mode))
        if kind is not None:
            text = f"it is {kind}, not a file"
            raise OSError(errno.EINVAL, text, os.fspath(path))
        with os.fdopen(descriptor, "rb", closefd=False) as stream:
            # None: a file of the kernel has no data at the moment.
            content = stream.read(beginning or largest + 1) or b""
    finally:
        os.close(descriptor)
    if len(content) > largest:
        text = f"it is longer than {largest / 1e6:g} MB, the maximum size that brachis reads"
        raise OSError(errno.EFBIG, text, os.fspath(path))
    return content


_SPECIAL = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


def temporary_in(folder: Path) -> Path:
    """Return a new temporary name in a folder, and remove the temporary files that killed processes left there.

    A file is removed only if a brachis process on this host wrote it and that process no longer runs.
    """
    # Several hosts may share a folder; each knows only its own process numbers.
    host = hashlib.sha256(socket.gethostname().encode()).hexdigest()[:8]
    with suppress(OSError):
        for path in folder.glob(f".brachis-{host}-*.part"):
            match = _TEMPORARY.fullmatch(path.name)
            if match is None or _runs(int(match[1])):
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                with suppress(OSError):
                    path.unlink()
    return folder / f".brachis-{host}-{os.getpid()}-{secrets.token_hex(8)}.part"


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # another user's process, or not a process number
        return True
    return True


def file_name(value: object, where: str) -> Path:
    """Return the name of a file as a path.

    Raises
    ------
    InputError
        The value is not the name of a file.
    """
    if not isinstance(value, str | os.PathLike):
        raise InputError(
            "wrong type",
            where=where,
            found=type(value).__name__,
            allowed="the name of a file",
        )
    return Path(value)


def check_suffix(path: str | os.PathLike[str], allowed: str, hint: str) -> None:
    """Reject a file name with the suffix of another format. A name without a suffix, or ending in digits, is accepted.

    Raises
    ------
    InputError
    """
    suffix = file_name(path, "path").suffix
    if suffix and not suffix[1:].isdigit() and suffix.lower() != allowed:
        raise InputError(
            "the suffix belongs to a different format",
            where=os.fspath(path),
            found=suffix,
            allowed=allowed,
            hint=hint,
        )


def check_beginning(path: str | os.PathLike[str], beginning: bytes) -> None:
    """Refuse to replace a file unless it is empty or begins like the files that brachis writes.

    Parameters
    ----------
    path : path
        File to write.
    beginning : bytes
        Pattern that the beginning of an existing file must match.

    Raises
    ------
    InputError
    """
    with writing_errors(path):
        if not is_file(path):
            return
        with Path(path).open("rb") as stream:
            content = stream.read(256)
    if content and not re.match(beginning, content, re.DOTALL):
        raise InputError(
            "the file exists and is of a different kind than the new one",
            where=os.fspath(path),
            found=f"a file that begins with {content[:24]!r}",
            allowed="a new file, or an older one of the same kind",
        )


@contextmanager
def atomic_write(
    path: str | os.PathLike[str], beginning: bytes = b""
) -> Iterator[BinaryIO]:
    """Open a temporary file beside `path`, and rename it to `path` when the block ends without an error.

    Parameters
    ----------
    path : path
        File to write; a symbolic link is followed. Anything but a regular file (``/dev/stdout``, a named pipe) is
        written in place, because a regular file must not replace it.
    beginning : bytes, optional
        Pattern that the beginning of an existing file must match to be replaced. Default: any file may be replaced.

    Yields
    ------
    binary stream

    Raises
    ------
    InputError
        The folder does not exist, the folder or the file cannot be written, or `check_beginning` refuses the file.
        Other errors in the block are passed on, including an `OSError`.
    """
    check_beginning(path, beginning)
    with writing_errors(path):
        target = Path(path)
        in_place = False
        with suppress(FileNotFoundError):
            in_place = not stat.S_ISREG(target.stat().st_mode)
        target = target if in_place else target.resolve()
        temporary = target if in_place else temporary_in(target.parent)
        # Unlike a file from the module tempfile, this new file has the usual permissions.
        file = temporary.open("wb" if in_place else "xb")
    try:
        content = io.BytesIO()
        yield content
        with writing_errors(path):
            with file:
                file.write(content.getbuffer())
            if not in_place:
                temporary.replace(target)
    finally:
        with suppress(OSError):
            file.close()
        if not in_place:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


@contextmanager
def writing_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an `OSError` within the block, or the error for a name with a zero byte, into an `InputError`."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise InputError(
            "the file cannot be written",
            where=str(path),
            found=getattr(error, "strerror", None) or str(error),
        ) from error


def shipped_folder(folder: str) -> Path:
    """Return a folder of files that come with brachis, in the installed package or in the source tree.

    Parameters
    ----------
    folder : {"robots", "examples"}
    """
    package = Path(__file__).parents[1]
    installed = package / "data" / folder
    return installed if installed.is_dir() else package.parents[1] / folder


def shipped_robots() -> tuple[str, ...]:
    """Return the names of the robots that come with brachis, in alphabetical order."""
    files = shipped_folder("robots").glob("*/robot.urdf")
    return tuple(sorted(path.parent.name for path in files))


def absolute_path(name: str, folder: Path) -> str:
    """Return the absolute path of a file relative to `folder`."""
    # Not Path.resolve: a linked folder must keep its own path, because the URDF's meshes may be beside the link.
    return os.path.abspath(folder / name)  # noqa: PTH100


def locate_urdf(name: str, folder: Path) -> str:
    """Return the absolute path of a URDF: a file relative to `folder` or, if there is none, an included robot."""
    local = absolute_path(name, folder)
    included = shipped_folder("robots") / name / "robot.urdf"
    is_name = Path(name).name == name and not is_file(local)
    return str(included) if is_name and is_file(included) else local


def mesh_file(name: str, folder: Path) -> Path | None:
    """Find the mesh file that a URDF in `folder` names by a path, ``file://`` or ``package://``; None if it is missing.

    The folders above the URDF are searched for a package, then the folders of ROS and of this Python installation.
    """
    scheme, separator, within = name.partition("://")
    within = within if separator else name
    above = [folder, *folder.absolute().parents]
    candidates = [place / within for place in above] + ros_files(within)
    for place in (*sys.path, sys.prefix):
        candidates += [
            Path(place, share, within) for share in ("cmeel.prefix/share", "share")
        ]
    if scheme == "package":  # the package may be in a folder with a different name
        candidates += [place / within.partition("/")[2] for place in above]
    return next((path for path in candidates if is_file(path)), None)


def ros_files(within: str) -> list[Path]:
    """List the paths where ROS may have a file of a package, ``<package>/<file>``."""

    def places(variable: str) -> list[Path]:
        """List the folders that an environment variable names."""
        listed = os.environ.get(variable, "").split(os.pathsep)
        return [Path(place) for place in listed if place]

    package, _, inner = within.partition("/")
    roots = places("ROS_PACKAGE_PATH")
    shares = [place / "share" for place in places("AMENT_PREFIX_PATH")]
    inside = [root / inner for root in roots if root.name == package]
    return inside + [root / within for root in roots + shares]


TASK_SUFFIXES = (".yaml", ".yml")
"""Suffixes of task files."""
ROBOT_SUFFIXES = (".urdf", ".xml")
"""Suffixes of robot files: URDF and MJCF."""


class Kind(StrEnum):
    """A kind of file, in words."""

    TASK = "a task file"
    SWEEP = "a sweep file"
    URDF = "a URDF"
    RESULT = "a result"
    FIGURES = "the figures of a plan"


_ADVICE = {
    Kind.TASK: "brachis plan {path} --out out turns it into a result; its key robot.urdf names the URDF",
    Kind.SWEEP: "brachis sweep {path} plans it",
    Kind.URDF: "brachis new {path} writes a task for this robot",
    Kind.RESULT: "brachis verify, plot and bottleneck accept it; the motion was planned from a task file, for a URDF",
    Kind.FIGURES: "The motion itself is in the npz file in the same folder",
}


def kind_of(path: str | os.PathLike[str]) -> Kind | None:
    """Recognise the kind of a file by its beginning; None if the file cannot be read or is of an unknown kind."""
    try:
        content = read_file(path, 4 * LARGEST_TEXT, beginning=16_384)
    except OSError:
        return None
    beginning = content.removeprefix(codecs.BOM_UTF8)
    patterns = {
        Kind.RESULT: rb"\APK",
        Kind.FIGURES: rb'\A\{\n  "t_end"',
        Kind.URDF: rb"(?s)\A\s*(?=<).*<(robot|mujoco)\b",
        Kind.SWEEP: rb"(?m)^sweep\s*:",
        Kind.TASK: rb"(?ms)\A(?!.*^```).*^brachis\s*:",  # but not Markdown
    }
    for kind, pattern in patterns.items():
        if re.search(pattern, beginning):
            return kind
    return None


def is_task_file(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is a task, by its suffix or its beginning."""
    suffix = Path(path).suffix.lower()
    return suffix in TASK_SUFFIXES or kind_of(path) is Kind.TASK


def check_kind(
    path: str | os.PathLike[str], expected: str, error: type[InputError]
) -> None:
    """Reject a file that is recognised as a different kind than expected. A file of an unknown kind is accepted.

    Parameters
    ----------
    path : path
    expected : str
        A `Kind`, or the name of a kind that cannot be recognised.
    error : type
        Class of the error to raise.

    Raises
    ------
    InputError
        The file is of a different kind; the error is of the class `error`.
    """
    kind = kind_of(path)
    if kind not in (None, expected):
        raise error(
            "the file is of a different kind",
            where=os.fspath(path),
            found=kind,
            allowed=expected,
            hint=_ADVICE[kind].format(path=os.fspath(path)),
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
    """Return the content of a text file in UTF-8; all line endings become newlines.

    Parameters
    ----------
    path : Path
        Path of the file to read.
    where : str
        Place shown in messages: the file itself, or the key of the task that names the file.
    folder : Path, optional
        Folder to which paths are relative, for the message about a missing file.
    found : str, optional
        Name of the file, for messages in which `where` is a key.
    largest : int, optional
        Maximum size, bytes; longer files are rejected.
    hint : str, optional
        Advice if the file is too long or, without `folder`, if it is missing.
    error : type, optional
        Class of the error to raise.

    Raises
    ------
    InputError
        An error of the class `error`: the file is missing, is not a text file, is too long, or cannot be read.
    """
    try:
        content = read_file(path, largest).decode()
        return io.IncrementalNewlineDecoder(None, translate=True).decode(content)
    except FileNotFoundError:
        problem = "the file does not exist"
        hint = f"Paths are relative to {folder}" if folder else hint
    except UnicodeDecodeError as refusal:
        problem = f"not a text file in UTF-8: {refusal.reason} at byte {refusal.start}"
        hint = ""
    except OSError as refusal:
        problem = f"the file cannot be read: {refusal.strerror}"
        hint = hint if refusal.errno == errno.EFBIG else ""
    raise error(problem, found=found, where=where, hint=hint or None)
