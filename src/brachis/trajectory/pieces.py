"""Joint motion as polynomials between nodes.

The polynomials are quintic Hermite pieces in Bernstein form, each relative to its first node. The jerk of the pieces is
stored too.

Positions are of the order of 1 rad, and the second differences of the coefficients are divided by h^2. If the node's
position were part of the coefficients, its rounding alone would cause an error of 1e-16 / h^2 in the acceleration,
which is visible in motions of milliseconds.

With x = 2 u - 1, from -1 to 1 over a piece of length h, the jerk is j(x) = m + a x + b (3 x^2 - 1) / 2 with

    m = (qddot1 - qddot0) / h
    a = 3 (qddot0 + qddot1) / h - 6 (qdot1 - qdot0) / h^2
    b = 60 miss / h^3,   miss = q1 - q0 - h / 2 (qdot0 + qdot1) + h^2 / 12 (qddot1 - qddot0)

Positions affect only b. Positions are 64-bit numbers, so the travel q1 - q0 of a piece has an error of at least eps
|q|. Over 0.1 ms, this error corresponds to a jerk of 0.02 rad/s^3, and over 1 us to a jerk of 20,000 rad/s^3. Within
this rounding error, a piece therefore gets the travel with the smallest |b|: rounding errors are not read as jerk, and
larger differences are used fully. All code that evaluates the motion, including the verification, uses this definition.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from brachis.kernel import bernstein


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polynomials of degree m over L pieces of time, equal to SciPy's ``BPoly(pieces.c, pieces.x)``.

    Attributes
    ----------
    c : (m + 1, L, n) ndarray
        Bernstein coefficients of the pieces.
    x : (L + 1,) ndarray
        Times at which the pieces begin and end, s.
    """

    c: np.ndarray
    x: np.ndarray

    def __post_init__(self) -> None:
        """Make the coefficients read-only."""
        self.c.setflags(write=False)

    def __call__(self, t: ArrayLike, nu: int = 0) -> np.ndarray:
        """Return values or derivatives of order `nu`, (..., n), at times t, (...), s; at a node, just after it."""
        if nu > 0:
            return self.derivative(t, nu - 1)
        t = np.asarray(t, dtype=float)
        flat = t.ravel()
        index = np.searchsorted(self.x[1:-1], flat, side="right")
        begin = self.x[index]
        u = (flat - begin) / (self.x[index + 1] - begin)
        values = bernstein(self.c, index, u)
        return values.reshape(t.shape + self.c.shape[2:])

    @cached_property
    def derivative(self) -> Pieces:
        """The derivatives of the polynomials with respect to time."""
        degree = len(self.c) - 1
        if degree == 0:
            return Pieces(np.zeros_like(self.c), self.x)
        return Pieces(
            degree * np.diff(self.c, axis=0) / np.diff(self.x)[:, None], self.x
        )


def piece_coefficients(
    times: np.ndarray,
    q: np.ndarray,
    qdot: np.ndarray,
    after: np.ndarray,
    before: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return Bernstein coefficients of ``q(t) - q[i]`` and of the jerk on every piece i between nodes i and i + 1.

    A Bezier curve of degree 5 and length h begins with q = c0, qdot = 5 (c1 - c0) / h and
    qddot = 20 (c2 - 2 c1 + c0) / h^2, and ends likewise. The jerk is computed from the nodes, because third
    differences of the position coefficients would amplify their rounding errors.

    Parameters
    ----------
    times : (L + 1,) ndarray
        Times of the nodes, s.
    q, qdot : (L + 1, n) ndarray
        Positions and velocities at the nodes.
    after, before : (L + 1, n) ndarray
        Acceleration just after and just before the nodes.

    Returns
    -------
    positions : (6, L, n) ndarray
        Coefficients of the positions, rad or m.
    jerks : (3, L, n) ndarray
        Coefficients of the jerk, rad/s^3 or m/s^3.
    """
    h = np.diff(times)[:, None]
    v0 = qdot[:-1]
    v1 = qdot[1:]
    a0 = after[:-1]
    a1 = before[1:]
    linear = 0.5 * h * (v0 + v1) - h**2 / 12.0 * (a1 - a0)  # travel if b were zero
    far, fast = (
        np.maximum(np.abs(values[1:]), np.abs(values[:-1])) for values in (q, qdot)
    )
    rounding = np.finfo(float).eps * (far + h * fast)
    miss = np.diff(q, axis=0) - linear
    miss = miss - np.clip(miss, -rounding, rounding)
    travel = linear + miss
    slope = h / 5.0
    bend = h**2 / 20.0
    positions = [
        np.zeros_like(travel),
        slope * v0,
        2.0 * slope * v0 + bend * a0,
        travel - 2.0 * slope * v1 + bend * a1,
        travel - slope * v1,
        travel,
    ]
    m = (a1 - a0) / h
    a = 3.0 * (a0 + a1) / h - 6.0 * np.diff(qdot, axis=0) / h**2
    b = 60.0 * miss / h**3
    return np.stack(positions), np.stack([m - a + b, m - 2.0 * b, m + a + b])
