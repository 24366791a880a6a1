"""``brachis view``, and ``brachis plan --view``."""

from __future__ import annotations

import json
import math
import os
import sys
import webbrowser
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brachis import interrupts
from brachis.cli.output import print_error
from brachis.cli.settings import motion_file
from brachis.cli.verbosity import Verbosity, chosen
from brachis.files import read_file
from brachis.trajectory import Trajectory
from brachis.verify import verify_trajectory
from brachis.view import LOOPBACK, Viewer

_LARGEST = 64_000_000
"""Of result.json, bytes."""


def view_command(result: Path, *, host: str, port: int | None, browser: bool, degrees: bool) -> None:
    """Show a saved motion until Ctrl-C."""
    path = motion_file(result)
    trajectory = Trajectory.load(path)
    verified = verify_trajectory(trajectory).passed
    candidates = _candidates_beside(path, trajectory)
    show(trajectory, candidates, verified=verified, host=host, port=port, browser=browser, degrees=degrees)


def show(
    trajectory: Trajectory,
    candidates: Sequence[Mapping[str, Any]],
    *,
    verified: bool,
    host: str = LOOPBACK,
    port: int | None = None,
    browser: bool = True,
    degrees: bool = False,
) -> None:
    """Show a motion until Ctrl-C; open the browser where there is a screen, and it is wanted."""
    viewer = Viewer(trajectory, candidates, verified=verified, degrees=degrees, host=host, port=port)
    with viewer, interrupts.expected():
        if not viewer.local:
            print_error(f"warning: whoever reaches {host} can look, and move the slider; leave --host out to be alone")
        if chosen() is not Verbosity.QUIET:
            print_error("Ctrl-C stops the viewer")
        print(f"look at {viewer.url}", flush=True)  # noqa: T201  (what the command is for, however quiet)
        if browser and sys.stdout.isatty() and _has_screen():
            webbrowser.open(viewer.url)
        viewer.wait()


def _candidates_beside(path: Path, trajectory: Trajectory) -> list[dict[str, Any]]:
    """Read the candidates of a motion's search from the JSON that was written with it; none where it is another's."""
    beside = path.with_suffix(".json")
    try:
        data = json.loads(read_file(beside, _LARGEST))
        same = math.isclose(data["t_end"], trajectory.t_end, rel_tol=1e-12)
        return [dict(each) for each in data["candidates"]] if same else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _has_screen() -> bool:
    """Tell whether a browser would have somewhere to open."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
