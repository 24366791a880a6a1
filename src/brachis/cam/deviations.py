"""How far points are from a fitted curve, by a formula that the fit does not use.

The curve is drawn as a polygon of many sides. The nearest of its corners to a point is found in a k-d tree; the
distance is that from the two sides at this corner. It does not know where the fit took the point to be.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.cam.points import Array, Points, angles_between

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_SIDES = 20_000
_LEAST_SIDES = 64


def deviations(points: Points, spline: BSpline) -> tuple[Array, Array]:
    """Return the distances, m, and the angles, rad, between points and a curve, (n,) each.

    Parameters
    ----------
    points : Points
    spline : BSpline
        Position and turning, as `Points.columns`.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415

    breaks = np.unique(spline.t)
    count = max(_LEAST_SIDES, _SIDES // (len(breaks) - 1))
    sides = np.arange(count) / count
    sigma = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * sides).ravel(), breaks[-1])
    drawn = spline(sigma)
    dimension = points.position.shape[1]
    place, turning = drawn[:, :dimension], drawn[:, dimension:]
    _, nearest = cKDTree(place).query(points.position)
    distances, angles = np.full(len(points), np.inf), np.zeros(len(points))
    for offset in (-1, 0):
        first = np.clip(nearest + offset, 0, len(place) - 2)
        side = place[first + 1] - place[first]
        share = np.sum((points.position - place[first]) * side, axis=1) / np.maximum(np.sum(side**2, axis=1), 1e-300)
        share = np.clip(share, 0.0, 1.0)[:, None]
        away = np.linalg.norm(points.position - place[first] - share * side, axis=1)
        nearer = away < distances
        distances[nearer] = away[nearer]
        between = turning[first] + share * (turning[first + 1] - turning[first])
        angles[nearer] = angles_between(between, points.turning)[nearer]
    return distances, angles
