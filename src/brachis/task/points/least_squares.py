"""Least-squares B-splines through points, and the points' distances from them.

Length along points that scatter: their polygon is longer than the path, and may go back and forth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.task.points.points import Array, Points, angles_between

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
"""Of all fitted curves: C4 at their knots."""
_FARTHEST = 0.02
"""How far a point may be from where it was taken to be, as a part of the length."""


@dataclass(frozen=True)
class Tolerance:
    """How far points may be from the path.

    Attributes
    ----------
    position : float
        m.
    orientation : float
        rad.
    corner : float
        As `position`, where a corner is rounded.
    """

    position: float
    orientation: float
    corner: float


@dataclass(frozen=True, eq=False)
class Fit:
    """A B-spline near points.

    Attributes
    ----------
    spline : BSpline
        Position and turning over sigma from 0 on, about the arc length, m.
    breaks : (N + 1,) ndarray
        Its knots, each once.
    sigma : (n,) ndarray
        For every point, the nearest place on the curve.
    position_errors : (n,) ndarray
        Distances, m.
    turning_errors : (n,) ndarray
        Angles there, rad.
    """

    spline: BSpline
    breaks: Array
    sigma: Array
    position_errors: Array
    turning_errors: Array

    def ratios(self, tolerance: Tolerance) -> Array:
        """Return for every point how much of the tolerance it takes, (n,)."""
        turning = self.turning_errors / tolerance.orientation
        return np.maximum(self.position_errors / tolerance.position, turning)

    def worst(self, tolerance: Tolerance) -> Array:
        """Return the largest of `ratios` in every interval, (N,)."""
        worst = np.zeros(len(self.breaks) - 1)
        np.maximum.at(worst, self.intervals, self.ratios(tolerance))
        return worst

    @property
    def intervals(self) -> np.ndarray:
        """The interval of every point, (n,)."""
        return np.clip(
            np.searchsorted(self.breaks, self.sigma, side="right") - 1,
            0,
            len(self.breaks) - 2,
        )


def fit_over(points: Points, sigma: Array, breaks: Array) -> Fit:
    """Return the spline with given knots whose squared distances from the points are least; it passes both ends.

    Parameters
    ----------
    points : Points
    sigma : (n,) ndarray
        Where on the curve the points are, roughly; their nearest places are then looked for.
    breaks : (N + 1,) ndarray
        Knots.

    Raises
    ------
    ValueError, LinAlgError
        The knots are too dense for the points.
    """
    from scipy.interpolate import BSpline, make_lsq_spline

    order = np.argsort(sigma, kind="stable")
    columns = points.columns
    weights = np.ones(len(points))
    weights[[0, -1]] = 1e3
    origin = columns[0]
    length = float(breaks[-1])
    knots = clamp_knots(breaks / length)
    inside = np.clip(sigma[order] / length, 0.0, 1.0)
    spline = make_lsq_spline(
        inside, columns[order] - origin, knots, k=DEGREE, w=weights[order]
    )
    if not np.isfinite(spline.c).all():
        raise ValueError("the knots are too dense for the points")
    control_points = spline.c + origin
    control_points[[0, -1]] = columns[[0, -1]]
    return measure(
        points, BSpline(knots * length, control_points, DEGREE), breaks, sigma
    )


def clamp_knots(breaks: Array) -> Array:
    """Return the knots of a spline of the degree of all fits, with the ends repeated."""
    return np.concatenate(
        [np.repeat(breaks[0], DEGREE), breaks, np.repeat(breaks[-1], DEGREE)]
    )


def measure(points: Points, spline: BSpline, breaks: Array, sigma: Array) -> Fit:
    """Return the fit with the places on the curve that are nearest to the points, by Newton steps from `sigma`."""
    dimension = points.position.shape[1]
    position = type(spline)(spline.t, spline.c[:, :dimension], spline.k)
    slope = position.derivative()
    sigma = sigma.copy()
    # Of a path that winds, a first rough curve is near points of other windings, too: these are not for the taking.
    far = _FARTHEST * (breaks[-1] - breaks[0])
    low = np.maximum(sigma - far, breaks[0])
    high = np.minimum(sigma + far, breaks[-1])
    for _ in range(2):
        tangent = slope(sigma)
        along = np.sum((points.position - position(sigma)) * tangent, axis=1)
        sigma += along / np.maximum(np.sum(tangent**2, axis=1), 1e-12)
        np.clip(sigma, low, high, out=sigma)
        sigma[[0, -1]] = breaks[[0, -1]]
    values = spline(sigma)
    distances = np.linalg.norm(values[:, :dimension] - points.position, axis=1)
    return Fit(
        spline,
        breaks,
        sigma,
        distances,
        angles_between(values[:, dimension:], points.turning),
    )


def over_arc_length(fit: Fit, dimension: int) -> tuple[Array, Array]:
    """Return the points' places and the knots, measured by the arc length of the fitted position instead of sigma."""
    fine = np.unique(
        np.concatenate(
            [
                np.linspace(a, b, 17)
                for a, b in zip(fit.breaks, fit.breaks[1:], strict=False)
            ]
        )
    )
    middle = (fine[1:] + fine[:-1]) / 2.0
    position = type(fit.spline)(fit.spline.t, fit.spline.c[:, :dimension], fit.spline.k)
    slope = position.derivative()
    speed, between = (np.linalg.norm(slope(at), axis=1) for at in (fine, middle))
    steps = np.diff(fine) * (speed[:-1] + 4.0 * between + speed[1:]) / 6.0
    lengths = np.concatenate([[0.0], np.cumsum(steps)])
    return np.interp(fit.sigma, fine, lengths), np.interp(fit.breaks, fine, lengths)


_AT_LEAST = 1e-9


def lengths_along(position: Array, deviation: float) -> Array:
    """Return the length along the path at each of n positions, (n, p), m; strictly ascending from zero.

    Where the points scatter, it is that of the polygon through the means of blocks of points, so long that the scatter
    of the means is small beside it.
    """
    count = len(position)
    block = _block(position, deviation)
    if block == 1:
        chords = np.linalg.norm(np.diff(position, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(np.maximum(chords, _AT_LEAST))])
    edges = np.arange(0, count + 1, block)
    edges[-1] = count
    sums = np.concatenate(
        [np.zeros((1, position.shape[1])), np.cumsum(position - position[0], axis=0)]
    )
    sizes = np.diff(edges)[:, None]
    means = position[0] + np.diff(sums[edges], axis=0) / sizes
    centres = (edges[:-1] + edges[1:] - 1) / 2.0
    corners = np.concatenate([position[:1], means, position[-1:]])
    chords = np.maximum(np.linalg.norm(np.diff(corners, axis=0), axis=1), _AT_LEAST)
    index = np.concatenate([[-0.5], centres, [count - 0.5]])
    lengths = np.interp(
        np.arange(count), index, np.concatenate([[0.0], np.cumsum(chords)])
    )
    return np.asarray(lengths - lengths[0])


def _block(position: Array, deviation: float) -> int:
    """Return how many points are averaged: twice as many until the blocks are far apart beside the scatter."""
    count = len(position)
    block = 1
    while deviation > 0.0 and 8 * block < count:
        ends = position[::block]
        step = float(np.median(np.linalg.norm(np.diff(ends, axis=0), axis=1)))
        if step > 20.0 * deviation / block**0.5:
            break
        block *= 2
    return block
