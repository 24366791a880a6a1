"""Segments from curves of other libraries, and speeds of the tool along a path from the feed rates of its points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.common.arrays import cut, greville
from brachis.errors import InputError, PathError
from brachis.path.protocol import Array
from brachis.path.sequence import Path
from brachis.task import Segment, SpeedTable, Task
from brachis.task.segments import SMOOTHNESS

if TYPE_CHECKING:
    from scipy.interpolate import BSpline, PPoly


def bspline_segment(
    curve: Callable[[Any], Any],
    interval: tuple[float, float] | None = None,
    *,
    tolerance: float = 1e-9,
) -> dict[str, Any]:
    """Convert a curve to a segment of a task's path.

    Parameters
    ----------
    curve : scipy BSpline, PPoly, CubicSpline, ... or callable
        Piecewise polynomials of SciPy are converted exactly. Any other function ``curve(u)`` is called with single
        numbers u in the interval and must return values, (m,).
    interval : (float, float), optional
        Range of u, required for a function. For curves of SciPy, the default is the curve's own range.
    tolerance : float, optional
        Maximum distance between a function and the spline that replaces it, rad or m.

    Returns
    -------
    dict
        ``{"bspline": {...}}``, an entry of a task's ``path``.

    Raises
    ------
    InputError
        One of the first three derivatives jumps, a function is not smooth enough for the tolerance, or the interval or
        the values are invalid.

    Examples
    --------
    >>> import numpy as np
    >>> from brachis import bspline_segment
    >>> segment = bspline_segment(lambda u: [np.sin(u), u, 1.0], (0.0, 1.0))
    >>> segment["bspline"]["degree"]
    5
    """
    from scipy.interpolate import BSpline, PPoly

    if isinstance(curve, BSpline):
        breaks = curve.t[curve.k : len(curve.t) - curve.k]
        spline = _of_pieces(curve, breaks, curve.k, interval)
    elif isinstance(curve, PPoly):
        spline = _of_pieces(curve, curve.x, len(curve.c) - 1, interval)
    elif interval is None:
        raise InputError(
            "the interval of the function is missing",
            where="interval",
            allowed="(first, last)",
        )
    else:
        spline = _of_function(curve, _check_interval(interval), tolerance)
    return {
        "bspline": {
            "degree": int(spline.k),
            "knots": spline.t.tolist(),
            "control_points": spline.c.tolist(),
        }
    }


def _check_interval(interval: tuple[float, float]) -> tuple[float, float]:
    first, last = map(float, interval)
    if not (np.isfinite([first, last]).all() and first < last):
        raise InputError(
            "this is not an interval",
            where="interval",
            found=interval,
            allowed="(first, last), first < last",
        )
    return first, last


def _of_pieces(
    pieces: BSpline | PPoly,
    breaks: Array,
    degree: int,
    interval: tuple[float, float] | None,
) -> BSpline:
    """Convert C3 piecewise polynomials to a clamped B-spline over the same breaks."""
    first, last = _check_interval(interval or (breaks[0], breaks[-1]))
    grid = cut(np.unique(breaks), first, last)
    after = grid[1:]
    before = np.nextafter(after, first)
    for order in range(SMOOTHNESS + 1):
        values = _rows(pieces(after, nu=order))
        jumps = np.abs(values - _rows(pieces(before, nu=order))).max(axis=1)
        if jumps.max() > 1e-7 * (1.0 + np.abs(values).max()):
            place = after[np.argmax(jumps)]
            raise InputError(
                "the curve is not smooth enough: a path must be smooth to the third derivative",
                where="curve",
                found=f"a jump of {jumps.max():.3g} in derivative {order} at {place:.6g}",
                allowed="three continuous derivatives",
                hint="Interpolate with scipy.interpolate.make_interp_spline(x, y, k=5), or give the waypoints "
                "themselves (spline: {through: ...})",
            )
    return _interpolate(lambda u: _rows(pieces(u)), grid, max(degree, SMOOTHNESS + 1))


def _of_function(
    curve: Callable[[Any], Any], interval: tuple[float, float], tolerance: float
) -> BSpline:
    """Fit a spline of degree 5 to a function, with more and more intervals, until both agree between nodes as well."""

    def values(u: Array) -> Array:
        """Return the function's values, (K, m), after checking them."""
        points = np.array(
            [np.asarray(curve(float(number)), dtype=float) for number in u]
        )
        if points.ndim != 2 or not np.isfinite(points).all():
            raise InputError(
                "the function's values are not points of a path",
                where="curve",
                allowed="m finite numbers each",
            )
        return points

    for count in 2 ** np.arange(3, 13):
        breaks = np.linspace(*interval, count + 1)
        spline = _interpolate(values, breaks, 5, multiplicity=1)
        between = breaks[:-1] + np.diff(breaks) * 0.37
        miss = np.abs(spline(between) - values(between)).max()
        if miss <= tolerance:
            return spline
    raise InputError(
        "the function is not smooth enough for a spline",
        where="curve",
        found=f"{miss:.3g} rad or m off with {count} intervals",
        allowed=f"{tolerance:g}",
        hint="A path must be smooth to the third derivative; raise the tolerance if the function's values are rounded",
    )


def _interpolate(
    values: Callable[[Array], Array],
    breaks: Array,
    degree: int,
    multiplicity: int | None = None,
) -> BSpline:
    """Interpolate at the Greville abscissae, which is exact if the function is in the spline space.

    Inner breaks are knots of this multiplicity. Default: the largest multiplicity that leaves three continuous
    derivatives.
    """
    from scipy.interpolate import make_interp_spline

    times = np.full(len(breaks), multiplicity or degree - SMOOTHNESS)
    times[[0, -1]] = degree + 1
    knots = np.repeat(breaks, times)
    abscissae = greville(knots, degree).clip(breaks[0], breaks[-1])
    return make_interp_spline(abscissae, values(abscissae), k=degree, t=knots)


def _rows(values: Array) -> Array:
    """Return values with one row for each point, even for curves with only one coordinate."""
    return np.asarray(values, dtype=float).reshape(len(values), -1)


def feed_tables(segments: Sequence[Segment], path: Path) -> tuple[SpeedTable, ...]:
    """Return the speed tables of a task's segments along the path that was built from them, in order.

    If the table of one segment reaches the segment's end, and the table of the next segment starts at its beginning,
    the two tables are joined over the blend.

    Parameters
    ----------
    segments : sequence of Segment
        Segments of the task.
    path : Path
        The path that `build_path` built from them.
    """
    tables: list[Array] = []
    goes_on = False  # whether the last table applies up to the end of its segment
    for (begin, end), span in zip(pairwise(path.breaks), path.spans, strict=True):
        if len(span.segments) != 1:
            continue
        segment = segments[span.segments[0]]
        speeds = getattr(segment.shape, "speeds", ())
        if getattr(segment, "speed", None):  # the segment has a process speed
            speeds = ()
        for sigma, speed in map(np.transpose, speeds):
            at = np.unique(np.clip(sigma, span.first, span.last))
            if len(at) > 1:
                s = np.interp(at, [span.first, span.last], [begin, end])
                table = np.stack([s, np.interp(at, sigma, speed)])
                if goes_on and tables and sigma[0] <= span.first:
                    table = np.concatenate([tables.pop(), table], axis=1)
                tables.append(table)
            goes_on = bool(sigma[-1] >= span.last)
        goes_on &= bool(speeds)
    return tuple(
        SpeedTable(s=tuple(s), speed=tuple(speed))
        for s, speed in (table.tolist() for table in tables)
    )


def with_feed_rates(task: Task, path: Path) -> Task:
    """Add the feed rates of the path's points to the tool limits of a task."""
    shapes = [segment.shape for segment in task.path]
    if task.begins_elsewhere and any(getattr(shape, "speeds", ()) for shape in shapes):
        raise PathError(
            "feed rates of points hold in the direction in which they are written",
            where="path_reversed" if task.path_reversed else "path_begin",
            allowed="a path without feed rates",
        )
    tables = feed_tables(task.path, path)
    if not tables:
        return task
    limits = task.tool_limits.model_copy(update={"feed": tables})
    return task.model_copy(update={"tool_limits": limits})
