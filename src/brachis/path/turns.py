"""Turns of the tool about an axis that stands still."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.leibniz import sine_cosine
from brachis.path.line import LineCurve
from brachis.path.rotations import hat, rotation_from, rotation_of
from brachis.path.septic import septic
from brachis.path.site import ZERO_LENGTH
from brachis.task import Rotate, TurnTo

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from brachis.path.protocol import Array, Curve

AMBIGUOUS = 1e-4
"""How near to half a turn (rad) an orientation cannot be from another one: rounding would decide which way to turn."""


@dataclass(frozen=True, eq=False)
class AboutAxis:
    """A rotation about an axis that stands still, ``start exp(angle(sigma) hat(axis))``.

    Attributes
    ----------
    start : ndarray, shape (3, 3)
        The rotation matrix at the start.
    axis : ndarray, shape (3,)
        Unit vector of the axis, in the tool frame.
    angle : Curve
        The angle, rad, as the only column.
    """

    start: Array
    axis: Array
    angle: Curve

    def matrices(self, sigma: Array, order: int = 3) -> Array:
        """Return the rotation matrix and its derivatives by sigma, shape (order + 1, K, 3, 3)."""
        sine, cosine = sine_cosine(self.angle.derivatives(sigma, order)[..., 0])
        aside = hat(self.axis)
        result = sine[..., None, None] * (self.start @ aside) - cosine[..., None, None] * (self.start @ aside @ aside)
        result[0] += self.start @ (np.eye(3) + aside @ aside)
        return result


@dataclass(frozen=True, eq=False)
class Turn:
    """A rotation by an angle about an axis of the tool frame.

    Attributes
    ----------
    start : ndarray, shape (3, 3)
        Rotation matrix of the tool before.
    axis : ndarray, shape (3,)
        Unit vector of the axis, in the tool frame.
    angle : float
        The angle, rad.
    smooth : bool
        Whether it begins and ends at rate zero.
    """

    start: Array
    axis: Array
    angle: float
    smooth: bool

    def over(self, length: float) -> AboutAxis:
        """Return the rotation spread over a range of sigma.

        Where it is smooth, its angle is the septic polynomial whose first three derivatives vanish at both ends,
        ``35 u^4 - 84 u^5 + 70 u^6 - 20 u^7`` times the angle with ``u = sigma / length``.
        """
        if self.smooth:
            start, end = np.zeros((2, 4, 1))
            end[0] = self.angle
            return AboutAxis(self.start, self.axis, septic(start, end, length))
        return AboutAxis(self.start, self.axis, LineCurve(np.zeros(1), np.array([self.angle / length]), length))


def turn_of(turning: Rotate | TurnTo, start: Array, key: str) -> Turn:
    """Return the turn that a task asks for.

    Parameters
    ----------
    turning : Rotate or TurnTo
        The turn, as the task gives it.
    start : ndarray, shape (3, 3)
        Rotation matrix of the tool before.
    key : str
        Key of the turn, for messages.

    Raises
    ------
    PathError
        The target is half a turn away.
    """
    if isinstance(turning, Rotate):
        rotate = turning.rotate
        axis = np.array(rotate.axis) / np.linalg.norm(rotate.axis)
        if rotate.frame == "path":
            axis = start.T @ axis
        return Turn(start, axis, float(np.deg2rad(rotate.angle_deg)), rotate.profile == "smooth")
    return turn_between(start, rotation_from(turning.to), f"{key}.to", smooth=turning.to.profile == "smooth")


def turn_between(start: Array, target: Rotation, key: str, *, smooth: bool = False) -> Turn:
    """Return the shortest turn from a rotation matrix to another rotation.

    Raises
    ------
    PathError
        The target is half a turn away, so that there are two shortest ways.
    """
    vector = (rotation_of(start).inv() * target).as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle > np.pi - AMBIGUOUS:
        raise half_turn(key)
    axis = vector / angle if angle > ZERO_LENGTH else np.array([1.0, 0.0, 0.0])
    return Turn(start, axis, angle, smooth)


def half_turn(key: str) -> PathError:
    """Return the error that an orientation is half a turn away from the one before."""
    problem = "the orientation is half a turn away from the one before, so that the way there is ambiguous"
    return PathError(
        problem,
        found="180 degrees",
        allowed="less than 180 degrees",
        where=key,
        hint="Add an orientation in between, or use rotate: {axis: [...], angle_deg: 180}",
    )
