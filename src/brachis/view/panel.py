"""The viewer's controls, tables and plots."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.errors import BrachisError
from brachis.view import tables
from brachis.view.charts import Chart
from brachis.view.curves import all_curves
from brachis.view.motion import Motion
from brachis.view.playback import RATES, Playback
from brachis.view.scene import Scene, speed_colours

if TYPE_CHECKING:
    import viser

_STOPS = 9
_SLIDER_STEPS = 200
_CONTROLS_WIDTH, _PLOTS_WIDTH = 400, 350
"""Pixels."""


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
        What the search looked at, as `Attempt.to_dict` gives it.
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
        self._gui, self._motion, self._playback, self._show = server.gui, motion, playback, show
        self._gui.configure_theme(show_logo=False, show_share_button=False)
        self._gui.add_html(tables.summary(motion.trajectory, notes, verified=verified))
        self._add_controls()
        stops = [f"rgb({red},{green},{blue})" for red, green, blue in speed_colours(np.linspace(0.0, 1.0, _STOPS))]
        self._gui.add_html(tables.speed_legend(stops, float(motion.samples.tool_speed.max())))
        self._state = self._gui.add_html("")
        self._add_switches(scene)
        self._charts = self._add_plots(candidates)
        self.update()

    def update(self) -> None:
        """Show the instant of the playback in the slider, the table and the plots."""
        t = self._playback.time
        self.follow()
        now = self._motion.trajectory.at(np.array([t]))
        self._state.content = tables.state_table(self._motion.trajectory, now, degrees=self._degrees)
        for chart in self._charts:
            chart.mark(t)

    def follow(self) -> None:
        """Let the slider and the button follow the playback."""
        self._slider.value = round(self._playback.time, self._digits)
        self._button.label = "Pause" if self._playback.playing else "Play"

    def _add_controls(self) -> None:
        """Add slider, button and speed."""
        t_end = self._playback.t_end
        step = float(10.0 ** np.floor(np.log10(t_end / _SLIDER_STEPS)))
        self._digits = max(0, round(-np.log10(step)))
        ends = ((0.0, "0"), (t_end, f"{t_end:.4g}"))
        self._slider = self._gui.add_slider("time (s)", 0.0, t_end, step, initial_value=0.0, marks=ends)
        self._slider.on_update(self._drag)
        self._button = self._gui.add_button("Pause")
        self._button.on_click(self._toggle)
        self._rates = {f"{rate:g} x real time": rate for rate in RATES}
        current = next(name for name, rate in self._rates.items() if rate == self._playback.rate)
        self._gui.add_dropdown("speed", tuple(self._rates), initial_value=current).on_update(self._set_rate)
        self._gui.add_checkbox("again and again", self._playback.repeats).on_update(self._set_repeats)
        self._gui.add_button("Download the report", hint="The motion as one HTML page").on_click(self._send_report)

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
        from brachis.report import make_report  # noqa: PLC0415  (matplotlib takes 0.7 s)

        if event.client is None:
            return
        try:
            page = make_report(self._motion.trajectory, degrees=self._degrees)
        except BrachisError as error:
            event.client.add_notification("There is no report", str(error))
            return
        event.client.send_file_download("report.html", page.content, save_immediately=True)

    def _add_switches(self, scene: Scene) -> None:
        """Add a box to tick for every layer of the scene."""
        with self._gui.add_folder(f"show (a cell of the grid is {scene.cell:g} m)", expand_by_default=False):
            for name, handles in scene.layers.items():
                if handles:
                    box = self._gui.add_checkbox(name, handles[0].visible)
                    box.on_update(_switch(scene, name))

    def _add_plots(self, candidates: Sequence[Mapping[str, Any]]) -> list[Chart]:
        """Add a panel with the plots and the list of candidates."""
        motion, panel = self._motion, self._gui.add_panel()
        with panel.add_tab("limits"):
            charts = [
                Chart(self._gui, curves)
                for curves in all_curves(motion.trajectory, motion.samples, degrees=self._degrees)
            ]
        with panel.add_tab(f"candidates ({len(candidates)})" if candidates else "candidates"):
            self._gui.add_html(tables.candidates_table(candidates))
        panel.dock_left()
        panel.set_width(_PLOTS_WIDTH)
        self._gui.main_panel.dock_right()
        self._gui.main_panel.set_width(_CONTROLS_WIDTH)
        return charts


def _switch(scene: Scene, name: str) -> Callable[[viser.GuiEvent[viser.GuiCheckboxHandle]], None]:
    """Return what shows or hides a layer."""

    def switch(event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
        scene.set_visible(name, visible=event.target.value)

    return switch
