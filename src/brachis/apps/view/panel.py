"""The viewer's controls, tables, clock, and plots with a line at the instant shown."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

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
from brachis.apps.view import tables
from brachis.apps.view.scene import Scene, speed_colours
from brachis.errors import BrachisError
from brachis.trajectory import Samples, Trajectory

if TYPE_CHECKING:
    import viser
    from viser import uplot

_PIXELS = {
    "height": 165,  # of a plot
    "left": 40,  # of the curves in it, and so on
    "right": 12,
    "above": 6,
    "below": 44,
    "label": 16,  # of the part below
    "outside left": 9.5,  # what viser leaves free around a plot; a test measures it
    "outside": 18.5,  # on both sides together
    "outside below": 12,
}
_FONT = "11px sans-serif"


def shown_panels(
    trajectory: Trajectory, samples: Samples, *, degrees: bool = False
) -> list[Panel]:
    """Make the panels of the viewer: ratios to all limits, joints without a limit, and the tool's speed.

    Parameters
    ----------
    trajectory : Trajectory
    samples : Samples
    degrees : bool, optional
        Whether angles of joints without limits are in degrees.
    """
    ratios = at_distinct_times(limit_ratios(trajectory))
    found = [ratio_panel(trajectory, ratios, title) for title in titles_of(ratios)]
    rows = ("torque", "velocity", "position")
    for panel in panels_of(trajectory, samples, *rows, degrees=degrees):
        free = tuple(curve for curve in panel.curves if not curve.is_limited)
        if free:
            found.append(replace(panel, curves=free, unit=f"{panel.unit}, no limit"))
    return [*found, *panels_of(trajectory, samples, *tool_rows_of(trajectory))]


class Chart:
    """One plot over time.

    Parameters
    ----------
    gui : viser.GuiApi
        Where it is added.
    panel : Panel
    """

    def __init__(self, gui: viser.GuiApi, panel: Panel) -> None:
        self._t_end = panel.t[-1]
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
        self._line = gui.add_html(_line(0.0))

    def mark(self, t: float) -> None:
        """Draw the line at time `t`, s."""
        self._line.content = _line(t / self._t_end)


def _series(
    label: str, colour: str, dash: tuple[float, ...], width: float = 1.6
) -> uplot.Series:
    """Describe a line without points."""
    return {
        "label": label,
        "stroke": colour,
        "width": width,
        "dash": dash,
        "points": {"show": False},
    }


def _line(part: float) -> str:
    """Line over the plot above it, at a part of its width; a plot whose data are replaced so often would blink."""
    before = _PIXELS["outside left"] + _PIXELS["left"]
    around = _PIXELS["outside"] + _PIXELS["left"] + _PIXELS["right"]
    left = f"calc({before}px + {part:.5f} * (100% - {around}px))"
    bottom = _PIXELS["below"] + _PIXELS["outside below"]
    height = _PIXELS["height"] - _PIXELS["above"] - _PIXELS["below"]
    place = f"left:{left};bottom:{bottom}px;height:{height}px"
    style_now = f"position:absolute;z-index:5;width:1.5px;background:#D00000;{place}"
    return (
        '<div style="position:relative;height:0;pointer-events:none">'
        f'<div data-part="{part:.5f}" style="{style_now}"></div></div>'
    )


def look(number: int) -> tuple[str, tuple[float, ...]]:
    """Colour and dashes of the curve with this number: solid until all colours are used."""
    turn, colour = divmod(number, len(style.COLOURS))
    dashes = style.LINE_STYLES[turn % len(style.LINE_STYLES)]
    solid = isinstance(dashes, str)
    lengths = () if solid else tuple(2.0 * length for length in dashes[1])
    return style.COLOURS[colour], lengths


def _heading(panel: Panel) -> str:
    """Title of a plot, and the names in the colours of their curves, as HTML."""
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
"""Speeds at which a motion can be played, as parts of the real one."""


def first_rate(t_end: float) -> float:
    """Return the largest of `RATES`, no more than the real one, at which a motion of `t_end` s takes 3 s or more."""
    slow = [rate for rate in RATES if rate <= 1.0 and t_end / rate >= 3.0]
    return max(slow, default=RATES[0])


@dataclass
class Playback:
    """A motion that is played again and again.

    Attributes
    ----------
    t_end : float
        End of the motion, s.
    rate : float
        Speed, as a part of the real one.
    loops : bool
        Whether the motion goes on at its end without a pause.
    repeats : bool
        Whether it begins again at its end; otherwise it stays there.
    playing : bool
    time : float
        The instant that is shown, s.
    """

    t_end: float
    rate: float
    loops: bool = False
    repeats: bool = True
    playing: bool = True
    time: float = 0.0
    _waited: float = 0.0

    def advance(self, elapsed: float) -> float:
        """Go on by `elapsed` s of the spectator's time; returns the instant to show, s."""
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
        """Show one instant, s, and stay there."""
        self.playing = False
        self.time = min(max(time, 0.0), self.t_end)

    def toggle(self) -> None:
        """Play or pause; at the end, play from the beginning."""
        self.playing = not self.playing
        if self.playing and self.time >= self.t_end:
            self.time = 0.0


class Controls:
    """Controls, tables and plots at the sides of the scene.

    Parameters
    ----------
    server : viser.ViserServer
    trajectory : Trajectory
    scene : Scene
    playback : Playback
        Which the controls set.
    show : callable
        Called when the user has chosen another instant.
    candidates : sequence of mapping
        What the search looked at, as `Candidate.to_dict` gives it.
    verified : bool or None
        None if it is not known.
    degrees : bool
        Whether angles are in degrees.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        trajectory: Trajectory,
        scene: Scene,
        playback: Playback,
        show: Callable[[], None],
        candidates: Sequence[Mapping[str, Any]],
        *,
        verified: bool | None,
        degrees: bool,
    ) -> None:
        self._degrees = degrees
        self._gui = server.gui
        self._trajectory = trajectory
        self._scene = scene
        self._playback = playback
        self._show = show
        self._gui.configure_theme(show_logo=False, show_share_button=False)
        notes = [f"not shown: {reason}" for reason in scene.bodies.unread]
        self._gui.add_html(tables.summary(trajectory, notes, verified=verified))
        self._add_controls()
        colours = speed_colours(np.linspace(0.0, 1.0, 9)).tolist()
        stops = [f"rgb{tuple(colour)}" for colour in colours]
        fastest = scene.samples.tool_speed.max()
        self._gui.add_html(tables.speed_legend(stops, fastest))
        self._state = self._gui.add_html("")
        self._gui.add_html(tables.phases_table(trajectory))
        self._add_switches()
        self._charts = self._add_plots(candidates)
        self.update()

    def update(self) -> None:
        """Show the instant of the playback in the slider, the table and the plots."""
        t = self._playback.time
        self.follow()
        now = self._trajectory.at(np.array([t]))
        table = tables.state_table(self._trajectory, now, degrees=self._degrees)
        self._state.content = table
        for chart in self._charts:
            chart.mark(t)

    def follow(self) -> None:
        """Let the slider and the button follow the playback."""
        self._slider.value = round(self._playback.time, self._digits)
        self._button.label = "Pause" if self._playback.playing else "Play"

    def _add_controls(self) -> None:
        """Add slider, button and speed."""
        t_end = self._playback.t_end
        step = float(10.0 ** np.floor(np.log10(t_end / 200)))
        self._digits = max(0, round(-np.log10(step)))
        inner = [(float(t), "") for t in self._trajectory.phase_ends[:-1]]
        ends = ((0.0, "0"), *inner, (t_end, f"{t_end:.4g}"))
        self._slider = self._gui.add_slider(
            "time (s)", 0.0, t_end, step, initial_value=0.0, marks=ends
        )
        self._slider.on_update(self._drag)
        self._button = self._gui.add_button("Pause")
        self._button.on_click(self._toggle)
        self._rates = {f"{rate:g} x real time": rate for rate in RATES}
        rate = f"{self._playback.rate:g} x real time"
        rates = self._gui.add_dropdown("speed", tuple(self._rates), initial_value=rate)
        rates.on_update(self._set_rate)
        repeats = self._gui.add_checkbox("again and again", self._playback.repeats)
        repeats.on_update(self._set_repeats)
        hint = "The motion as one HTML page"
        download = self._gui.add_button("Download the report", hint=hint)
        download.on_click(self._send_report)

    def _drag(self, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        """Show what the user chose with the slider, and stay there."""
        if event.client is not None:  # else the slider follows the playback
            self._playback.go_to(event.target.value)
            self._show()

    def _toggle(self, _event: object) -> None:
        self._playback.toggle()
        self._show()

    def _set_rate(self, event: viser.GuiEvent[viser.GuiDropdownHandle[str]]) -> None:
        self._playback.rate = self._rates[event.target.value]

    def _set_repeats(self, event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
        self._playback.repeats = event.target.value

    def _send_report(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        """Make the report for whoever asks, as a file that the browser keeps."""
        from brachis.apps.report import make_report

        if event.client is None:
            return
        try:
            page = make_report(self._trajectory, degrees=self._degrees)
        except BrachisError as error:
            event.client.add_notification("The report cannot be made", str(error))
            return
        event.client.send_file_download(
            "report.html", page.content, save_immediately=True
        )

    def _add_switches(self) -> None:
        """Add a box to tick for every layer of the scene."""
        title = f"show (a cell of the grid is {self._scene.cell:g} m)"
        with self._gui.add_folder(title, expand_by_default=False):
            for name, handles in self._scene.layers.items():
                if handles:
                    box = self._gui.add_checkbox(name, handles[0].visible)
                    box.on_update(partial(self._switch, name))

    def _switch(
        self, name: str, event: viser.GuiEvent[viser.GuiCheckboxHandle]
    ) -> None:
        """Show or hide a layer of the scene."""
        self._scene.set_visible(name, visible=event.target.value)

    def _add_plots(self, candidates: Sequence[Mapping[str, Any]]) -> list[Chart]:
        """Add a panel with the plots and the list of candidates."""
        panel = self._gui.add_panel()
        with panel.add_tab("limits"):
            samples = self._scene.samples
            shown = shown_panels(self._trajectory, samples, degrees=self._degrees)
            charts = [Chart(self._gui, each) for each in shown]
        count = f" ({len(candidates)})" if candidates else ""
        with panel.add_tab(f"candidates{count}"):
            self._gui.add_html(tables.candidates_table(candidates))
        panel.dock_left()
        panel.set_width(350)
        self._gui.main_panel.dock_right()
        self._gui.main_panel.set_width(400)
        return charts
