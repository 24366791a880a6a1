"""How far points are from a fitted curve, by a formula that the fit does not use.

The curve is drawn as a polygon of many sides. Stretch by stretch of the points, the nearest of its corners to each is
found in a k-d tree of those that lie near where the stretch before ended: a path may cross itself, or go round several
times. The nearest place on the two sides at this corner is a place on the curve, to which distance and angle are taken.
Where the fit took the point to be is not known here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from brachis.cam.points import Array, Points, angles_between

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_SIDES = 20_000
_LEAST_SIDES = 64
_STRETCH, _AROUND = 0.005, 0.01
"""Parts of the curve's length: of a stretch of points, and of how far beyond its ends its corners are looked for."""
_SHARE_OF_POINTS = 1_000


def deviations(points: Points, spline: BSpline) -> tuple[Array, Array]:
    """Return the distances, m, and the angles, rad, between points and a curve, (n,) each.

    Parameters
    ----------
    points : Points
        In the order in which the curve passes them; it begins at the first one.
    spline : BSpline
        Position and turning, as `Points.columns`.
    """
    breaks = np.unique(spline.t)
    count = max(_LEAST_SIDES, _SIDES // (len(breaks) - 1))
    sides = np.arange(count) / count
    sigma = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * sides).ravel(), breaks[-1])
    dimension = points.position.shape[1]
    place = spline(sigma)[:, :dimension]
    nearest = _nearest(points.position, place)
    distances, at = np.full(len(points), np.inf), np.zeros(len(points))
    for offset in (-1, 0):
        first = np.clip(nearest + offset, 0, len(place) - 2)
        side = place[first + 1] - place[first]
        share = np.sum((points.position - place[first]) * side, axis=1) / np.maximum(np.sum(side**2, axis=1), 1e-300)
        share = np.clip(share, 0.0, 1.0)
        away = np.linalg.norm(points.position - place[first] - share[:, None] * side, axis=1)
        nearer = away < distances
        distances[nearer] = away[nearer]
        at[nearer] = (sigma[first] + share * (sigma[first + 1] - sigma[first]))[nearer]
    curve = spline(at)
    distances = np.linalg.norm(points.position - curve[:, :dimension], axis=1)
    return distances, angles_between(curve[:, dimension:], points.turning)


def _nearest(position: Array, place: Array) -> Array:
    """Return the polygon's nearest corner to each of n points, (n,), in their order."""
    from scipy.spatial import cKDTree  # noqa: PLC0415

    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
    nearest, reached = np.zeros(len(position), dtype=int), 0.0
    for stretch, length in _stretches(position, along[-1]):
        beyond = _AROUND * along[-1]
        low, high = np.searchsorted(along, [reached - beyond, reached + length + beyond])
        low, high = max(0, low - 1), high + 1
        nearest[stretch] = low + cKDTree(place[low:high]).query(position[stretch])[1]
        reached = along[nearest[stretch][-1]]
    return nearest


def _stretches(position: Array, total: float) -> Iterator[tuple[slice, float]]:
    """Cut n points into stretches, with the length of each from the last point before it to its own last one, m.

    The points' polygon is no shorter than the path between them, but for the tolerance.
    """
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1)))
    most = max(1, len(position) // _SHARE_OF_POINTS)
    first = 0
    while first < len(position):
        before = lengths[max(first - 1, 0)]
        last = min(int(np.searchsorted(lengths, before + _STRETCH * total, side="right")), first + most)
        last = max(last, first + 1)
        yield slice(first, last), float(lengths[last - 1] - before)
        first = last
