"""Helices in three position rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.path.arc import ArcCurve, about_center

if TYPE_CHECKING:
    from brachis.path.protocol import Array
    from brachis.path.site import Site
    from brachis.task import Helix

_SPACE = (3,)


@dataclass(frozen=True, eq=False)
class HelixCurve:
    """A circular arc that climbs along its axis, over its own length sigma.

    Attributes
    ----------
    arc : ArcCurve
        The projection along the axis.
    rise : ndarray, shape (3,)
        From start to end along the axis, m.
    """

    arc: ArcCurve
    rise: Array

    @property
    def length(self) -> float:
        """Length of the helix, m."""
        return float(np.hypot(self.arc.length, np.linalg.norm(self.rise)))

    @property
    def normal(self) -> Array:
        """Unit vector of the axis about which the helix turns."""
        return self.arc.normal

    @property
    def knots(self) -> Array:
        """Every quarter turn, as of the arc."""
        return self.arc.knots * (self.length / self.arc.length)

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the helix and its derivatives by sigma, shape (order + 1, K, 3)."""
        part = self.arc.length / self.length
        result = self.arc.derivatives(part * sigma, order) * (part ** np.arange(order + 1))[:, None, None]
        result[0] += (sigma / self.length)[:, None] * self.rise
        result[1:2] += self.rise / self.length
        return result


def helix(shape: Helix, site: Site) -> HelixCurve:
    """Return the climbing turns about an axis."""
    site.need_plane("a helix", _SPACE)
    arc = about_center(shape, 2 * np.pi * shape.turns, site)
    axis = np.asarray(shape.normal) / np.linalg.norm(shape.normal)
    return HelixCurve(arc, abs(shape.turns) * shape.pitch * axis)
