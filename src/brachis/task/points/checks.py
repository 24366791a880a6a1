"""Checks of points for repetitions, spikes and changes of unit, with the row of each mistake; and their scatter.

Scatter is the deviation from a smooth curve. It matters because it adds curvature to a curve through all points.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from brachis.common.words import name_first, write_count
from brachis.errors import TaskError
from brachis.task.point_data import FitTolerance
from brachis.task.points.points import (
    Array,
    Points,
    angles_between,
    is_repeated,
    project_on_sides,
    sum_up,
)

SAME = 1e-9
"""Maximum step that counts as standing still, m or rad."""
_MEDIANS = {1: 0.6745, 2: 1.1774, 3: 1.5382}
"""Median distance of normally distributed points from zero, in standard deviations, by their dimension."""


@dataclass(frozen=True)
class Scatter:
    """Scatter of points about a smooth curve.

    Attributes
    ----------
    deviation : float
        Standard deviation across the path, m; 0 if the points look smooth, or are too few to tell.
    turning : float
        Standard deviation of each component of the orientations, or of yaw, rad; 0 in the same cases.
    spacing : float
        Median distance of successive points, m.
    decimals : int or None
        Number of decimals, in metres, to which all positions are rounded.
    """

    deviation: float
    turning: float
    spacing: float
    decimals: int | None

    def noisy(self, tolerance: FitTolerance) -> bool:
        """Return whether a curve through all points would follow scatter that is not small relative to a tolerance."""
        return self.deviation > 0.0 or self.turning > 0.1 * tolerance.orientation

    @property
    def curvature(self) -> float:
        """Standard deviation of the curvature that scatter alone adds to a curve through all points, 1/m."""
        if not self.deviation:
            return 0.0
        # The second difference of white noise with standard deviation 1 has a standard deviation of sqrt(6).
        return 6.0**0.5 * self.deviation / self.spacing**2

    def __str__(self) -> str:
        """Return a description of the scatter for messages."""
        spacing = f"at {1e3 * self.spacing:.3g} mm spacing"
        rounding = 0.0 if self.decimals is None else 10.0**-self.decimals
        if rounding / 12.0**0.5 > self.deviation / 3.0:
            return f"positions rounded to {rounding:g} m {spacing}"
        return f"positions that scatter by {1e3 * self.deviation:.3g} mm (standard deviation) {spacing}"


def scatter_of(points: Points) -> Scatter:
    """Estimate the scatter of points.

    Each point is compared with the cubic, over chord lengths, through its two neighbours on either side. For positions
    only the difference across the path counts. With noise, successive differences alternate in sign; with curvature
    they do not.
    """
    position = points.position
    turning = points.turning
    chords = points.steps
    spacing = float(np.median(chords)) if len(chords) else 0.0
    if len(points) < 20 or points.dimension not in (2, 3) or not spacing:
        return Scatter(0.0, 0.0, spacing, None)
    along = position[4:] - position[:-4]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    away = _residuals(position, chords)
    across = away - np.sum(away * along, axis=1)[:, None] * along
    deviation = _deviation(across, _MEDIANS[points.dimension - 1])
    of_turning = 0.0
    if turning.shape[1]:
        # Differences of quaternions are half the angle, in three dimensions; differences of yaw are the angle itself.
        dimension, factor = (3, 2.0) if points.has_quaternions else (1, 1.0)
        residuals = _residuals(turning, chords)
        of_turning = factor * _deviation(residuals, _MEDIANS[dimension])
    return Scatter(deviation, of_turning, spacing, decimals_of(position))


def _deviation(residuals: Array, unit_median: float) -> float:
    """Return the standard deviation of residuals, (n, c), if they look like noise; otherwise zero."""
    sizes = np.linalg.norm(residuals, axis=1)
    median = float(np.median(sizes))
    if median == 0.0:
        return 0.0
    clipped = (
        residuals * np.minimum(1.0, 5.0 * median / np.maximum(sizes, 1e-300))[:, None]
    )
    correlation = float(np.sum(clipped[1:] * clipped[:-1]) / np.sum(clipped**2))
    # The correlation is -0.8 for white noise and 1 for a smooth curve.
    return median / unit_median if correlation < -0.25 else 0.0


def decimals_of(position: Array) -> int | None:
    """Return the number of decimals to which all values, m, are rounded; None if there are more than twelve."""
    for decimals in range(13):
        rounded = np.round(position, decimals)
        if np.allclose(position, rounded, rtol=1e-9, atol=10.0 ** (-6 - decimals)):
            return decimals
    return None


def _residuals(values: Array, chords: Array) -> Array:
    """Return the differences, (n - 4, c), of values, (n, c), from local cubics, scaled to the scatter of one value."""
    count = len(values)
    u = sum_up(np.maximum(chords, 1e-12 * chords.max()))
    inner = np.arange(2, count - 2)
    neighbours = (-2, -1, 1, 2)
    offsets = np.stack([u[inner + k] - u[inner] for k in neighbours])
    weights = np.ones_like(offsets)
    for i, j in itertools.permutations(range(4), 2):
        weights[i] *= offsets[j] / (offsets[j] - offsets[i])
    foreseen = sum(
        weight[:, None] * values[inner + k]
        for weight, k in zip(weights, neighbours, strict=True)
    )
    scale = np.sqrt(1.0 + np.sum(weights**2, axis=0))
    return (values[inner] - foreseen) / scale[:, None]


def without_repetitions(points: Points, tolerance: float = 0.0) -> Points:
    """Leave out points that repeat their predecessors to within a fraction of a tolerance, m, and note their rows.

    Raises
    ------
    TaskError
        The position stays the same while the tool turns, or in the whole file.
    """
    again = 1 + np.flatnonzero(is_repeated(points.steps, 0.01 * tolerance))
    turned = angles_between(points.turning[again], points.turning[again - 1])
    for i in again[turned > SAME].tolist():
        raise points.wrong(
            i,
            f"the position is constant from {points.name_row(i - 1)} on while the tool turns",
            allowed="rows with different positions",
            hint="Use separate segments for a turn on the spot: csv, turn, csv",
        )
    remaining = points.only(np.setdiff1d(np.arange(len(points)), again))
    if len(remaining) < 2:
        raise TaskError(
            "all rows have the same position",
            found=f"the same position {len(points)} times",
            allowed="at least two different positions",
            where=points.source,
        )
    if not again.size:
        return points
    count = write_count(len(again), "row")
    rows = name_first([str(row) for row in points.rows[again]], ", ", count=5)
    note = f"left out {count} at the position of the previous row: {points.row}s {rows}"
    return replace(remaining, notes=(*remaining.notes, note))


def refuse_repetitions(points: Points) -> None:
    """Refuse a row with the same position as its predecessor, because a curve through all points would stop there.

    If the position is constant in the whole file, the tool turns on the spot, and the angles are compared instead.

    Raises
    ------
    TaskError
    """
    away = np.linalg.norm(points.position - points.position[0], axis=1)
    still = bool(np.all(away < SAME))
    steps = points.steps
    if still:
        steps = angles_between(points.turning[1:], points.turning[:-1])
    for i in np.flatnonzero(is_repeated(steps)).tolist():
        raise points.wrong(
            i + 1,
            f"the row repeats {points.name_row(i)}",
            found=f"{points.describe(i + 1)}, {steps[i]:.3g} (m or rad) from there",
            allowed=f"rows that differ from their predecessors in {'orientation' if still else 'position'}",
            hint="Set a tolerance to leave out repeated rows",
        )


def refuse_spikes(points: Points, scatter: Scatter, tolerance: float) -> None:
    """Refuse points far from the line between their neighbours, and points at which the unit seems to change.

    Raises
    ------
    TaskError
    """
    _refuse_factors(points)
    if len(points) < 10:
        return
    position = points.position
    before = position[:-2]
    _, off = project_on_sides(position[1:-1], before, position[2:] - before)
    around = 4
    chords = np.pad(points.steps, around, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(chords, 2 * around + 2)
    usual = np.median(windows, axis=1)[: len(off)]
    allowed = np.maximum(4.0 * usual, max(15.0 * scatter.deviation, 2.0 * tolerance))
    i = int(np.argmax(off / allowed))
    if off[i] > allowed[i]:
        away = f"{1e3 * off[i]:.4g} mm off the line between its neighbours; points are {1e3 * usual[i]:.3g} mm apart"
        raise points.wrong(
            i + 1,
            "the point is an outlier, far from its neighbours",
            found=f"{points.describe(i + 1)}, {away}",
            allowed=f"at most {1e3 * allowed[i]:.3g} mm",
            hint="Correct or remove the row",
        )


def plausibility_note(points: Points) -> str | None:
    """Return a remark if the whole path seems to be in mm instead of m or vice versa; otherwise None."""
    extent = float(np.linalg.norm(np.ptp(points.position, axis=0)))
    if extent > 100.0:  # longer than paths of robots
        return f"the path is {extent:.4g} m long and wide: is it in mm? Set units: {{length: mm}}"
    if extent < 1e-4:
        return f"the path is {1e3 * extent:.4g} mm long and wide: is it in m? Set units: {{length: m}}"
    return None


def _refuse_factors(points: Points) -> None:
    """Refuse a step at which all coordinates become a thousand times larger or smaller."""
    before = points.position[:-1]
    after = points.position[1:]
    is_far = points.steps > 20.0 * np.median(points.steps)
    for factor, word in ((1e3, "larger"), (1e-3, "smaller")):
        off = np.linalg.norm(after - factor * before, axis=1)
        is_scaled = off < 0.1 * factor * np.linalg.norm(before, axis=1)
        for i in np.flatnonzero(is_far & is_scaled).tolist():
            raise points.wrong(
                i + 1,
                f"the coordinates are a thousand times {word} than in {points.name_row(i)}",
                allowed=f"coordinates close to {points.describe(i)}",
                hint="Check for mixed mm and m, or a missing decimal point. Write all rows in the same unit",
            )
