"""Figures in notebooks, which know those of pyplot alone."""

from __future__ import annotations

import base64
import io
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 110


@cache
def figure_class() -> type[Figure]:
    """Return a class of Matplotlib's figures that notebooks show without further ado."""
    from matplotlib.figure import Figure  # noqa: PLC0415  (imports in 0.3 s, and only plots need it)

    class NotebookFigure(Figure):
        """A figure that a notebook shows."""

        def _repr_png_(self) -> bytes:
            return _png(self)

    return NotebookFigure


def as_html(figure: Figure) -> str:
    """Return an image element with the figure in it."""
    data = base64.b64encode(_png(figure)).decode()
    return f'<img alt="figure" style="min-width:0;max-width:100%;height:auto" src="data:image/png;base64,{data}"/>'


def _png(figure: Figure) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=_DPI)
    return stream.getvalue()
