"""Plots beside the scene, with a line at the instant that is shown."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.plots.style import COLOURS, LINE_STYLES
from brachis.view.curves import Curves

if TYPE_CHECKING:
    import viser
    from viser import uplot

_HEIGHT = 165
"""Pixels."""
_FONT = "11px sans-serif"
_DASHES: dict[str, tuple[float, ...]] = {"-": (), "--": (6.0, 4.0), ":": (2.0, 3.0)}
_NOW = "#D00000"
_LIMIT = "#666666"


class Chart:
    """One plot over time.

    Parameters
    ----------
    gui : viser.GuiApi
        Where it is added.
    curves : Curves
    """

    def __init__(self, gui: viser.GuiApi, curves: Curves) -> None:
        self._curves = curves
        gui.add_html(_heading(curves))
        self._handle = gui.add_uplot(
            self._data(0.0),
            self._series(),
            scales={"x": {"time": False}, "y": {"range": (curves.low, curves.high)}},
            axes=(
                {"font": _FONT, "size": 28, "label": "time (s)", "labelSize": 16, "labelFont": _FONT},
                {"font": _FONT, "size": 40},
            ),
            legend={"show": False},
            cursor={"drag": {"x": False, "y": False, "setScale": False}},
            height=_HEIGHT,
            padding=(6, 12, 0, 0),
        )

    def mark(self, t: float) -> None:
        """Draw the line at time `t`, s."""
        self._handle.data = self._data(t)

    def _series(self) -> tuple[uplot.Series, ...]:
        """Time, limits, curves, and the line at the instant shown."""
        lines: list[uplot.Series] = [{"label": "time (s)"}]
        hidden: uplot.Series_Points = {"show": False}
        lines += [
            {"label": "limit", "stroke": _LIMIT, "width": 1.0, "dash": (5.0, 4.0), "points": hidden}
            for _ in self._curves.bounds
        ]
        for name, style in zip(self._curves.names, self._curves.styles, strict=True):
            colour, dash = look(style)
            lines.append({"label": name, "stroke": colour, "width": 1.6, "dash": dash, "points": hidden})
        return (*lines, {"label": "now", "stroke": _NOW, "width": 1.4, "points": hidden})

    def _data(self, now: float) -> tuple[np.ndarray, ...]:
        """Columns of the plot; the line at `now` is a spike of the last one, which else stays below the axis."""
        curves = self._curves
        place = int(np.searchsorted(curves.t, now))
        t = np.insert(curves.t, place, (now, now, now))
        columns = [np.full_like(t, bound) for bound in curves.bounds]
        columns += [np.insert(part, place, 3 * (np.interp(now, curves.t, part),)) for part in curves.values.T]
        spike = np.full_like(t, curves.low - (curves.high - curves.low))
        spike[place + 1] = curves.high + (curves.high - curves.low)
        return (t, *columns, spike)


def look(style: int) -> tuple[str, tuple[float, ...]]:
    """Colour and dashes of the curve with this number, as in the figures."""
    turn, colour = divmod(style, len(COLOURS))
    return COLOURS[colour], _DASHES[LINE_STYLES[turn % len(LINE_STYLES)]]


def legend(names: Sequence[str], styles: Sequence[int]) -> str:
    """Names in the colours of their curves, as HTML."""
    entries = (
        f'<span style="white-space:nowrap;margin-right:0.8em"><span style="display:inline-block;width:1.2em;'
        f"border-top:2.5px {'dashed' if look(style)[1] else 'solid'} {look(style)[0]};vertical-align:middle;"
        f'margin-right:0.3em"></span>{html.escape(name)}</span>'
        for name, style in zip(names, styles, strict=True)
    )
    return f'<div style="font-size:0.8em;line-height:1.5">{"".join(entries)}</div>'


def _heading(curves: Curves) -> str:
    """Title and legend of a plot."""
    title = f'<div style="font-size:0.85em;font-weight:600">{html.escape(curves.title)}</div>'
    return f'<div style="margin:0.3em 0.8em 0 0.8em">{title}{legend(curves.names, curves.styles)}</div>'
