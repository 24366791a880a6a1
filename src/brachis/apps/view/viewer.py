"""The viewer: a motion in the browser."""

from __future__ import annotations

import html
import os
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, Self

from brachis.apps.view.panel import Controls, Playback, first_rate
from brachis.apps.view.scene import Scene
from brachis.apps.view.server import LOOPBACK, is_local, start_server
from brachis.common import interrupts
from brachis.trajectory import Trajectory, motion_of


class Viewer:
    """A motion in the browser, until it is stopped.

    Parameters
    ----------
    trajectory : Trajectory
    candidates : sequence of mapping, optional
        What the search looked at, as `Candidate.to_dict` gives it.
    verified : bool, optional
        Whether the motion passed the verification, if that is known.
    degrees : bool, optional
        Whether angles are shown in degrees.
    host : str, optional
        Address that the server listens on; by default only this machine reaches it.
    port : int, optional
        0 takes any free port; the first free one from 8080 on if left out.

    Attributes
    ----------
    url : str
        Where to look at it.
    local : bool
        Whether only this machine reaches it.
    playback : Playback
        Which instant is shown.

    Raises
    ------
    InputError
        Host or port cannot be listened on.
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
        self._lock = threading.RLock()
        self._server = start_server(host, port)
        try:
            self._scene = Scene(self._server, trajectory)
            self._panel = Controls(
                self._server,
                trajectory,
                self._scene,
                self.playback,
                self.show,
                candidates,
                verified=verified,
                degrees=degrees,
            )
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
        """Show the instant of the playback."""
        with self._lock, self._server.atomic():
            self._scene.show(self._trajectory.position(self.playback.time))
            self._panel.update()

    def wait(self) -> None:
        """Wait until Ctrl-C, then stop."""
        with interrupts.end_on_interrupt():
            while not self._stopped.wait(0.5):
                interrupts.check()
        self.stop()

    def stop(self) -> None:
        """Stop the server; the page says that it has lost its connection."""
        self._stopped.set()
        self._thread.join()
        self._server.stop()

    def __enter__(self) -> Self:
        """Return the viewer, which is stopped at the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self.stop()

    def __repr__(self) -> str:
        """Say where it is."""
        return f"<brachis viewer at {self.url}>"

    def _repr_html_(self) -> str:
        """Show the viewer within a notebook."""
        url = html.escape(self.url, quote=True)
        return f'<iframe src="{url}" width="100%" height="640" style="border:0"></iframe><a href="{url}">{url}</a>'

    def _run(self) -> None:
        """Play the motion while a page is open: 30 pictures/s of the robot, 10 of the plots and the table."""
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
                self._scene.show(self._trajectory.position(t))
                picture += 1
                if picture % 3 == 0:
                    self._panel.update()
                else:
                    self._panel.follow()


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

    Needs the extra ``view``.

    Parameters
    ----------
    motion : Trajectory or path
        The motion, or its result file.
    candidates : sequence of mapping, optional
        What the search looked at, as `Result.to_dict` lists it.
    verified : bool, optional
        Whether the motion passed the verification, if that is known.
    degrees : bool, optional
        Whether angles are shown in degrees.
    host : str, optional
        Address that the viewer listens on; by default only this machine reaches it.
    port : int, optional
        0 takes any free port; the first free one from 8080 on if left out.
    block : bool, optional
        Whether to wait until Ctrl-C. If left out, a script waits, an interactive session or a notebook does not.

    Returns
    -------
    brachis.apps.view.Viewer
        With its ``url``; ``stop()`` ends it.

    Raises
    ------
    InputError
        Host or port cannot be listened on.
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
