"""Blends: septic polynomials that round the corner between two curves."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, floor, perm
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.pose import LEAST_QUALITY, POSITIONS, QuaternionPoseCurve, rotations
from brachis.path.rotations import quaternion_derivatives, quaternion_of, with_like_signs
from brachis.path.sampling import smallest
from brachis.path.site import stands_still

if TYPE_CHECKING:
    from brachis.path.joins import Join
    from brachis.path.protocol import Array, Curve

SLOWEST = 0.2
"""Smallest speed (norm of the position's derivative by sigma, 1 on a line) that a blend may have."""
_DEGREE = 7
_CHECKED_POINTS = 201
_ROUNDING = 1e-12
_SIGN_POINTS = 9


@dataclass(frozen=True, eq=False)
class BlendCurve:
    """A polynomial of degree 7 over sigma in [0, length].

    Attributes
    ----------
    coefficients : ndarray, shape (8, m)
        Coefficients of the powers of sigma / length.
    length : float
        Range of sigma.
    """

    coefficients: Array
    length: float

    @property
    def knots(self) -> Array:
        """Start and end: the polynomial is analytic."""
        return np.array([0.0, self.length])

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the polynomial and its derivatives by sigma, shape (order + 1, K, m)."""
        tau = sigma / self.length
        return np.stack([_powers(tau, k) @ self.coefficients / self.length**k for k in range(order + 1)])


def septic(start: Array, end: Array, length: float) -> BlendCurve:
    """Return the septic polynomial with given values and three derivatives at both ends.

    Parameters
    ----------
    start, end : ndarray, shape (4, m)
        Value, first, second and third derivative by sigma.
    length : float
        Range of sigma.
    """
    scale = length ** np.arange(4)[:, None]
    low = start * scale / np.array([factorial(k) for k in range(4)])[:, None]
    at_end = np.stack([_powers(np.ones(1), k)[0] for k in range(4)])
    high = np.linalg.solve(at_end[:, 4:], end * scale - at_end[:, :4] @ low)
    return BlendCurve(np.concatenate([low, high]), length)


def blend(first: Curve, second: Curve, size: float, join: Join) -> BlendCurve | QuaternionPoseCurve:
    """Return the blend that replaces the last `size` of one curve and the first `size` of the next.

    Its length is the mean of the chord and of the polygon over the corner, which keeps its speed near 1. For poses the
    polynomial is that of the position and the quaternion, which is then divided by its length.

    Parameters
    ----------
    first, second : Curve
        The curves that meet.
    size : float
        Replaced range of sigma on either side, m.
    join : Join
        Where they meet.

    Raises
    ------
    PathError
        The blend is longer than half of a neighbour, or (nearly) stops or reverses; or a neighbour turns on the spot;
        or the tool turns too much in the blend.
    """
    positions = join.positions
    _check_neighbours(first, second, size, join)
    start = first.derivatives(np.array([first.length - size]))[:, 0]
    corner = second.derivatives(np.zeros(1), 0)[0, 0]
    end = second.derivatives(np.array([size]))[:, 0]
    chord = _distance(start[0], end[0], positions)
    polygon = _distance(start[0], corner, positions) + _distance(corner, end[0], positions)
    if join.oriented:
        start, end = _with_quaternion(start), _with_quaternion(end)
        end[:, POSITIONS:] *= _sign(first, second, size)
    curve = septic(start, end, (chord + polygon) / 2)
    _check_speed(curve, join)
    return _checked_turning(QuaternionPoseCurve(curve), join) if join.oriented else curve


def _check_neighbours(first: Curve, second: Curve, size: float, join: Join) -> None:
    where, at = f"{join.blend_key}: {join.where}", (join.s, join.s)
    if stands_still(first, join.positions) or stands_still(second, join.positions):
        turning = "the tool turns on the spot" if join.oriented else "yaw alone moves"
        problem = f"a blend needs motion of the position on both sides, and {turning} on one"
        hint = f"Turn {'the tool' if join.oriented else 'yaw'} along a line"
        raise PathError(problem, s_interval=at, found=f"{size:g} m", allowed="no blend here", where=where, hint=hint)
    longest = min(first.length, second.length) / 2
    if size > longest * (1 + _ROUNDING):
        problem = "the blend is longer than half of a neighbouring segment"
        # Rounded down, to whole nanometres, so that the blend that the message names is accepted.
        allowed = f"at most {floor(longest * 1e9) / 1e9:.10g} m"
        raise PathError(problem, s_interval=at, found=f"{size:g} m", allowed=allowed, where=where)


def _check_speed(curve: BlendCurve, join: Join) -> None:
    sigma = np.linspace(0.0, curve.length, _CHECKED_POINTS)
    speed = float(np.linalg.norm(curve.derivatives(sigma, 1)[1, :, : join.positions], axis=1).min())
    if not speed > SLOWEST:
        problem = "the corner is too sharp for a blend, which would all but stop and reverse"
        raise PathError(
            problem,
            s_interval=(join.s, join.s),
            found=f"a smallest speed of {speed:.3g} relative to the segments",
            allowed=f"more than {SLOWEST}",
            where=f"{join.blend_key}: {join.where}",
            hint="Turn in two corners, or by an arc",
        )


def _with_quaternion(pose: Array) -> Array:
    """Return the derivatives of position and quaternion, (4, 7), from those of a pose, (4, 12)."""
    return np.concatenate([pose[:, :POSITIONS], quaternion_derivatives(rotations(pose))], axis=1)


def _sign(first: Curve, second: Curve, size: float) -> float:
    """Return the sign of the end's quaternion that continues the start's along both curves."""
    steps = np.linspace(0.0, size, _SIGN_POINTS)
    poses = [first.derivatives(first.length - size + steps, 0)[0], second.derivatives(steps, 0)[0]]
    quaternions = np.stack([quaternion_of(one) for one in rotations(np.concatenate(poses))])
    return float(np.sign(with_like_signs(quaternions)[-1] @ quaternions[-1]))


def _checked_turning(curve: QuaternionPoseCurve, join: Join) -> QuaternionPoseCurve:
    _, least = smallest(curve.quality, curve.knots)
    if least < LEAST_QUALITY:
        problem = "the tool turns too much in the blend"
        raise PathError(
            problem,
            s_interval=(join.s, join.s),
            found=f"quaternions interpolated with a quality of {least:.2g} out of 1",
            allowed=f"{LEAST_QUALITY} or more",
            where=f"{join.blend_key}: {join.where}",
            hint="Shorten the blend, or turn the tool along longer segments",
        )
    return curve


def _distance(one: Array, other: Array, positions: int) -> float:
    return float(np.linalg.norm((one - other)[:positions]))


def _powers(tau: Array, order: int) -> Array:
    """Return the derivatives of the powers of tau, shape (K, 8)."""
    exponents = np.arange(_DEGREE + 1)
    factors = np.array([perm(k, order) if k >= order else 0 for k in exponents], dtype=float)
    return factors * tau[:, None] ** np.maximum(exponents - order, 0)
