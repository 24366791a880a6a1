"""Fits to winding and serpentine paths: how near they come to points and to the true curve, with how many knots.

Usage: python benchmarks/winding_paths.py [FIRST] [COUNT] [--save]

Helices, flat spirals, circles that are passed several times, rasters with round turns, coils round a torus and conical
spirals, with radii of 3 to 300 mm, 1 to 20 turns and 200 to 50,000 points. Points are unevenly spaced, by up to 30 %,
and half of the paths scatter by up to 0.05 mm; one in three has orientations that turn with it. The tolerance is six
times the scatter, 0.02 mm at least. Two distances are shown: that of the points from the fitted curve, which must be
within the tolerance; and that of the fitted curve from the true one, also between the points. Both are found turn by
turn, within a window along polygons that are drawn of the two curves.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

import brachis
from committed import save

COLUMNS = ("seed", "kind", "radius", "points", "turns", "scatter", "knots per turn")
COLUMNS += ("points / tolerance", "curve / tolerance", "seconds", "fitted")
ALLOWED_S = 5.0
ALLOWED_KNOTS = 12.0
"""Knot intervals a turn, on average over all paths."""
DRAWN = 5_000
"""Sides of the polygons of one turn: they are off by no more than 2e-7 of the radius."""

Array = np.ndarray
Curve = Callable[[Array], Array]


def _round(angle: Array, radius: Array | float, height: Array | float) -> Array:
    return np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), height + 0.0 * angle]
    )


def helix(radius: float, turns: float) -> Curve:
    pitch = 0.3 * radius
    return lambda t: _round(2.0 * np.pi * turns * t, radius, pitch * turns * t)


def flat_spiral(radius: float, turns: float) -> Curve:
    return lambda t: _round(2.0 * np.pi * turns * t, radius * (0.3 + 0.7 * t), 0.0)


def repeated_circle(radius: float, turns: float) -> Curve:
    count = max(1, round(turns))
    return lambda t: _round(2.0 * np.pi * count * t, radius, 0.0)


def conical_spiral(radius: float, turns: float) -> Curve:
    return lambda t: _round(
        2.0 * np.pi * turns * t, radius * (1.0 - 0.8 * t), radius * t
    )


def torus_coil(radius: float, turns: float) -> Curve:
    """Wind round a tube of this radius, whose middle is a circle of 1.5 to 6 radii."""
    middle = radius * max(1.5, 0.3 * turns)

    def place(t: Array) -> Array:
        angle = 2.0 * np.pi * turns * t
        along = min(1.0, 0.1 * turns) * 2.0 * np.pi * t
        return _round(along, middle + radius * np.cos(angle), radius * np.sin(angle))

    return place


def raster(radius: float, turns: float) -> Curve:
    """Go to and fro on lines of three radii, with half circles between them; a line and a half circle are a turn."""
    count = max(1, round(turns))
    line = 3.0 * radius
    half = np.pi * radius
    length = line + half

    def place(t: Array) -> Array:
        number = np.minimum((t * count).astype(int), count - 1)
        along = t * count * length - number * length
        sign = np.where(number % 2 == 0, 1.0, -1.0)
        angle = np.clip(along - line, 0.0, half) / radius
        x = np.minimum(along, line) + radius * np.sin(angle)
        y = radius * (1.0 - np.cos(angle)) + 2.0 * radius * number
        return np.column_stack([line / 2.0 + sign * (x - line / 2.0), y, 0.0 * t])

    return place


KINDS: dict[str, Callable[[float, float], Curve]] = {
    "helix": helix,
    "flat spiral": flat_spiral,
    "repeated circle": repeated_circle,
    "raster": raster,
    "torus coil": torus_coil,
    "conical spiral": conical_spiral,
}


@dataclass(frozen=True)
class WindingPath:
    """A path of one kind and points near it.

    Attributes
    ----------
    kind : str
    radius, turns, scatter, tolerance : float
        mm, but for the number of turns.
    true : callable
        Places, (n, 3), mm, for numbers from 0 to 1, (n,).
    t : (n,) ndarray
        Where the points are on it.
    points : (n, 3) ndarray
        mm.
    orientations : Rotation or None
    """

    kind: str
    radius: float
    turns: float
    scatter: float
    tolerance: float
    true: Curve
    t: Array
    points: Array
    orientations: Rotation | None


def winding_path(seed: int, most_points: float = 5e4) -> WindingPath:
    """Return the path of a seed; kinds follow each other."""
    rng = np.random.default_rng(seed)
    kind = list(KINDS)[seed % len(KINDS)]
    radius = float(np.exp(rng.uniform(np.log(3.0), np.log(300.0))))
    turns = float(np.exp(rng.uniform(0.0, np.log(20.0))))
    if kind in {"repeated circle", "raster"}:
        turns = float(round(turns))
    count = int(np.exp(rng.uniform(np.log(200.0), np.log(most_points))))
    scatter = float(rng.uniform(0.0, 0.05)) if seed // len(KINDS) % 2 else 0.0
    true = KINDS[kind](radius, turns)
    t = np.linspace(0.0, 1.0, count)
    t[1:-1] += rng.uniform(-0.15, 0.15, count - 2) / count
    points = true(t) + rng.normal(size=(count, 3)) * scatter
    orientations = None
    if seed // 2 % 3 == 0:
        angle = 2.0 * np.pi * turns * t
        turned = np.column_stack([angle, 0.3 * np.sin(angle), 0.0 * t])
        orientations = Rotation.from_euler("ZYX", turned)
    tolerance = max(0.02, 6.0 * scatter)
    return WindingPath(
        kind, radius, turns, scatter, tolerance, true, t, points, orientations
    )


def fit(path: WindingPath) -> tuple[list[BSpline], int]:
    """Return the curves that brachis fits, mm, and the number of their knot intervals."""
    segments = brachis.fit_path(
        path.points,
        tolerance={"position": f"{path.tolerance:.9f} mm", "orientation": "0.5 deg"},
        orientations=path.orientations,
        units={"length": "mm"},
    )
    curves = []
    for segment in segments:
        curve = segment.bspline
        control_points = 1e3 * np.array(curve.control_points)[:, :3]
        curves.append(BSpline(np.array(curve.knots), control_points, curve.degree))
    return curves, sum(len(np.unique(curve.t)) - 1 for curve in curves)


def shares_of_length(polygon: Array) -> Array:
    """Return how much of a polygon's length comes before each of its corners, (k,), from 0 to 1."""
    sides = np.linalg.norm(np.diff(polygon, axis=0), axis=1)
    lengths = np.append(0.0, np.cumsum(sides))
    return lengths / lengths[-1]


def distances_from(
    polygon: Array, points: Array, shares: Array, window: float
) -> Array:
    """Return distances, (n,), of points from the sides of a polygon, (k, p), of its own turn.

    `shares` are the places of the points along it; `window` is how far the nearest side may be from there.
    """
    at_polygon = shares_of_length(polygon)
    first = np.searchsorted(at_polygon, shares - window)
    last = np.searchsorted(at_polygon, shares + window)
    distances = np.empty(len(points))
    for i, point in enumerate(points):
        part = polygon[max(first[i] - 1, 0) : last[i] + 1]
        side = np.diff(part, axis=0)
        away = point - part[:-1]
        along = np.sum(away * side, axis=1) / np.maximum(
            np.sum(side**2, axis=1), 1e-300
        )
        away -= np.clip(along, 0.0, 1.0)[:, None] * side
        distances[i] = np.linalg.norm(away, axis=1).min()
    return distances


def deviations(
    path: WindingPath, curves: list[BSpline], sides: int = DRAWN, count: int = 4_000
) -> tuple[float, float]:
    """Return the largest distances of the points from the fit, and of this from the true curve, over the tolerance."""
    fine = np.linspace(0.0, 1.0, int(sides * path.turns))
    true = path.true(fine)
    drawn = np.concatenate([curve(fine * curve.t[-1]) for curve in curves])
    window = 0.3 / path.turns
    some = np.unique(np.linspace(0, len(path.t) - 1, count).astype(int))
    at_points = np.interp(path.t[some], fine, shares_of_length(true))
    of_points = distances_from(drawn, path.points[some], at_points, window)
    every = max(1, len(drawn) // count)
    at_drawn = shares_of_length(drawn)[::every]
    of_curve = distances_from(true, drawn[::every], at_drawn, window)
    return of_points.max() / path.tolerance, of_curve.max() / path.tolerance


def main(first: int = 0, count: int = 60) -> int:
    print(*COLUMNS, sep=" | ")
    rows = []
    knots_per_turn = []
    good = 0
    for seed in range(first, first + count):
        path = winding_path(seed)
        cells = [f"{seed}", path.kind, f"{path.radius:.3g} mm", f"{len(path.points)}"]
        cells += [f"{path.turns:.3g}", f"{path.scatter:.3f} mm"]
        start = time.process_time()
        try:
            curves, intervals = fit(path)
        except brachis.BrachisError as error:
            print(*cells, error, sep=" | ", flush=True)
            rows.append([*cells, "-", "-", "-", "-", "no"])
            continue
        seconds = time.process_time() - start
        of_points, of_curve = deviations(path, curves)
        knots_per_turn.append(intervals / path.turns)
        is_good = of_points <= 1.001 and seconds <= ALLOWED_S
        is_good &= len(curves) == 1
        good += is_good
        cells += [f"{knots_per_turn[-1]:.1f}", f"{of_points:.2f}", f"{of_curve:.2f}"]
        cells += [
            f"{seconds:.2f} s",
            "yes" if is_good else f"NO ({len(curves)} curves)",
        ]
        print(*cells, sep=" | ", flush=True)
        rows.append(cells)
    mean = float(np.mean(knots_per_turn))
    total = (
        f"{good} of {count} within the tolerance in {ALLOWED_S:g} s, "
        f"with {mean:.1f} knot intervals a turn on average"
    )
    print(total)
    about = "Helices, spirals, circles passed several times, rasters and coils. The distances are those of the points "
    about += f"from the fitted curve, and of this from the true one. {total}."
    save("Winding and serpentine paths", COLUMNS, rows, about)
    return 0 if good == count and mean <= ALLOWED_KNOTS else 1


if __name__ == "__main__":
    numbers = [argument for argument in sys.argv[1:] if argument != "--save"]
    raise SystemExit(main(*map(int, numbers)))
