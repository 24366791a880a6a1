"""Read-only arrays, vectors, interpolation, bisection, and rates along motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import numpy as np

from brachis.common import tolerances

_Found = TypeVar("_Found")


class LastCall(Generic[_Found]):
    """A function of an array, (K,), that remembers its last result.

    A second call with the same values returns the same array. Callers must not write to this array.

    Parameters
    ----------
    function : callable
    """

    def __init__(self, function: Callable[[np.ndarray], _Found]) -> None:
        self._function = function
        self._known: tuple[bytes, _Found] | None = None

    def __call__(self, values: np.ndarray) -> _Found:
        """Return the value of the function."""
        key = values.tobytes()
        known = self._known
        if known is None or known[0] != key:
            known = (key, self._function(values))
            self._known = known
        return known[1]

    def __getstate__(self) -> dict[str, object]:
        """Leave out the remembered result."""
        return {**vars(self), "_known": None}


def freeze(owner: Any, *names: str) -> None:
    """Replace arrays of a frozen dataclass by read-only copies; None stays None."""
    for name in names:
        value = getattr(owner, name)
        if value is None:
            continue
        copied = np.array(value, dtype=float)
        copied.setflags(write=False)
        object.__setattr__(owner, name, copied)


def clear_rounding(values: np.ndarray) -> np.ndarray:
    """Replace rounding errors by exact zeros, for output; all other values stay as they are.

    Examples
    --------
    >>> import numpy as np
    >>> clear_rounding(np.array([-7.7e-18, 0.1])).tolist()
    [0.0, 0.1]
    """
    return np.where(np.abs(values) < tolerances.ROUNDING, 0.0, values)


def interpolate_columns(
    places: np.ndarray, s: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Interpolate values, (S, c), given at s, (S,), linearly at places, (P,)."""
    return np.column_stack([np.interp(places, s, column) for column in values.T])


def cut(values: np.ndarray, begin: float, end: float) -> np.ndarray:
    """Return the ascending numbers, (P,), that lie between `begin` and `end`, with `begin` and `end` added."""
    inside = values[(values > begin) & (values < end)]
    return np.concatenate([[begin], inside, [end]])


def drop_near(values: np.ndarray, least: float) -> np.ndarray:
    """Leave out each of the ascending numbers, (P,), that is at most `least` below the next one."""
    return values[np.append(np.diff(values) > least, True)]


def count_each(counts: np.ndarray) -> np.ndarray:
    """Count up from 0 once for each of several counts, (N,): the counts 2 and 3 give 0, 1, 0, 1, 2."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def spread(breaks: np.ndarray, points: int | np.ndarray) -> np.ndarray:
    """Spread numbers, such as times, evenly over every interval, including its ends.

    Parameters
    ----------
    breaks : (N + 1,) ndarray
        Ends of the intervals, ascending.
    points : int or (N,) int ndarray
        Number of steps into which each interval is divided.

    Returns
    -------
    (sum of points + 1,) ndarray
    """
    steps = np.broadcast_to(points, len(breaks) - 1)
    width = np.repeat(np.diff(breaks) / steps, steps)
    inside = count_each(steps) * width + np.repeat(breaks[:-1], steps)
    return np.append(inside, breaks[-1])


def bisect(
    is_before: Callable[[np.ndarray], np.ndarray], end: np.ndarray
) -> np.ndarray:
    """Find the numbers between 0 and `end`, (P,), up to which a condition holds.

    Parameters
    ----------
    is_before : callable
        Function that returns for trial numbers, (P,), whether the condition still holds there.
    end : (P,) ndarray
    """
    low = np.zeros(len(end))
    high = end
    for _ in range(45 if len(end) else 0):  # to within 3e-14 of `end`
        middle = 0.5 * (low + high)
        before = is_before(middle)
        low = np.where(before, middle, low)
        high = np.where(before, high, middle)
    return 0.5 * (low + high)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the vector product, (3, ...), of vectors with components along the FIRST axis; other axes broadcast."""
    first = a[1] * b[2]
    product = np.empty((3, *first.shape), dtype=first.dtype)
    np.subtract(first, a[2] * b[1], out=product[0, ...])
    np.subtract(a[2] * b[0], a[0] * b[2], out=product[1, ...])
    np.subtract(a[0] * b[1], a[1] * b[0], out=product[2, ...])
    return product


def apply_each(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Apply K matrices, (K, i, j), to K vectors, (K, j); several times faster if `broadcast_to` repeats one matrix."""
    if len(vectors) and matrices.strides[0] == 0:
        return vectors @ matrices[0].T
    return np.einsum("kij,kj->ki", matrices, vectors)


def extrapolate(
    motion: Sequence[np.ndarray] | np.ndarray, step: np.ndarray | float
) -> list[np.ndarray]:
    """Extrapolate a value and its first two derivatives by a time step, with a constant third derivative."""
    x, xdot, xddot, xdddot = motion
    return [
        x + step * (xdot + step / 2.0 * (xddot + step / 3.0 * xdddot)),
        xdot + step * (xddot + step / 2.0 * xdddot),
        xddot + step * xdddot,
    ]


def rates(
    evaluate: Callable[..., Sequence[np.ndarray]], motion: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Compute time derivatives of functions of a motion, by central differences along the motion.

    Parameters
    ----------
    evaluate : callable
        ``evaluate(x, xdot, xddot, xdddot)`` returns arrays, (2 K, ...), for arrays, (2 K, c).
    motion : sequence of (K, c) ndarray
        Value and its first three time derivatives at K moments.

    Returns
    -------
    list of (K, ...) ndarray
        Per second.
    """
    speeds = [
        np.abs(array).max(axis=1, initial=0.0) ** (1.0 / order)
        for order, array in enumerate(motion[1:], 1)
    ]
    # The error of central differences is of the order of the square of the step, in units of the coordinates.
    h = 3e-5 / np.maximum(np.max(speeds, axis=0), 1.0)
    step = np.concatenate([h, -h])[:, None]
    both = [np.tile(array, (2, 1)) for array in motion]
    sides = (
        np.split(array, 2) for array in evaluate(*extrapolate(both, step), both[3])
    )
    return [
        (ahead - behind) / (2.0 * h.reshape(-1, *[1] * (ahead.ndim - 1)))
        for ahead, behind in sides
    ]


def with_like_signs(quaternions: np.ndarray) -> np.ndarray:
    """Return unit quaternions, (n, 4), with signs that bring each close to the one before; the first keeps its sign."""
    unit = quaternions / np.linalg.norm(quaternions, axis=1)[:, None]
    signs = np.cumprod(np.where(np.sum(unit[1:] * unit[:-1], axis=1) < 0.0, -1.0, 1.0))
    return np.concatenate([unit[:1], signs[:, None] * unit[1:]])


def greville(knots: np.ndarray, degree: int) -> np.ndarray:
    """Return the Greville abscissae, (N + d,), of a clamped knot vector: one time for each control point."""
    windows = np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree)
    return np.asarray(windows.mean(axis=1))
