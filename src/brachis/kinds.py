"""What a file is, told from how it begins, and what to do with it where another kind is expected."""

from __future__ import annotations

import codecs
import os
import re
from enum import Enum

from brachis.errors import InputError
from brachis.files import LARGEST_TEXT, read_file

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
        beginning = read_file(path, 4 * LARGEST_TEXT, beginning=_LOOKED_AT).removeprefix(codecs.BOM_UTF8)
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


def check_kind(path: str | os.PathLike[str], expected: Kind | str, error: type[InputError]) -> None:
    """Refuse a file that is of another kind than is expected; what is none of them is for its reader to refuse.

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
