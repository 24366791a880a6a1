"""The viewer: robot, path, tool trace and ghost postures in the browser, with plots that follow a slider.

The browser is connected to a server on this machine (viser, from the extra ``view``), which plays the motion.
"""

from __future__ import annotations

from brachis.apps.view.server import LOOPBACK, require_viser
from brachis.apps.view.viewer import Viewer, view

__all__ = ["LOOPBACK", "Viewer", "require_viser", "view"]
