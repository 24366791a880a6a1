"""Figures to files."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brachis.errors import InputError
from brachis.files import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = ("png", "pdf", "svg")
"""Formats of `save_figure`."""

_DPI = 300
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure as png (300 dpi), pdf or svg, by the suffix of `path`.

    Fonts are embedded in pdf as TrueType, which publishers ask for, and text stays text in svg. The same figure gives
    the same file.

    Parameters
    ----------
    figure : Figure
    path : path
        File to write; an older one is replaced, and kept if writing fails.

    Raises
    ------
    InputError
        The suffix is not one of `SUFFIXES`, or the file cannot be written.
    """
    import matplotlib as mpl  # noqa: PLC0415  (imports in 0.3 s, and only plots need it)

    suffix = check_suffix(path)
    content = io.BytesIO()  # first, so that only errors of writing are reported as such
    fonts: dict[Any, Any] = {"pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "brachis"}
    with mpl.rc_context(fonts):  # these three have no other way in; the context puts them back
        figure.savefig(content, format=suffix, dpi=_DPI, metadata=_METADATA[suffix])
    with atomic_write(path) as stream:
        stream.write(content.getvalue())


def check_suffix(path: str | os.PathLike[str]) -> str:
    """Return the format that the suffix of `path` asks for.

    Raises
    ------
    InputError
        The suffix is not one of `SUFFIXES`.
    """
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in SUFFIXES:
        raise InputError(
            "cannot tell the format of the figure",
            where=str(path),
            found=f"suffix .{suffix}" if suffix else "no suffix",
            allowed=", ".join(f".{name}" for name in SUFFIXES),
        )
    return suffix
