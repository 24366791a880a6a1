"""Curves that are given as B-splines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.site import Site, place
from brachis.path.spline import SplineCurve, starts_elsewhere

if TYPE_CHECKING:
    from brachis.task import BSplineCurve

_STARTS_AT = 1e-6
"""How far the start may be from the curve's own, m and rad: the digits that a posture is written with."""


def bspline_curve(shape: BSplineCurve, site: Site) -> SplineCurve:
    """Return the curve of control points, moved so that it begins where the segment starts.

    Raises
    ------
    PathError
        A control point has the wrong number of coordinates, or the curve begins elsewhere.
    """
    # Imported here: it takes half a second, which tasks without a spline need not wait for.
    from scipy.interpolate import BSpline  # noqa: PLC0415

    points = np.array(
        [site.coordinates(point, f"control_points[{i}]", site.rows) for i, point in enumerate(shape.control_points)]
    )
    off = site.start - points[0]
    if not shape.relative and np.abs(off).max() > _STARTS_AT:
        own = place(site.rows, points[0])
        raise starts_elsewhere(f"{site.key}.control_points[0]", f"{site.describe()}, not {own}", _STARTS_AT)
    knots = np.array(shape.knots) - shape.knots[0]
    curve = SplineCurve(BSpline(knots, points + off, shape.degree), float(knots[-1]), np.unique(knots))
    if not np.ptp(points, axis=0).any():
        raise PathError("the segment has zero length", allowed="control points that differ", where=site.key)
    return curve
