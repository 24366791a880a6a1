"""The viewer's controls, tables, clock, and plots with a line at the instant shown."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots.style import COLOURS, LINE_STYLES
from brachis.apps.view import tables
from brachis.apps.view.curves import Curves, Motion, all_curves
from brachis.apps.view.scene import Scene, speed_colours
from brachis.errors import BrachisError

if TYPE_CHECKING:
    import viser
    from viser import uplot

_HEIGHT = 165
_LEFT = 40
_RIGHT = 12
_ABOVE = 6
_BELOW = 44
"""Of a plot, and what is around its curves; pixels."""
_LABEL = 16
"""Of the height below, for the label."""
_EDGE = 9.5
_EDGES = 18.5
_GAP = 12
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
                {
                    "font": _FONT,
                    "size": _BELOW - _LABEL,
                    "label": "time (s)",
                    "labelSize": _LABEL,
                    "labelFont": _FONT,
                },
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
            {
                "label": "limit",
                "stroke": _LIMIT,
                "width": 1.0,
                "dash": (5.0, 4.0),
                "points": hidden,
            }
            for _ in self._curves.bounds
        ]
        for name, style in zip(self._curves.names, self._curves.styles, strict=True):
            colour, dash = look(style)
            lines.append(
                {
                    "label": name,
                    "stroke": colour,
                    "width": 1.6,
                    "dash": dash,
                    "points": hidden,
                }
            )
        return tuple(lines)

    def _data(self) -> tuple[np.ndarray, ...]:
        """Columns of the plot."""
        t = self._curves.t
        values = self._curves.values
        return (
            t,
            *(np.full_like(t, bound) for bound in self._curves.bounds),
            *values.T,
        )


def _line(part: float) -> str:
    """Line over the plot above it, at a part of its width; a plot that is given new data ever so often would blink."""
    left = (
        f"calc({_EDGE + _LEFT}px + {part:.5f} * (100% - {_EDGES + _LEFT + _RIGHT}px))"
    )
    style = f"position:absolute;z-index:5;width:1.5px;background:{_NOW};left:{left};bottom:{_BELOW + _GAP}px"
    return (
        '<div style="position:relative;height:0;pointer-events:none">'
        f'<div data-part="{part:.5f}" style="{style};height:{_HEIGHT - _ABOVE - _BELOW}px"></div></div>'
    )


def look(style: int) -> tuple[str, tuple[float, ...]]:
    """Colour and dashes of the curve with this number, as in the figures."""
    turn, colour = divmod(style, len(COLOURS))
    dashes = LINE_STYLES[turn % len(LINE_STYLES)]
    return COLOURS[colour], () if isinstance(dashes, str) else tuple(
        2.0 * length for length in dashes[1]
    )


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


RATES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Speeds at which a motion can be played, as parts of the real one."""
_WATCHED = 3.0
"""Least time that a motion is played in at first, s."""
_PAUSE = 0.7
"""How long the end is shown before a motion begins again, s."""


def first_rate(t_end: float) -> float:
    """Return the largest of `RATES`, at most the real one, at which a motion of `t_end` s can be watched."""
    slow = [rate for rate in RATES if rate <= 1.0 and t_end / rate >= _WATCHED]
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
            return self.time
        if not self.repeats:
            self.playing = False
            return self.time
        self._waited += elapsed
        if self.loops or self._waited >= _PAUSE:
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


class Panel:
    """What is beside the scene.

    Parameters
    ----------
    server : viser.ViserServer
    motion : Motion
    scene : Scene
    playback : Playback
        Which the controls set.
    show : callable
        Called when the user has chosen another instant.
    candidates : sequence of mapping
        What the search looked at, as `Candidate.to_dict` gives it.
    notes : sequence of str
        What else the user should know.
    verified : bool or None
        None where it is not known.
    degrees : bool
        Whether angles are in degrees.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        motion: Motion,
        scene: Scene,
        playback: Playback,
        show: Callable[[], None],
        candidates: Sequence[Mapping[str, Any]],
        notes: Sequence[str],
        *,
        verified: bool | None,
        degrees: bool,
    ) -> None:
        self._degrees = degrees
        self._gui = server.gui
        self._motion = motion
        self._playback = playback
        self._show = show
        self._gui.configure_theme(show_logo=False, show_share_button=False)
        self._gui.add_html(tables.summary(motion.trajectory, notes, verified=verified))
        self._add_controls()
        stops = [
            f"rgb({red},{green},{blue})"
            for red, green, blue in speed_colours(np.linspace(0.0, 1.0, 9))
        ]
        self._gui.add_html(
            tables.speed_legend(stops, float(motion.samples.tool_speed.max()))
        )
        self._state = self._gui.add_html("")
        self._add_switches(scene)
        self._charts = self._add_plots(candidates)
        self.update()

    def update(self) -> None:
        """Show the instant of the playback in the slider, the table and the plots."""
        t = self._playback.time
        self.follow()
        now = self._motion.trajectory.at(np.array([t]))
        self._state.content = tables.state_table(
            self._motion.trajectory, now, degrees=self._degrees
        )
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
        ends = ((0.0, "0"), (t_end, f"{t_end:.4g}"))
        self._slider = self._gui.add_slider(
            "time (s)", 0.0, t_end, step, initial_value=0.0, marks=ends
        )
        self._slider.on_update(self._drag)
        self._button = self._gui.add_button("Pause")
        self._button.on_click(self._toggle)
        self._rates = {f"{rate:g} x real time": rate for rate in RATES}
        current = next(
            name for name, rate in self._rates.items() if rate == self._playback.rate
        )
        self._gui.add_dropdown(
            "speed", tuple(self._rates), initial_value=current
        ).on_update(self._set_rate)
        self._gui.add_checkbox("again and again", self._playback.repeats).on_update(
            self._set_repeats
        )
        self._gui.add_button(
            "Download the report", hint="The motion as one HTML page"
        ).on_click(self._send_report)

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
            page = make_report(self._motion.trajectory, degrees=self._degrees)
        except BrachisError as error:
            event.client.add_notification("There is no report", str(error))
            return
        event.client.send_file_download(
            "report.html", page.content, save_immediately=True
        )

    def _add_switches(self, scene: Scene) -> None:
        """Add a box to tick for every layer of the scene."""
        with self._gui.add_folder(
            f"show (a cell of the grid is {scene.cell:g} m)", expand_by_default=False
        ):
            for name, handles in scene.layers.items():
                if handles:
                    box = self._gui.add_checkbox(name, handles[0].visible)
                    box.on_update(_switch(scene, name))

    def _add_plots(self, candidates: Sequence[Mapping[str, Any]]) -> list[Chart]:
        """Add a panel with the plots and the list of candidates."""
        motion = self._motion
        panel = self._gui.add_panel()
        with panel.add_tab("limits"):
            charts = [
                Chart(self._gui, curves)
                for curves in all_curves(
                    motion.trajectory, motion.samples, degrees=self._degrees
                )
            ]
        with panel.add_tab(
            f"candidates ({len(candidates)})" if candidates else "candidates"
        ):
            self._gui.add_html(tables.candidates_table(candidates))
        panel.dock_left()
        panel.set_width(350)
        self._gui.main_panel.dock_right()
        self._gui.main_panel.set_width(400)
        return charts


def _switch(
    scene: Scene, name: str
) -> Callable[[viser.GuiEvent[viser.GuiCheckboxHandle]], None]:
    """Return what shows or hides a layer."""

    def switch(event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
        scene.set_visible(name, visible=event.target.value)

    return switch
