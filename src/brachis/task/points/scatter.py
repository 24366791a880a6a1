"""How much points scatter about a smooth curve, and what that does to the curvature of a curve through all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.task.points.least_squares import Tolerance
from brachis.task.points.points import QUATERNION, Array, Points

_WHITE = -0.25
"""Correlation of neighbouring residuals below which they are noise: -0.8 for white noise, 1 for a smooth curve."""
_NEIGHBOURS = (-2, -1, 1, 2)
_MEDIANS = {1: 0.6745, 2: 1.1774, 3: 1.5382}
"""Median distance from zero of normally distributed points, by their dimension, in standard deviations."""
_NOTHING = 1e-300
_SECOND_DIFFERENCE = 6.0**0.5
"""Standard deviation of the second difference of white noise of standard deviation 1."""


@dataclass(frozen=True)
class Scatter:
    """Scatter of points.

    Attributes
    ----------
    deviation : float
        Standard deviation across the path, m; 0 where the points look smooth, or are too few to tell.
    turning : float
        Standard deviation of each component of their orientations, rad; of yaw; 0 as above.
    spacing : float
        Median distance of successive points, m.
    decimals : int or None
        Digits after the decimal point, of metres, to which all positions are rounded.
    """

    deviation: float
    turning: float
    spacing: float
    decimals: int | None

    def noisy(self, tolerance: Tolerance) -> bool:
        """Tell whether a curve through all points would follow scatter that counts beside a tolerance."""
        return self.deviation > 0.0 or self.turning > 0.1 * tolerance.orientation

    @property
    def curvature(self) -> float:
        """Standard deviation of the curvature of a curve through all points, 1/m, that scatter alone gives it."""
        return (
            _SECOND_DIFFERENCE * self.deviation / self.spacing**2
            if self.deviation
            else 0.0
        )

    def __str__(self) -> str:
        """Say what the scatter looks like."""
        spacing = f"at {1e3 * self.spacing:.3g} mm spacing"
        rounding = np.inf if self.decimals is None else 10.0**-self.decimals
        if rounding / 12.0**0.5 > self.deviation / 3.0 and np.isfinite(rounding):
            return f"positions rounded to {rounding:g} m {spacing}"
        return f"positions that scatter by {1e3 * self.deviation:.3g} mm (standard deviation) {spacing}"

    def of_turning(self) -> str:
        """Say what the scatter of orientations looks like."""
        return f"orientations that scatter by {np.rad2deg(self.turning):.2g} deg (standard deviation)"


def scatter_of(points: Points) -> Scatter:
    """Estimate the scatter of points.

    Each point is compared with the cubic through its two neighbours on either side, over chord lengths; of the
    difference of positions counts what is across the path. Noise makes successive differences alternate, curvature
    does not.
    """
    position = points.position
    turning = points.turning
    chords = np.linalg.norm(np.diff(position, axis=0), axis=1)
    spacing = float(np.median(chords)) if len(chords) else 0.0
    if len(points) < 20 or position.shape[1] not in (2, 3) or not spacing:
        return Scatter(0.0, 0.0, spacing, None)
    along = position[4:] - position[:-4]
    along /= np.maximum(np.linalg.norm(along, axis=1), _NOTHING)[:, None]
    away = _residuals(position, chords)
    across = away - np.sum(away * along, axis=1)[:, None] * along
    deviation = _deviation(across, _MEDIANS[position.shape[1] - 1])
    of_turning = 0.0
    if turning.shape[1]:
        # Half the angle for quaternions, whose scatter has three dimensions; the angle itself for yaw.
        whole, median = (
            (2.0, _MEDIANS[3]) if turning.shape[1] == QUATERNION else (1.0, _MEDIANS[1])
        )
        of_turning = whole * _deviation(_residuals(turning, chords), median)
    return Scatter(deviation, of_turning, spacing, decimals_of(position))


def _deviation(residuals: Array, median_of_one: float) -> float:
    """Return the standard deviation of residuals, (n, c), if they look like noise; zero where they do not."""
    sizes = np.linalg.norm(residuals, axis=1)
    median = float(np.median(sizes))
    if median == 0.0:
        return 0.0
    clipped = (
        residuals * np.minimum(1.0, 5.0 * median / np.maximum(sizes, _NOTHING))[:, None]
    )
    correlation = float(np.sum(clipped[1:] * clipped[:-1]) / np.sum(clipped**2))
    return median / median_of_one if correlation < _WHITE else 0.0


def decimals_of(position: Array) -> int | None:
    """Return the number of decimals to which all values, m, are rounded; None where there are more than twelve."""
    for decimals in range(12 + 1):
        scaled = position * 10.0**decimals
        if np.all(
            np.abs(scaled - np.rint(scaled)) < 1e-9 * np.maximum(np.abs(scaled), 1e3)
        ):
            return decimals
    return None


def _residuals(values: Array, chords: Array) -> Array:
    """Return the differences of values, (n, c), from local cubics, (n - 4, c), scaled to the scatter of one value."""
    count = len(values)
    u = np.concatenate([[0.0], np.cumsum(np.maximum(chords, 1e-12 * chords.max()))])
    inner = np.arange(2, count - 2)
    offsets = np.stack([u[inner + k] - u[inner] for k in _NEIGHBOURS])
    weights = np.ones_like(offsets)
    for i in range(len(_NEIGHBOURS)):
        for j in range(len(_NEIGHBOURS)):
            if i != j:
                weights[i] *= offsets[j] / (offsets[j] - offsets[i])
    foreseen = sum(
        weights[i][:, None] * values[inner + k] for i, k in enumerate(_NEIGHBOURS)
    )
    return np.asarray(
        (values[inner] - foreseen) / np.sqrt(1.0 + np.sum(weights**2, axis=0))[:, None]
    )
