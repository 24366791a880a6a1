"""Blends between curves of poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.arrays import with_like_signs
from brachis.errors import PathError
from brachis.path.blend import check_neighbours, checked_septic, ends
from brachis.path.pose import LEAST_QUALITY, POSITIONS, QuaternionPoseCurve, rotations
from brachis.path.rotations import quaternion_derivatives, quaternions_of, rotation_of
from brachis.path.sampling import smallest

if TYPE_CHECKING:
    from brachis.path.joins import Join
    from brachis.path.protocol import Array, Curve

_SIGN_POINTS = 9


def blend_poses(first: Curve, second: Curve, size: float, join: Join) -> QuaternionPoseCurve:
    """Return the blend that replaces the last `size` of one curve of poses and the first `size` of the next.

    It is the polynomial of the position and the quaternion, which is then divided by its length; see
    `brachis.path.blend.blend_rows`.

    Raises
    ------
    PathError
        As for rows; or the tool turns too much in the blend.
    """
    check_neighbours(first, second, size, join, still="the tool turns on the spot", turning="the tool")
    start, end, length = ends(first, second, size, join.positions)
    start, end = _with_quaternion(start), _with_quaternion(end)
    end[:, POSITIONS:] *= _sign(first, second, size)
    curve = QuaternionPoseCurve(checked_septic(start, end, length, join))
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


def _with_quaternion(pose: Array) -> Array:
    """Return the derivatives of position and quaternion, (4, 7), from those of a pose, (4, 12)."""
    return np.concatenate([pose[:, :POSITIONS], quaternion_derivatives(rotations(pose))], axis=1)


def _sign(first: Curve, second: Curve, size: float) -> float:
    """Return the sign of the end's quaternion that continues the start's along both curves."""
    steps = np.linspace(0.0, size, _SIGN_POINTS)
    poses = [first.derivatives(first.length - size + steps, 0)[0], second.derivatives(steps, 0)[0]]
    quaternions = quaternions_of(rotation_of(rotations(np.concatenate(poses))))
    return float(np.sign(with_like_signs(quaternions)[-1] @ quaternions[-1]))
