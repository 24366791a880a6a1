"""The viewer's playback clock, and its plots, in which a line marks the instant shown."""

from __future__ import annotations

import html
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from brachis.apps.bottleneck.saturation import limit_ratios
from brachis.apps.plots import style
from brachis.apps.plots.panels import (
    Panel,
    at_distinct_times,
    panels_of,
    ratio_panel,
    titles_of,
    tool_rows_of,
)
from brachis.trajectory import Samples, Trajectory

if TYPE_CHECKING:
    import viser
    from viser import uplot

_PIXELS = {
    "height": 165,  # of a plot
    "left": 40,  # margin between the edge of a plot and its curves, as in the next three rows
    "right": 12,
    "above": 6,
    "below": 44,
    "label": 16,  # label of the axis, which is included in the bottom margin
    "outside left": 9.5,  # space that viser leaves around a plot; a test measures it
    "outside": 18.5,  # sum of both sides
    "outside below": 12,
}
_FONT = "11px sans-serif"


def shown_panels(
    trajectory: Trajectory, samples: Samples, *, degrees: bool = False
) -> list[Panel]:
    """Make the panels of the viewer: ratios to all limits, joint quantities without a limit, and the tool's speed.

    Parameters
    ----------
    trajectory : Trajectory
    samples : Samples
    degrees : bool, optional
        Whether angles of joints without a limit are in degrees.
    """
    ratios = at_distinct_times(limit_ratios(trajectory))
    panels = [ratio_panel(trajectory, ratios, title) for title in titles_of(ratios)]
    rows = ("torque", "velocity", "position")
    for panel in panels_of(trajectory, samples, *rows, degrees=degrees):
        free = tuple(curve for curve in panel.curves if not curve.is_limited)
        if free:
            panels.append(replace(panel, curves=free, unit=f"{panel.unit}, no limit"))
    return [*panels, *panels_of(trajectory, samples, *tool_rows_of(trajectory))]


def add_plot(gui: viser.GuiApi, panel: Panel) -> viser.GuiHtmlHandle:
    """Add one plot over time, and return the HTML element that shows a line at the current instant."""
    data = [panel.t]
    series: list[uplot.Series] = [{"label": "time (s)"}]
    for limit, _ in panel.near_limits():
        data.append(limit)
        series.append(_series("limit", style.GREY, (5.0, 4.0), 1.0))
    for curve in panel.curves:
        data.append(curve.values)
        series.append(_series(curve.name, *look(curve.style)))
    gui.add_html(_heading(panel))
    gui.add_uplot(
        tuple(data),
        tuple(series),
        scales={"x": {"time": False}, "y": {"range": panel.view()}},
        axes=(
            {
                "font": _FONT,
                "size": _PIXELS["below"] - _PIXELS["label"],
                "label": "time (s)",
                "labelSize": _PIXELS["label"],
                "labelFont": _FONT,
            },
            {"font": _FONT, "size": _PIXELS["left"]},
        ),
        legend={"show": False},
        cursor={"drag": {"x": False, "y": False, "setScale": False}},
        height=_PIXELS["height"],
        padding=(_PIXELS["above"], _PIXELS["right"], 0, 0),
    )
    return gui.add_html("")


def _series(
    label: str, colour: str, dash: tuple[float, ...], width: float = 1.6
) -> uplot.Series:
    """Describe a curve without point markers."""
    return {
        "label": label,
        "stroke": colour,
        "width": width,
        "dash": dash,
        "points": {"show": False},
    }


def line_at(fraction: float) -> str:
    """Return an HTML line over a plot, at a fraction of its width; redrawing the plot would make it blink."""
    before = _PIXELS["outside left"] + _PIXELS["left"]
    around = _PIXELS["outside"] + _PIXELS["left"] + _PIXELS["right"]
    offset = f"calc({before}px + {fraction:.5f} * (100% - {around}px))"
    bottom = _PIXELS["below"] + _PIXELS["outside below"]
    height = _PIXELS["height"] - _PIXELS["above"] - _PIXELS["below"]
    place = f"left:{offset};bottom:{bottom}px;height:{height}px"
    style_now = f"position:absolute;z-index:5;width:1.5px;background:#D00000;{place}"
    return (
        '<div style="position:relative;height:0;pointer-events:none">'
        f'<div data-part="{fraction:.5f}" style="{style_now}"></div></div>'
    )


def look(number: int) -> tuple[str, tuple[float, ...]]:
    """Return the colour and the dashes of the curve with this style number, as in the figures."""
    line = style.joint_style(number)
    _, lengths = line["linestyle"]
    return line["color"], tuple(2.0 * length for length in lengths)


def _heading(panel: Panel) -> str:
    """Return the title of a plot and the names of its curves with their colours, as HTML."""
    entries = []
    for curve in panel.curves:
        colour, dashes = look(curve.style)
        border = f"2.5px {'dashed' if dashes else 'solid'} {colour}"
        line = f"display:inline-block;width:1.2em;border-top:{border};vertical-align:middle;margin-right:0.3em"
        entries.append(
            f'<span style="white-space:nowrap;margin-right:0.8em"><span style="{line}"></span>'
            f"{html.escape(curve.name)}</span>"
        )
    return (
        '<div style="margin:0.3em 0.8em 0 0.8em">'
        f'<div style="font-size:0.85em;font-weight:600">{html.escape(panel.heading)}</div>'
        f'<div style="font-size:0.8em;line-height:1.5">{"".join(entries)}</div></div>'
    )


RATES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Playback speeds, as fractions of real time."""


def first_rate(t_end: float) -> float:
    """Return the fastest of `RATES`, up to real time, at which a motion of `t_end` s takes at least 3 s."""
    slow = [rate for rate in RATES if rate <= 1.0 and t_end / rate >= 3.0]
    return max(slow, default=RATES[0])


@dataclass
class Playback:
    """State of the playback of a motion.

    Attributes
    ----------
    t_end : float
        End time of the motion, s.
    rate : float
        Playback speed, as a fraction of real time.
    loops : bool
        Whether the motion is periodic and therefore starts again without a pause.
    repeats : bool
        Whether the playback starts again at the end of the motion; if not, it stops there.
    playing : bool
    time : float
        Instant that is shown, s.
    """

    t_end: float
    rate: float
    loops: bool = False
    repeats: bool = True
    playing: bool = True
    time: float = 0.0
    _waited: float = 0.0

    def advance(self, elapsed: float) -> float:
        """Advance by `elapsed` s of real time, and return the instant to show, s."""
        if not self.playing:
            return self.time
        if self.time < self.t_end:
            self.time = min(self.time + elapsed * self.rate, self.t_end)
            self._waited = 0.0
        elif not self.repeats:
            self.playing = False
        else:
            self._waited += elapsed
            if self.loops or self._waited >= 0.7:  # s
                self.time = 0.0
        return self.time

    def go_to(self, time: float) -> None:
        """Go to an instant, s, and pause there."""
        self.playing = False
        self.time = min(max(time, 0.0), self.t_end)

    def toggle(self) -> None:
        """Switch between play and pause. At the end of the motion, play from the beginning."""
        self.playing = not self.playing
        if self.playing and self.time >= self.t_end:
            self.time = 0.0
