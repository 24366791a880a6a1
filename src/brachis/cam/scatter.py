"""How much points scatter about a smooth curve, and what that does to the curvature of a curve through all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.cam.points import Array

_FEWEST = 20
_WHITE = -0.25
"""Correlation of neighbouring residuals below which they are noise: -0.8 for white noise, 1 for a smooth curve."""
_NEIGHBOURS = (-2, -1, 1, 2)
_MEDIANS = {2: 0.6745, 3: 1.1774}
"""Median distance from a line of normally distributed points, by the dimension of space, in standard deviations."""
_CLIP = 5.0
_MOST_DECIMALS = 12
_SECOND_DIFFERENCE = 6.0**0.5
"""Standard deviation of the second difference of white noise of standard deviation 1."""


@dataclass(frozen=True)
class Scatter:
    """Scatter of points.

    Attributes
    ----------
    deviation : float
        Standard deviation across the path, m; 0 where the points look smooth, or are too few to tell.
    spacing : float
        Median distance of successive points, m.
    decimals : int or None
        Digits after the decimal point, of metres, to which all positions are rounded.
    """

    deviation: float
    spacing: float
    decimals: int | None

    @property
    def curvature(self) -> float:
        """Standard deviation of the curvature of a curve through all points, 1/m, that scatter alone gives it."""
        return _SECOND_DIFFERENCE * self.deviation / self.spacing**2 if self.deviation else 0.0

    def __str__(self) -> str:
        """Say what the scatter looks like."""
        spacing = f"at {1e3 * self.spacing:.3g} mm spacing"
        rounding = np.inf if self.decimals is None else 10.0**-self.decimals
        if rounding / 12.0**0.5 > self.deviation / 3.0 and np.isfinite(rounding):
            return f"positions rounded to {rounding:g} m {spacing}"
        return f"positions that scatter by {1e3 * self.deviation:.3g} mm (standard deviation) {spacing}"


def scatter_of(position: Array) -> Scatter:
    """Estimate the scatter of positions, (n, p), m.

    Each point is compared with the cubic through its two neighbours on either side, over chord lengths; of the
    difference counts what is across the path. Noise makes successive differences alternate, curvature does not.
    """
    chords = np.linalg.norm(np.diff(position, axis=0), axis=1)
    spacing = float(np.median(chords)) if len(chords) else 0.0
    count, dimension = position.shape
    if count < _FEWEST or dimension not in _MEDIANS:
        return Scatter(0.0, spacing, None)
    across = _residuals(position, chords)
    sizes = np.linalg.norm(across, axis=1)
    median = float(np.median(sizes))
    if median == 0.0:
        return Scatter(0.0, spacing, None)
    clipped = across * np.minimum(1.0, _CLIP * median / np.maximum(sizes, 1e-300))[:, None]
    correlation = float(np.sum(clipped[1:] * clipped[:-1]) / np.sum(clipped**2))
    deviation = median / _MEDIANS[dimension] if correlation < _WHITE else 0.0
    return Scatter(deviation, spacing, decimals_of(position))


def decimals_of(position: Array) -> int | None:
    """Return the number of decimals to which all values, m, are rounded; None where there are more than twelve."""
    for decimals in range(_MOST_DECIMALS + 1):
        scaled = position * 10.0**decimals
        if np.all(np.abs(scaled - np.rint(scaled)) < 1e-9 * np.maximum(np.abs(scaled), 1e3)):
            return decimals
    return None


def _residuals(position: Array, chords: Array) -> Array:
    """Return the differences across the path, (n - 4, p), scaled to the deviation of the points."""
    count = len(position)
    u = np.concatenate([[0.0], np.cumsum(np.maximum(chords, 1e-12 * chords.max(initial=1e-300)))])
    inner = np.arange(2, count - 2)
    offsets = np.stack([u[inner + k] - u[inner] for k in _NEIGHBOURS])
    weights = np.ones_like(offsets)
    for i in range(4):
        for j in range(4):
            if i != j:
                weights[i] *= offsets[j] / (offsets[j] - offsets[i])
    foreseen = sum(weights[i][:, None] * position[inner + k] for i, k in enumerate(_NEIGHBOURS))
    away = (position[inner] - foreseen) / np.sqrt(1.0 + np.sum(weights**2, axis=0))[:, None]
    along = position[inner + 2] - position[inner - 2]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    return np.asarray(away - np.sum(away * along, axis=1)[:, None] * along)
