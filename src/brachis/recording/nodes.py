"""From recorded positions to a motion that is twice continuously differentiable.

Derivatives at a row are those of a polynomial through five rows beside it. Of the five rows before, around and behind
it those are taken through which the polynomial bends least (essentially non-oscillatory interpolation: A. Harten,
B. Engquist, S. Osher, S. R. Chakravarthy, Journal of Computational Physics 71, 1987): where accelerations jump, as they
do in time-optimal motions, a spline through all rows would overshoot by a fifth of the jump and ring on both sides.

Velocities and accelerations of the file take their place where they agree with them.

Positions that are rounded to few digits have no second derivatives of their own: a smoothing spline takes their place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.errors import write_count
from brachis.recording.jumps import States, with_jumps
from brachis.recording.recording import FEWEST, Recording
from brachis.recording.smoothing import smoothed

_ROUNDED, _NOISY = 1e-3, 0.2
"""Of a joint's largest acceleration, what rounding makes of it where a smoothing spline takes its place if it is as
near to the rows as they are exact, and where in any case."""
_BETWEEN = 60.0
"""Acceleration of a quintic piece of 1 s, for a position that is 1 rad off."""
_AGREES = 0.02
"""Of the largest one, what half of the file's rates may differ from those of polynomials."""
_CENTRED = 0.25
"""Factor on the bend around a row, which is taken unless others bend much less."""
_AT_REST = (1e-3, 1e-2)
"""Of the largest velocity and acceleration: what is less at an end is rest."""


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


def nodes_of(recording: Recording, deviation: np.ndarray) -> Nodes:
    """Find velocities and accelerations.

    Parameters
    ----------
    recording : Recording
    deviation : (n,) ndarray
        Standard deviation of every joint's positions, rad or m; 0 where they are exact.
    """
    t, told = recording.t, []
    parts = _smoothed(t, recording.q, deviation)
    exact = np.isnan(parts[0, 0])
    for unit in dict.fromkeys(recording.units):
        of_unit = ~exact & (np.array(recording.units) == unit)
        if of_unit.any():
            off = f"{deviation[of_unit].max():.2g} {unit} (rms) off"
            told.append(f"positions in {unit}, velocities and accelerations of a smoothing spline, {off}")
    if not exact.any():
        return _nodes(States(t, *parts[:3]), *told)
    parts[:, :, exact], how = _interpolated(recording, exact)
    motion, jumps = with_jumps(States(t, *parts[:3]), parts[3])
    pairs = write_count(jumps, "pair")
    return _nodes(motion, *told, how, *([f"accelerations jump between {pairs} of rows"] if jumps else []))


def _smoothed(t: np.ndarray, q: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Return positions and three derivatives of splines, (4, K, n), NaN of joints that need none."""
    parts = np.full((4, *q.shape), np.nan)
    bends = np.maximum(np.abs(np.diff(q, n=2, axis=0)).max(axis=0), np.finfo(float).tiny)
    doubt = _BETWEEN * deviation / bends
    for least in (_ROUNDED, _NOISY):
        rough = doubt > least
        if rough.any():
            spline = smoothed(t, q[:, rough], deviation[rough])
            if spline.explains or least == _NOISY:
                parts[:, :, rough] = spline.derivatives
                break
    return parts


def _interpolated(recording: Recording, joints: np.ndarray) -> tuple[np.ndarray, str]:
    """Return positions and three derivatives, (4, K, j), of some joints, and how they were found."""
    parts = _differentiated(recording.t, recording.q[:, joints])
    told = "velocities and accelerations are those of polynomials through five rows each"
    names = {1: ("qdot", "velocities"), 2: ("qddot", "accelerations")}
    for order, (name, words) in names.items():
        given = getattr(recording, name)
        if given is None:
            continue
        given = given[:, joints]
        largest = np.abs(parts[order]).max(axis=0)
        if (np.median(np.abs(given - parts[order]), axis=0) > _AGREES * largest).any():
            told += f"; the file's {words} do not agree with them and are left out"
            continue
        parts[order:] = _differentiated(recording.t, given)[: 4 - order]
        told = f"{words} are the file's"
        if order == 1:
            told = "velocities are the file's, accelerations are those of polynomials through five rows of them"
    return parts, told


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


def _differentiated(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values, (K, n), and three derivatives at their times, (4, K, n)."""
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
    return np.stack([values, coefficients[:, 1] / h, 2.0 * coefficients[:, 2] / h**2, 6.0 * coefficients[:, 3] / h**3])
