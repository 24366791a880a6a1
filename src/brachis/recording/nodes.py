"""From recorded positions to a motion that is twice continuously differentiable.

Derivatives at a row are those of a polynomial through five rows beside it. Of the five rows before, around and behind
it those are taken through which the polynomial bends least (essentially non-oscillatory interpolation: A. Harten,
B. Engquist, S. Osher, S. R. Chakravarthy, Journal of Computational Physics 71, 1987): where accelerations jump, as they
do in time-optimal motions, a spline through all rows would overshoot by a fifth of the jump and ring on both sides.

Positions that are rounded to few digits have no second derivatives of their own: a spline of degree 5 with few knots
takes their place, as near to them as their rounding lets it be.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.recording.jumps import States, with_jumps
from brachis.recording.recording import FEWEST, Recording

_NOISY = 0.01
"""Of the largest acceleration, what rounding may make of it."""
_CENTRED = 0.25
"""Factor on the bend around a row, which is taken unless others bend much less."""
_AT_REST = (1e-3, 1e-2)
"""Of the largest velocity and acceleration: what is less at an end is rest."""
_DEGREE, _FEWEST_INTERVALS, _MORE, _ROWS = 5, 4, 1.2, 3.0
"""Of smoothing splines: the first number of intervals, the factor to the next one, and the fewest rows in each."""
_SLOW = 0.02
"""Of the largest speed: an end that is slower is taken to be at rest."""
_NEAR = 1.05
"""Standard deviations that a smoothing spline may be off, where noise alone is off by one."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """A motion in quintic pieces between nodes.

    Attributes
    ----------
    t : (L + 1,) ndarray
        s.
    q, qdot, qddot : (L + 1, n) ndarray
    told : tuple of str
        How velocities and accelerations were found.
    """

    t: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    told: tuple[str, ...]

    @property
    def at_rest(self) -> tuple[bool, bool]:
        """Whether both ends are at rest, and whether their accelerations vanish too."""
        ends = [0, -1]
        return not self.qdot[ends].any(), not self.qddot[ends].any()


def nodes_of(recording: Recording, noise: float | None = None) -> Nodes:
    """Find velocities and accelerations.

    Parameters
    ----------
    recording : Recording
    noise : float, optional
        Standard deviation of the positions' errors, rad or m; that of their rounding unless given.
    """
    t, q = recording.t, recording.q
    deviation = recording.rounding / np.sqrt(3.0) if noise is None else noise
    h = float(np.median(np.diff(t)))
    rough = np.abs(np.diff(q, n=2, axis=0)).max() / h**2
    if noise is not None or 4.0 * deviation / h**2 > _NOISY * rough:
        told = f"positions, velocities and accelerations of a smoothing spline, {deviation:.2g} rad or m (rms) off"
        return _nodes(States(t, *_smoothed(t, q, deviation)), told)
    if recording.qdot is None:
        _, qdot, qddot, jerk = _differentiated(t, q)
        told = "velocities and accelerations are those of polynomials through five rows each"
    else:
        qdot, qddot, jerk, _ = _differentiated(t, recording.qdot)
        told = "accelerations are those of polynomials through five rows of velocities each"
    motion, jumps = with_jumps(States(t, q, qdot, qddot), jerk)
    return _nodes(motion, told, *([f"accelerations jump between {jumps} pairs of rows"] if jumps else []))


def _nodes(motion: States, *told: str) -> Nodes:
    qdot, qddot = (_with_rest(part, least) for part, least in zip((motion.qdot, motion.qddot), _AT_REST, strict=True))
    return Nodes(motion.t, motion.q, qdot, qddot, told)


def _with_rest(values: np.ndarray, least: float) -> np.ndarray:
    """Return derivatives, (K, n), whose first and last row are zero where they are small."""
    values, largest = values.copy(), np.abs(values).max(axis=0)
    for end in (0, -1):
        if np.all(np.abs(values[end]) <= least * np.maximum(largest, largest.max() * least)):
            values[end] = 0.0
    return values


def _differentiated(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return values, (K, n), and three derivatives at their times."""
    count = len(t)
    h = float(np.median(np.diff(t)))
    first = np.arange(count - FEWEST + 1)[:, None] + np.arange(FEWEST)
    powers = np.arange(FEWEST)
    # Bend of the polynomial through every five rows, each joint beside its own range.
    around = ((t[first] - t[first].mean(axis=1, keepdims=True)) / h)[:, :, None] ** powers
    highest = np.linalg.solve(around, values[first])[:, -1]
    bend = (np.abs(highest) / np.maximum(np.ptp(values, axis=0), np.finfo(float).tiny)).max(axis=1)
    chosen = np.empty(count, dtype=int)
    for i in range(count):
        candidates = np.arange(max(0, i - FEWEST + 1), min(i, count - FEWEST) + 1)
        weights = np.where(candidates == i - FEWEST // 2, _CENTRED, 1.0)
        chosen[i] = candidates[int(np.argmin(weights * bend[candidates]))]
    rows = first[chosen]
    local = ((t[rows] - t[:, None]) / h)[:, :, None] ** powers
    coefficients = np.linalg.solve(local, values[rows])
    return values, coefficients[:, 1] / h, 2.0 * coefficients[:, 2] / h**2, 6.0 * coefficients[:, 3] / h**3


def _smoothed(t: np.ndarray, q: np.ndarray, deviation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a least-squares spline and two derivatives at the times: that of the fewest intervals that will do.

    An end at which the spline is slow is one at rest: both control points there are the same.
    """
    from scipy.interpolate import BSpline  # noqa: PLC0415  (imports in 0.3 s)
    from scipy.sparse.linalg import spsolve  # noqa: PLC0415

    outer, count, resting = np.ones(_DEGREE), float(_FEWEST_INTERVALS), np.zeros(2, dtype=bool)
    while True:
        breaks = np.interp(np.linspace(0.0, 1.0, int(count) + 1), np.linspace(0.0, 1.0, len(t)), t)
        knots = np.concatenate([t[0] * outer, breaks, t[-1] * outer])
        rows = BSpline.design_matrix(t, knots, _DEGREE) @ _tied(len(knots) - _DEGREE - 1, resting)
        spline = BSpline(knots, _tied(len(knots) - _DEGREE - 1, resting) @ spsolve(rows.T @ rows, rows.T @ q), _DEGREE)
        off = np.sqrt(np.mean((spline(t) - q) ** 2, axis=0)).max()
        found = tuple(np.asarray(spline(t, nu=order)) for order in range(3))
        speed = np.abs(found[1]).max(axis=1)
        slow = speed[[0, -1]] < _SLOW * speed.max()
        done = off <= _NEAR * deviation or _MORE * count > len(t) / _ROWS
        if done and (slow <= resting).all():
            return found  # type: ignore[return-value]
        resting, count = (slow, count) if done else (resting, _MORE * count)


def _tied(count: int, resting: np.ndarray) -> Any:  # noqa: ANN401  (SciPy's sparse arrays)
    """Return the matrix, (count, free), from free control points to all; at an end at rest the first two are one."""
    from scipy.sparse import csr_array  # noqa: PLC0415

    columns = np.arange(count)
    columns[1:] -= int(resting[0])
    columns[-1] -= int(resting[1])
    return csr_array((np.ones(count), (np.arange(count), columns)), shape=(count, int(columns[-1]) + 1))
