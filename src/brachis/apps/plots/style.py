"""Settings and functions that all figures share: sizes, fonts, colours, axes, legends, files, notebooks.

All settings are made on the individual figure. Matplotlib's global settings are not changed.
"""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.common.files import BEGINNINGS, atomic_write, file_name
from brachis.errors import InputError, NotInstalledError
from brachis.trajectory import MotionPart, MotionPhase, Trajectory

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DPI = 300
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}
SUFFIXES = tuple(_METADATA)
"""File formats of `save_figure`."""


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure as png (300 dpi), pdf or svg, according to the suffix of `path`.

    Fonts are embedded in pdf files as TrueType, as publishers require, and text remains text in svg files. The same
    figure always gives the same file.

    Parameters
    ----------
    figure : Figure
    path : path
        File to write. An older figure of this format is replaced; if writing fails, the older figure is kept.

    Raises
    ------
    InputError
        The suffix is not one of `SUFFIXES`, the file cannot be written, or an existing file is not a figure of this
        format.
    """
    import matplotlib as mpl

    suffix = check_suffix(path)
    fonts: dict[Any, Any] = {
        "pdf.fonttype": 42,
        "svg.fonttype": "none",
        "svg.hashsalt": "brachis",
    }
    # These three settings can only be made globally; the context restores them.
    beginning = BEGINNINGS[f".{suffix}"]
    with mpl.rc_context(fonts), atomic_write(path, beginning) as stream:
        figure.savefig(stream, format=suffix, dpi=_DPI, metadata=_METADATA[suffix])


def check_suffix(path: str | os.PathLike[str]) -> str:
    """Return the file format given by the suffix of `path`.

    Raises
    ------
    InputError
        The suffix is not one of `SUFFIXES`.
    """
    suffix = file_name(path, "path").suffix.lower().removeprefix(".")
    if suffix not in SUFFIXES:
        raise InputError(
            "the suffix of the figure does not belong to a known format",
            where=str(path),
            found=f"suffix .{suffix}" if suffix else "no suffix",
            allowed=", ".join(f".{name}" for name in SUFFIXES),
        )
    return suffix


@cache
def figure_class() -> type[Figure]:
    """Return a subclass of Matplotlib's figures that notebooks display.

    Raises
    ------
    NotInstalledError
        Matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise NotInstalledError("a figure", "Matplotlib", "plots") from None

    class NotebookFigure(Figure):
        """A figure that a notebook displays."""

        def _repr_png_(self) -> bytes:
            return _png(self)

    return NotebookFigure


def as_html(figure: Figure) -> str:
    """Return an HTML image element that contains the figure."""
    data = base64.b64encode(_png(figure)).decode()
    return f'<img alt="figure" style="min-width:0;max-width:100%;height:auto" src="data:image/png;base64,{data}"/>'


def _png(figure: Figure) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()


COLUMN_WIDTH = 89.0
"""Width of one column of a journal, mm."""
PAGE_WIDTH = 183.0
"""Width of two columns of a journal, mm."""
LABEL_SIZE = 8.0
"""Font size of axis labels, points."""
TICK_SIZE = 7.0
"""Font size of all other text, points."""
LINE_WIDTH = 1.2
"""Width of data lines, points."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""The colours of Okabe and Ito, which colour-blind readers can distinguish, without yellow, which is too faint on
white.
"""
DASHES: tuple[tuple[float, ...], ...] = (
    (),
    (6.0, 1.6),
    (1.2, 1.2),
    (6.0, 1.6, 1.2, 1.6),
    (2.6, 1.2),
    (6.0, 1.3, 1.2, 1.3, 1.2, 1.3),
)
"""Dashes that differ in greyscale print. There is one fewer than colours, so that the joints of long chains differ."""
HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----")
"""Hatchings of bars, which differ in greyscale print."""
LIMIT: dict[str, Any] = {
    "linewidth": 0.7,
    "linestyle": (0, (4.0, 2.0)),
    "zorder": 1.0,
    "gid": "limit",
}
"""Line properties of limits in all figures."""
GREY = "#666666"
_EVENT = "#B00060"
"""Colour of events."""
_LETTER = 0.021
"""Width of a letter as a fraction of the width of a panel; wider names of parts are written upwards."""
FAINT = "#CFCFCF"


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure of `width` times `height`, mm, without changing any global state."""
    size = (width / 25.4, height / 25.4)
    figure = figure_class()(figsize=size, layout="constrained", facecolor="white")
    figure.get_layout_engine().set(w_pad=0.03, h_pad=0.03, wspace=0.04, hspace=0.04)  # type: ignore[union-attr,call-arg]
    return figure


def joint_style(joint: int) -> dict[str, Any]:
    """Return the line properties of the joint with this index: a colour and, for greyscale print, a line style."""
    return {
        "color": COLOURS[joint % len(COLOURS)],
        "linestyle": (0.0, DASHES[joint % len(DASHES)]),
        "linewidth": LINE_WIDTH,
    }


def limit_dashes(place: int, sharing: int) -> tuple[float, tuple[float, float]]:
    """Return the line style of a limit that several joints share: each joint's dashes lie in the gaps of the others."""
    period = 6.0 * sharing
    return (period - 6.0 * place) % period, (4.0, period - 4.0)


def dress(ax: Axes, xlabel: str, ylabel: str) -> None:
    """Set the labels, fonts and spines of one pair of axes."""
    ax.set_xlabel(xlabel, fontsize=LABEL_SIZE)
    ax.set_ylabel(ylabel, fontsize=LABEL_SIZE)
    ax.tick_params(
        which="both", labelsize=TICK_SIZE, direction="in", width=0.6, colors="black"
    )
    ax.tick_params(which="major", length=3.0)
    for spine in ax.spines.values():
        spine.set_linewidth(0.6)


def mark_phases(ax: Axes, trajectory: Trajectory, *, labels: bool) -> None:
    """Draw a line wherever phases, or parts of a program, meet, and at each event.

    With `labels`, also write the kind of each phase or the name of each part if there is room, and the names of events.
    """
    phases: Sequence[MotionPart | MotionPhase] = trajectory.parts or trajectory.phases
    t_end = trajectory.t_end
    for phase in phases[:-1]:
        ax.axvline(phase.end, color=GREY, linewidth=0.6, linestyle=":", zorder=0.6)
    for event in trajectory.events:
        ax.axvline(event.time, color=_EVENT, linewidth=0.8, linestyle="--", zorder=0.6)
    if not labels:
        return
    for event in trajectory.events:
        look = {"rotation": 90.0, "ha": "right", "va": "bottom", "color": _EVENT}
        write(ax, event.time / t_end, 0.02, plain(event.name), **look)
    if len(phases) == 1:
        return
    for number, phase in enumerate(phases, start=1):
        room = phase.duration / t_end
        if room < 0.06:
            continue
        rotation = 0.0
        if isinstance(phase, MotionPart):
            text = plain(phase.name)
            rotation = 90.0 if room < _LETTER * len(text) else 0.0
        else:
            texts = {"move": str(number), "given speed": f"{phase.speed} m/s"}
            text = texts.get(phase.kind, phase.kind)
        place = 0.5 * (phase.begin + phase.end) / t_end
        look = {"rotation": rotation, "ha": "center", "va": "top", "color": GREY}
        write(ax, place, 0.98, text, **look)


def write(ax: Axes, x: float, y: float, text: str, **look: Any) -> None:
    """Write text at x and y, given as fractions of the axes' width and height."""
    look = {"va": "center", "fontsize": TICK_SIZE, **look}
    ax.text(x, y, text, transform=ax.transAxes, **look)


def end_text(t_end: float) -> str:
    """Return the text with the end time, s, for figures."""
    return rf"$t_\mathrm{{E}} = {t_end:.3f}$ s"


def mark_end(ax: Axes, t_end: float) -> None:
    """Write the end time next to the right edge of the axes."""
    write(ax, 1.02, 0.5, end_text(t_end), rotation=90.0)


def legend_above(
    ax: Axes, width: float, lines: Mapping[str, Artist] | None = None
) -> None:
    """Put a legend above the axes, in as many columns as fit.

    Parameters
    ----------
    ax : Axes
    width : float
        Width available for the legend, mm.
    lines : mapping of str to Artist, optional
        Entries of the legend. Default: the labelled artists of the axes.
    """
    lines = lines_by_label([ax]) if lines is None else lines
    if lines:
        _add_legend(
            ax,
            width,
            lines,
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            borderaxespad=0.2,
            borderpad=0.2,
        )


def legend_below(figure: Figure, lines: Mapping[str, Artist]) -> None:
    """Put one legend for all axes below a figure that is two columns wide."""
    _add_legend(figure, PAGE_WIDTH - 10.0, lines, loc="outside lower center")


def _add_legend(
    place: Axes | Figure, width: float, lines: Mapping[str, Artist], **look: Any
) -> None:
    """Add a legend with as many columns as fit into `width`, mm. Matplotlib fills it column by column."""
    labels = list(lines)
    columns = len(labels)
    while columns > 1:
        longest = [max(map(len, column)) for column in np.array_split(labels, columns)]
        if 10.5 * columns + 1.45 * sum(longest) <= width:  # mm of handles and letters
            break
        columns -= 1
    place.legend(
        list(lines.values()),
        labels,
        ncols=columns,
        fontsize=TICK_SIZE,
        frameon=False,
        handlelength=2.3,
        columnspacing=1.2,
        **look,
    )


def lines_by_label(panels: Sequence[Axes]) -> dict[str, Artist]:
    """Return the labelled artists of several axes, by label."""
    return {
        label: line
        for ax in panels
        for line, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }


def plain(name: str) -> str:
    """Escape a joint's name, so that Matplotlib does not read it as mathematics."""
    return name.replace("$", r"\$")
