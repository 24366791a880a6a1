"""The viewer, which shows a motion in the browser."""

from __future__ import annotations

import html
import os
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps import bottleneck
from brachis.apps.view import tables
from brachis.apps.view.panel import (
    RATES,
    Playback,
    add_plot,
    first_rate,
    line_at,
    shown_panels,
)
from brachis.apps.view.scene import ViewerScene, speed_colours
from brachis.apps.view.server import LOOPBACK, is_local, start_server
from brachis.common import interrupts
from brachis.errors import BrachisError
from brachis.trajectory import Trajectory, motion_of

if TYPE_CHECKING:
    import viser


class Viewer(AbstractContextManager["Viewer"]):
    """A motion that is shown in the browser until the viewer is stopped.

    Parameters
    ----------
    trajectory : Trajectory
    candidates : sequence of mapping, optional
        Candidates of the search, as returned by `Candidate.to_dict`.
    verified : bool, optional
        Whether the motion passed the verification, if known.
    degrees : bool, optional
        Whether angles are shown in degrees.
    host : str, optional
        Address on which the server listens. By default, only this machine can reach the server.
    port : int, optional
        0 chooses any free port. Default: the first free port from 8080 on.

    Attributes
    ----------
    url : str
        Address of the page.
    local : bool
        Whether only this machine can reach the page.
    playback : Playback
        State of the playback, with the instant that is shown.

    Raises
    ------
    InputError
        The server cannot listen on this host or port.
    NotInstalledError
        viser is not installed.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        candidates: Sequence[Mapping[str, Any]] = (),
        *,
        verified: bool | None = None,
        degrees: bool = False,
        host: str = LOOPBACK,
        port: int | None = None,
    ) -> None:
        self.playback = Playback(
            trajectory.t_end,
            first_rate(trajectory.t_end),
            loops=trajectory.task.boundary.periodic,
        )
        self._trajectory = trajectory
        self._degrees = degrees
        self._lock = threading.RLock()
        self._server = start_server(host, port)
        self._gui = self._server.gui
        try:
            self._scene = ViewerScene(self._server, trajectory)
            self._add_panels(candidates, verified=verified)
            self.show()
        except BaseException:
            self._server.stop()
            raise
        name = f"[{host}]" if ":" in host else host
        shown = {"0.0.0.0": LOOPBACK, "[::]": "[::1]"}.get(name, name)  # noqa: S104
        self.local = is_local(host)
        self.url = f"http://{shown}:{self._server.get_port()}"
        self._stopped = threading.Event()
        self._thread = threading.Thread(
            target=self._run, name="brachis viewer", daemon=True
        )
        self._thread.start()

    def show(self) -> None:
        """Show the motion at the current instant of the playback."""
        with self._lock, self._server.atomic():
            self._scene.show(self.playback.time)
            self._update()

    def wait(self) -> None:
        """Wait until Ctrl-C is pressed, then stop the server."""
        with interrupts.end_on_interrupt():
            while not self._stopped.wait(0.5):
                interrupts.check()
        self.stop()

    def stop(self) -> None:
        """Stop the server. The page then says that it has lost its connection."""
        self._stopped.set()
        self._thread.join()
        self._server.stop()

    def __exit__(self, *_: object) -> None:
        """Stop the server."""
        self.stop()

    def __repr__(self) -> str:
        """Return a short text with the address of the viewer."""
        return f"<brachis viewer at {self.url}>"

    def _repr_html_(self) -> str:
        """Show the viewer in a notebook."""
        url = html.escape(self.url, quote=True)
        return f'<iframe src="{url}" width="100%" height="640" style="border:0"></iframe><a href="{url}">{url}</a>'

    def _run(self) -> None:
        """Play the motion while a page is open, with 30 updates/s of the robot and 10 of the plots and the table."""
        before = time.monotonic()
        picture = 0
        while not self._stopped.wait(1.0 / 30.0):
            now = time.monotonic()
            elapsed = now - before
            before = now
            if not self.playback.playing or not self._server.get_clients():
                continue
            with self._lock, self._server.atomic():
                t = self.playback.advance(elapsed)
                self._scene.show(t)
                picture += 1
                if picture % 3 == 0:
                    self._update()
                else:
                    self._follow()

    def _add_panels(
        self, candidates: Sequence[Mapping[str, Any]], *, verified: bool | None
    ) -> None:
        """Add controls, tables and plots at the sides of the scene."""
        self._gui.configure_theme(show_logo=False, show_share_button=False)
        notes = [f"not shown: {reason}" for reason in self._scene.bodies.unread]
        summary = tables.summary(self._trajectory, notes, verified=verified)
        self._gui.add_html(summary)
        self._add_controls()
        colours = speed_colours(np.linspace(0.0, 1.0, 9)).tolist()
        stops = [f"rgb{tuple(colour)}" for colour in colours]
        fastest = self._scene.samples.tool_speed.max()
        self._gui.add_html(tables.speed_legend(stops, fastest))
        self._state = self._gui.add_html("")
        self._gui.add_html(tables.phases_table(self._trajectory))
        self._add_switches()
        self._add_plots(candidates)

    def _update(self) -> None:
        """Show the current instant in the slider, the table and the plots."""
        t = self.playback.time
        self._follow()
        now = self._trajectory.at(np.array([t]))
        table = tables.state_table(self._trajectory, now, degrees=self._degrees)
        self._state.content = table
        line = line_at(t / self.playback.t_end)
        for holder in self._lines:
            holder.content = line

    def _follow(self) -> None:
        """Make the slider and the button follow the playback."""
        self._slider.value = round(self.playback.time, 3)
        self._button.label = "Pause" if self.playback.playing else "Play"

    def _add_controls(self) -> None:
        """Add the slider, the buttons and the choice of the speed."""
        t_end = self.playback.t_end
        inner = [(float(t), "") for t in self._trajectory.phase_ends[:-1]]
        ends = ((0.0, "0"), *inner, (t_end, f"{t_end:.4g}"))
        self._slider = self._gui.add_slider(
            "time (s)", 0.0, t_end, 1e-3, initial_value=0.0, marks=ends
        )
        self._slider.on_update(self._drag)
        self._add_parts()
        self._button = self._gui.add_button("Pause")
        self._button.on_click(self._toggle)
        speeds = [f"{rate:g} x real time" for rate in RATES]
        first = speeds[RATES.index(self.playback.rate)]
        rates = self._gui.add_dropdown("speed", speeds, initial_value=first)
        rates.on_update(self._set_rate)
        repeats = self._gui.add_checkbox("repeat", self.playback.repeats)
        repeats.on_update(self._set_repeats)
        hint = "The report on the motion as one HTML page"
        download = self._gui.add_button("Download the report", hint=hint)
        download.on_click(self._send_report)

    def _add_parts(self) -> None:
        """Add a list of the parts and events of a program, which shows the instant of the chosen one."""
        motion = self._trajectory
        times = {
            f"{part.name} ({part.begin:.3f} s)": part.begin for part in motion.parts
        }
        times |= {f"event {event}": event.time for event in motion.events}
        if len(times) > 1:
            parts = self._gui.add_dropdown("go to", [*times])
            parts.on_update(partial(self._go_to, times))

    def _go_to(
        self,
        times: Mapping[str, float],
        event: viser.GuiEvent[viser.GuiDropdownHandle[str]],
    ) -> None:
        """Show the instant of the chosen part or event, and pause the playback there."""
        self.playback.go_to(times[event.target.value])
        self.show()

    def _drag(self, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        """Show the instant chosen with the slider, and pause the playback there."""
        if event.client is not None:  # otherwise the slider follows the playback
            self.playback.go_to(event.target.value)
            self.show()

    def _toggle(self, _event: object) -> None:
        self.playback.toggle()
        self.show()

    def _set_rate(self, event: viser.GuiEvent[viser.GuiDropdownHandle[str]]) -> None:
        self.playback.rate = float(event.target.value.partition(" ")[0])

    def _set_repeats(self, event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
        self.playback.repeats = event.target.value

    def _send_report(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        """Make the report and send it to the browser that asked for it, as a file to save."""
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
        """Add a checkbox for every layer of the scene."""
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

    def _add_plots(self, candidates: Sequence[Mapping[str, Any]]) -> None:
        """Add a panel with the plots, the bottlenecks and the list of candidates."""
        panel = self._gui.add_panel()
        with panel.add_tab("limits"):
            samples = self._scene.samples
            shown = shown_panels(self._trajectory, samples, degrees=self._degrees)
            self._lines = [add_plot(self._gui, plotted) for plotted in shown]
        with panel.add_tab("bottlenecks"):
            report = bottleneck.report(self._trajectory, solve=False)
            lines = report.text(degrees=self._degrees).splitlines()
            self._gui.add_html(tables.paragraphs(lines))
        count = f" ({len(candidates)})" if candidates else ""
        with panel.add_tab(f"candidates{count}"):
            self._gui.add_html(tables.candidates_table(candidates))
        panel.dock_left()
        panel.set_width(350)
        self._gui.main_panel.dock_right()
        self._gui.main_panel.set_width(400)


def view(
    motion: Trajectory | str | os.PathLike[str],
    candidates: Sequence[Mapping[str, Any]] = (),
    *,
    verified: bool | None = None,
    degrees: bool = False,
    host: str = LOOPBACK,
    port: int | None = None,
    block: bool | None = None,
) -> Viewer:
    """Show a motion in the browser: robot, path, ghost postures, and plots that follow a slider.

    The viewer needs the extra ``view``.

    Parameters
    ----------
    motion : Trajectory or path
        The motion, or its result file.
    candidates : sequence of mapping, optional
        Candidates of the search, as listed by `Result.to_dict`.
    verified : bool, optional
        Whether the motion passed the verification, if known.
    degrees : bool, optional
        Whether angles are shown in degrees.
    host : str, optional
        Address on which the viewer listens. By default, only this machine can reach the viewer.
    port : int, optional
        0 chooses any free port. Default: the first free port from 8080 on.
    block : bool, optional
        Whether to wait until Ctrl-C is pressed. By default, a script waits; interactive sessions and notebooks do not.

    Returns
    -------
    brachis.apps.view.Viewer
        The viewer, with its address ``url``. The method ``stop()`` ends the viewer.

    Raises
    ------
    InputError
        The server cannot listen on this host or port.
    NotInstalledError
        viser is not installed.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> viewer = brachis.view(result.trajectory, port=0, block=False)
    >>> viewer.url.startswith("http://127.0.0.1:")
    True
    >>> viewer.stop()
    """
    viewer = Viewer(
        motion_of(motion),
        candidates,
        verified=verified,
        degrees=degrees,
        host=host,
        port=port,
    )
    sys.stderr.write(f"the motion is shown at {viewer.url}\n")
    if block if block is not None else not hasattr(sys, "ps1"):
        viewer.wait()
    return viewer
