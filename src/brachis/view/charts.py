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
_LEFT, _RIGHT, _ABOVE, _BELOW = 40, 12, 6, 44
"""Of a plot, and what is around its curves; pixels."""
_LABEL = 16
"""Of the height below, for the label."""
_EDGE, _EDGES, _GAP = 9.5, 18.5, 12
"""What viser leaves to the left of a plot (less half the line), on both sides and below, pixels; a test measures it."""
_FONT = "11px sans-serif"
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
        gui.add_uplot(
            self._data(),
            self._series(),
            scales={"x": {"time": False}, "y": {"range": (curves.low, curves.high)}},
            axes=(
                {"font": _FONT, "size": _BELOW - _LABEL, "label": "time (s)", "labelSize": _LABEL, "labelFont": _FONT},
                {"font": _FONT, "size": _LEFT},
            ),
            legend={"show": False},
            cursor={"drag": {"x": False, "y": False, "setScale": False}},
            height=_HEIGHT,
            padding=(_ABOVE, _RIGHT, 0, 0),
        )
        self._line = gui.add_html(_line(0.0))

    def mark(self, t: float) -> None:
        """Draw the line at time `t`, s."""
        self._line.content = _line(t / float(self._curves.t[-1]))

    def _series(self) -> tuple[uplot.Series, ...]:
        """Time, limits and curves."""
        lines: list[uplot.Series] = [{"label": "time (s)"}]
        hidden: uplot.Series_Points = {"show": False}
        lines += [
            {"label": "limit", "stroke": _LIMIT, "width": 1.0, "dash": (5.0, 4.0), "points": hidden}
            for _ in self._curves.bounds
        ]
        for name, style in zip(self._curves.names, self._curves.styles, strict=True):
            colour, dash = look(style)
            lines.append({"label": name, "stroke": colour, "width": 1.6, "dash": dash, "points": hidden})
        return tuple(lines)

    def _data(self) -> tuple[np.ndarray, ...]:
        """Columns of the plot."""
        t, values = self._curves.t, self._curves.values
        return (t, *(np.full_like(t, bound) for bound in self._curves.bounds), *values.T)


def _line(part: float) -> str:
    """Line over the plot above it, at a part of its width; a plot that is given new data ever so often would blink."""
    left = f"calc({_EDGE + _LEFT}px + {part:.5f} * (100% - {_EDGES + _LEFT + _RIGHT}px))"
    style = f"position:absolute;z-index:5;width:1.5px;background:{_NOW};left:{left};bottom:{_BELOW + _GAP}px"
    return (
        '<div style="position:relative;height:0;pointer-events:none">'
        f'<div data-part="{part:.5f}" style="{style};height:{_HEIGHT - _ABOVE - _BELOW}px"></div></div>'
    )


def look(style: int) -> tuple[str, tuple[float, ...]]:
    """Colour and dashes of the curve with this number, as in the figures."""
    turn, colour = divmod(style, len(COLOURS))
    dashes = LINE_STYLES[turn % len(LINE_STYLES)]
    return COLOURS[colour], () if isinstance(dashes, str) else tuple(2.0 * length for length in dashes[1])


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
