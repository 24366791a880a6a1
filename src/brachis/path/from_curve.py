"""Segments of a path from curves of other libraries: SciPy's splines, or any function.

Largest speeds of the tool along a path, by the feed rates of its points.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.errors import InputError
from brachis.path.sequence import SequencePath
from brachis.task import BSplineSegment, SpeedTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.interpolate import BSpline, PPoly

    from brachis.path.protocol import Array, Path
    from brachis.task import Segment, Task

_SMOOTH = 3
_LEAST_DEGREE, _DEGREE = 4, 5
_SAME = 1e-7
"""Jumps of a derivative, relative to its largest value, that are rounding."""
_COARSEST, _FINEST = 8, 4096


def bspline_segment(
    curve: Callable[[Any], Any],
    interval: tuple[float, float] | None = None,
    *,
    tolerance: float = 1e-9,
) -> dict[str, Any]:
    """Turn a curve into a segment of a task's path.

    Parameters
    ----------
    curve : scipy BSpline, PPoly, CubicSpline, ... or callable
        Piecewise polynomials of SciPy's are taken exactly. Of any other function ``curve(u)`` the values, (m,), are
        asked for at single numbers u in the interval.
    interval : (float, float), optional
        Range of u; of SciPy's curves their own. Required for a function.
    tolerance : float, optional
        Largest distance of a function from the spline that stands for it, rad or m.

    Returns
    -------
    dict
        ``{"bspline": {...}}``, an entry of a task's ``path``.

    Raises
    ------
    InputError
        A derivative up to the third jumps, a function is not smooth enough for the tolerance, or the interval or the
        values do not fit.

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
        own = curve.t[curve.k : len(curve.t) - curve.k]
        spline = _of_pieces(curve, own, curve.k, interval)
    elif isinstance(curve, PPoly):
        spline = _of_pieces(curve, curve.x, len(curve.c) - 1, interval)
    elif interval is None:
        raise InputError(
            "the interval of a function is not known",
            where="interval",
            allowed="(first, last)",
        )
    else:
        spline = _of_function(curve, _check_interval(interval), tolerance)
    parts = {
        "degree": int(spline.k),
        "knots": spline.t.tolist(),
        "control_points": spline.c.tolist(),
    }
    return {"bspline": parts}


def _check_interval(interval: tuple[float, float]) -> tuple[float, float]:
    first, last = (float(end) for end in interval)
    if not (np.isfinite([first, last]).all() and first < last):
        raise InputError(
            "is not an interval",
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
    """Write piecewise polynomials, C3, as a clamped B-spline over the same breaks."""
    first, last = _check_interval(interval or (breaks[0], breaks[-1]))
    inner = np.unique(breaks[(breaks > first) & (breaks < last)])
    after = np.append(inner, last)  # so that there is a place where there are no breaks
    before = np.nextafter(after, first)
    for order in range(_SMOOTH + 1):
        values = _rows(pieces(after, nu=order))
        jumps = np.abs(values - _rows(pieces(before, nu=order))).max(axis=1)
        if jumps.max() > _SAME * (1.0 + np.abs(values).max()):
            place = float(after[int(np.argmax(jumps))])
            raise InputError(
                "the curve is not smooth enough: a path must be smooth to the third derivative",
                where="curve",
                found=f"a jump of {jumps.max():.3g} in derivative {order} at {place:.6g}",
                allowed="three continuous derivatives",
                hint="Interpolate with scipy.interpolate.make_interp_spline(x, y, k=5), or give the waypoints "
                "themselves (spline: {through: ...})",
            )
    degree = max(degree, _LEAST_DEGREE)
    return _interpolate_at_abscissae(
        lambda u: _rows(pieces(u)), first, last, inner, degree, degree - _SMOOTH
    )


def _of_function(
    curve: Callable[[Any], Any], interval: tuple[float, float], tolerance: float
) -> BSpline:
    """Fit a spline of degree 5 to a function, with ever more intervals, until it is met in between as well."""

    def values(u: Array) -> Array:
        points = np.array([np.asarray(curve(float(each)), dtype=float) for each in u])
        if points.ndim != 2 or not np.isfinite(points).all():
            raise InputError(
                "the function's values are no points",
                where="curve",
                allowed="m finite numbers each",
            )
        return points

    count, miss = _COARSEST, np.inf
    while count <= _FINEST:
        breaks = np.linspace(*interval, count + 1)
        spline = _interpolate_at_abscissae(values, *interval, breaks[1:-1], _DEGREE, 1)
        between = breaks[:-1] + np.diff(breaks) * 0.37
        miss = float(np.abs(spline(between) - values(between)).max())
        if miss <= tolerance:
            return spline
        count *= 2
    raise InputError(
        "the function is not smooth enough for a spline",
        where="curve",
        found=f"{miss:.3g} rad or m off with {_FINEST} intervals",
        allowed=f"{tolerance:g}",
        hint="A path must be smooth to the third derivative; raise the tolerance if the function is rounded",
    )


def _interpolate_at_abscissae(
    values: Callable[[Array], Array],
    first: float,
    last: float,
    inner: Array,
    degree: int,
    multiplicity: int,
) -> BSpline:
    """Interpolate at the Greville abscissae, which is exact where the spline space has the function."""
    from scipy.interpolate import make_interp_spline

    ends = np.ones(degree + 1)
    knots = np.concatenate([first * ends, np.repeat(inner, multiplicity), last * ends])
    sites = (
        np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree)
        .mean(axis=1)
        .clip(first, last)
    )
    return make_interp_spline(sites, values(sites), k=degree, t=knots)


def _rows(values: Array) -> Array:
    """One row a point, also of curves of one coordinate."""
    return np.asarray(values, dtype=float).reshape(len(values), -1)


def feed_tables(segments: Sequence[Segment], path: Path) -> tuple[SpeedTable, ...]:
    """Return the tables of a task's segments on the path that was built of them, in order.

    Where one segment's table ends with it and the next one's begins with that, they are one, over the blend between.

    Parameters
    ----------
    segments : sequence of Segment
        Those of the task.
    path : Path
        Built of them by `build_path`.
    """
    if not isinstance(path, SequencePath):
        return ()
    tables: list[tuple[Array, Array]] = []
    goes_on = False
    for begin, end, piece in zip(
        path.breaks, path.breaks[1:], path.pieces, strict=False
    ):
        if piece.segment is None:
            continue
        segment = segments[piece.segment]
        for sigma, speed in map(
            np.transpose,
            segment.bspline.speeds if isinstance(segment, BSplineSegment) else (),
        ):
            at = np.unique(np.clip(sigma, piece.first, piece.last))
            if len(at) > 1:
                s = np.interp(at, [piece.first, piece.last], [begin, end])
                at_start = goes_on and sigma[0] <= piece.first
                before = (
                    tables.pop() if at_start and tables else (np.empty(0), np.empty(0))
                )
                values = np.interp(at, sigma, speed)
                tables.append((np.append(before[0], s), np.append(before[1], values)))
            goes_on = bool(sigma[-1] >= piece.last)
        if not isinstance(segment, BSplineSegment) or not segment.bspline.speeds:
            goes_on = False
    return tuple(
        SpeedTable(s=tuple(s.tolist()), speed=tuple(speed.tolist()))
        for s, speed in tables
    )


def with_feed_rates(task: Task, path: Path) -> Task:
    """Return the task with the feed rates of its path's points among its limits on the tool."""
    tables = feed_tables(task.path, path)
    if not tables:
        return task
    return task.model_copy(
        update={"tool_limits": task.tool_limits.model_copy(update={"feed": tables})}
    )
