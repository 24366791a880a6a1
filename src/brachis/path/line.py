"""Straight lines in task coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.path.site import ZERO_LENGTH, Site

if TYPE_CHECKING:
    from brachis.path.protocol import Array
    from brachis.task import LineBy, LineHeading, LineTo


@dataclass(frozen=True, eq=False)
class LineCurve:
    """A straight line ``start + slope sigma``.

    Attributes
    ----------
    start : ndarray, shape (m,)
        Task coordinates at its start.
    slope : ndarray, shape (m,)
        Task coordinates per unit sigma; of norm 1 in the position rows, or in yaw where they stand still.
    length : float
        Range of sigma, m (rad where the position stands still).
    """

    start: Array
    slope: Array
    length: float

    @property
    def knots(self) -> Array:
        """Start and end: the line is analytic."""
        return np.array([0.0, self.length])

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the line and its derivatives by sigma, shape (order + 1, K, m)."""
        result = np.zeros((order + 1, sigma.size, self.start.size))
        result[0] = self.start + sigma[:, None] * self.slope
        if order:
            result[1] = self.slope
        return result


def line_to(shape: LineTo, site: Site) -> LineCurve:
    """Return the line to a point."""
    return _line(site.coordinates(shape.to, "to", site.rows) - site.start, site, ".to", list(shape.to))


def line_by(shape: LineBy, site: Site) -> LineCurve:
    """Return the line by a displacement."""
    return _line(site.coordinates(shape.by, "by", site.rows), site, ".by", list(shape.by))


def line_heading(shape: LineHeading, site: Site) -> LineCurve:
    """Return the line of given length and direction in the plane of the two position rows."""
    site.need_plane("a line by length and angle_deg", (2,))
    angle = np.deg2rad(shape.angle_deg)
    displacement = np.zeros_like(site.start)
    displacement[:2] = shape.length * np.array([np.cos(angle), np.sin(angle)])
    return _line(displacement, site, ".length", shape.length)


def _line(displacement: Array, site: Site, key: str, found: object) -> LineCurve:
    length = float(np.linalg.norm(displacement[: len(site.positions)]))
    if length < ZERO_LENGTH:
        length = float(np.linalg.norm(displacement))
    if length < ZERO_LENGTH:
        raise site.zero_length(key=key, found=found)
    return LineCurve(site.start, displacement / length, length)
