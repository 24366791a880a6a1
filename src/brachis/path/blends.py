"""Blends: septic polynomials that round the corner between two curves.

Septic polynomials between given derivatives.

Blends between curves of poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, floor, perm
from typing import TYPE_CHECKING

import numpy as np

from brachis.common.arrays import with_like_signs
from brachis.errors import PathError
from brachis.path.joins import smallest
from brachis.path.pose import LEAST_QUALITY, POSITIONS, QuaternionPoseCurve, rotations
from brachis.path.rotations import quaternion_derivatives, quaternions_of, rotation_of
from brachis.path.site import stands_still
from brachis.robot.plausibility import position_hint

if TYPE_CHECKING:
    from brachis.path.joins import Join
    from brachis.path.protocol import Array, Curve

_DEGREE = 7


@dataclass(frozen=True, eq=False)
class SepticCurve:
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
        u = sigma / self.length
        return np.stack(
            [
                _powers(u, k) @ self.coefficients / self.length**k
                for k in range(order + 1)
            ]
        )


def septic(start: Array, end: Array, length: float) -> SepticCurve:
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
    return SepticCurve(np.concatenate([low, high]), length)


def _powers(u: Array, order: int) -> Array:
    """Return the derivatives of the powers of the normalised parameter, shape (K, 8)."""
    exponents = np.arange(_DEGREE + 1)
    factors = np.array(
        [perm(k, order) if k >= order else 0 for k in exponents], dtype=float
    )
    return factors * u[:, None] ** np.maximum(exponents - order, 0)


SLOWEST = 0.2
"""Smallest speed (norm of the position's derivative by sigma, 1 on a line) that a blend may have."""
_CHECKED_POINTS = 201
_ROUNDING = 1e-12


def blend_rows(first: Curve, second: Curve, size: float, join: Join) -> SepticCurve:
    """Return the blend that replaces the last `size` of one curve and the first `size` of the next.

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
        The blend is longer than half of a neighbour, or (nearly) stops or reverses; or a neighbour moves yaw alone.
    """
    check_neighbours(first, second, size, join, still="yaw alone moves", turning="yaw")
    start, end, length = ends(first, second, size, join.positions)
    return checked_septic(start, end, length, join)


def check_neighbours(
    first: Curve, second: Curve, size: float, join: Join, *, still: str, turning: str
) -> None:
    """Refuse a blend where the position stands still, or that is too long.

    `still` says what happens where it stands still, and `turning` names what turns there.

    Raises
    ------
    PathError
    """
    where, at = f"{join.blend_key}: {join.where}", (join.s, join.s)
    if stands_still(first, join.positions) or stands_still(second, join.positions):
        raise PathError(
            f"a blend needs motion of the position on both sides, and {still} on one",
            s_interval=at,
            found=f"{size:g} {join.unit}",
            allowed="no blend here",
            where=where,
            hint=f"Turn {turning} along a line",
        )
    longest = min(first.length, second.length) / 2
    if size > longest * (1 + _ROUNDING):
        # Rounded down, to whole nanometres, so that the blend that the message names is accepted.
        raise PathError(
            "the blend is longer than half of a neighbouring segment",
            s_interval=at,
            found=f"{size:g} {join.unit}",
            allowed=f"at most {floor(longest * 1e9) / 1e9:.10g} {join.unit}",
            where=where,
            hint=position_hint(size, 0.0, longest, join.unit),
        )


def ends(
    first: Curve, second: Curve, size: float, positions: int
) -> tuple[Array, Array, float]:
    """Return the derivatives, (4, m), at the start and the end of a blend, and its length.

    The length is the mean of the chord and of the polygon over the corner, which keeps the blend's speed near 1.
    """
    start = first.derivatives(np.array([first.length - size]))[:, 0]
    corner = second.derivatives(np.zeros(1), 0)[0, 0]
    end = second.derivatives(np.array([size]))[:, 0]
    chord = _distance(start[0], end[0], positions)
    polygon = _distance(start[0], corner, positions) + _distance(
        corner, end[0], positions
    )
    return start, end, (chord + polygon) / 2


def checked_septic(start: Array, end: Array, length: float, join: Join) -> SepticCurve:
    """Return the septic polynomial between derivatives (4, m), after a check that its position keeps going.

    Raises
    ------
    PathError
    """
    curve = septic(start, end, length)
    sigma = np.linspace(0.0, curve.length, _CHECKED_POINTS)
    speed = float(
        np.linalg.norm(
            curve.derivatives(sigma, 1)[1, :, : join.positions], axis=1
        ).min()
    )
    if not speed > SLOWEST:
        raise PathError(
            "the corner is too sharp for a blend, which would all but stop and reverse",
            s_interval=(join.s, join.s),
            found=f"a smallest speed of {speed:.3g} relative to the segments",
            allowed=f"more than {SLOWEST}",
            where=f"{join.blend_key}: {join.where}",
            hint="Turn in two corners, or by an arc",
        )
    return curve


def _distance(one: Array, other: Array, positions: int) -> float:
    return float(np.linalg.norm((one - other)[:positions]))


_SIGN_POINTS = 9


def blend_poses(
    first: Curve, second: Curve, size: float, join: Join
) -> QuaternionPoseCurve:
    """Return the blend that replaces the last `size` of one curve of poses and the first `size` of the next.

    It is the polynomial of the position and the quaternion, which is then divided by its length; see
    `brachis.path.blends.blend_rows`.

    Raises
    ------
    PathError
        As for rows; or the tool turns too much in the blend.
    """
    check_neighbours(
        first,
        second,
        size,
        join,
        still="the tool turns on the spot",
        turning="the tool",
    )
    start, end, length = ends(first, second, size, join.positions)
    start, end = _with_quaternion(start), _with_quaternion(end)
    end[:, POSITIONS:] *= _sign(first, second, size)
    curve = QuaternionPoseCurve(checked_septic(start, end, length, join))
    _, least = smallest(curve.quality, curve.knots)
    if least < LEAST_QUALITY:
        raise PathError(
            "the tool turns too much in the blend",
            s_interval=(join.s, join.s),
            found=f"quaternions interpolated with a quality of {least:.2g} out of 1",
            allowed=f"{LEAST_QUALITY} or more",
            where=f"{join.blend_key}: {join.where}",
            hint="Shorten the blend, or turn the tool along longer segments",
        )
    return curve


def _with_quaternion(pose: Array) -> Array:
    """Return the derivatives of position and quaternion, (4, 7), from those of a pose, (4, 12)."""
    return np.concatenate(
        [pose[:, :POSITIONS], quaternion_derivatives(rotations(pose))], axis=1
    )


def _sign(first: Curve, second: Curve, size: float) -> float:
    """Return the sign of the end's quaternion that continues the start's along both curves."""
    steps = np.linspace(0.0, size, _SIGN_POINTS)
    poses = [
        first.derivatives(first.length - size + steps, 0)[0],
        second.derivatives(steps, 0)[0],
    ]
    quaternions = quaternions_of(rotation_of(rotations(np.concatenate(poses))))
    return float(np.sign(with_like_signs(quaternions)[-1] @ quaternions[-1]))
