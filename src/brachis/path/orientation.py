"""Orientations of the tool along a segment: fixed, turning about a fixed axis, or turning with the tangent."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from brachis.common import tolerances
from brachis.errors import PathError
from brachis.kernel import rotation_derivatives
from brachis.path.context import place
from brachis.path.curves import ArcCurve, LineCurve, septic
from brachis.path.pose import smallest
from brachis.path.protocol import Array, Curve, Orientation
from brachis.path.rotations import hat, product, rotation_of, sine_cosine, unit
from brachis.task import AlongTangent, Rotate, TurnTo

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

AMBIGUOUS = 1e-4
"""Tolerance, rad, within which a turn counts as a half turn: rounding would decide which way to turn."""


def _about_axis(
    start: Array, axis: Array, angle: Curve, sigma: Array, order: int
) -> Array:
    """Return the rotation ``start exp(angle(sigma) hat(axis))`` about an axis of the tool frame, with derivatives."""
    sine, cosine = sine_cosine(angle.derivatives(sigma, order) / 2.0)
    quaternions = np.concatenate([cosine, sine * axis], axis=-1)
    return start @ rotation_derivatives(quaternions)


@dataclass(frozen=True, eq=False)
class Turn:
    """A rotation by an angle about an axis of the tool frame.

    Attributes
    ----------
    start : ndarray, shape (3, 3)
        Rotation matrix of the tool before the turn.
    axis : ndarray, shape (3,)
        Unit vector of the axis, in the tool frame.
    angle : float
        Angle of the turn, rad.
    smooth : bool
        Whether the turn begins and ends at rate zero.
    """

    start: Array
    axis: Array
    angle: float
    smooth: bool

    def over(self, length: float) -> Orientation:
        """Return the turn spread over a range of sigma of the given length.

        If the turn is smooth, its angle is the septic polynomial whose first three derivatives vanish at both ends,
        ``35 u^4 - 84 u^5 + 70 u^6 - 20 u^7`` times the angle, with ``u = sigma / length``.
        """
        angle: Curve = LineCurve(np.zeros(1), np.array([self.angle / length]), length)
        if self.smooth:
            start, end = np.zeros((2, 4, 1))
            end[0] = self.angle
            angle = septic(start, end, length)
        return partial(_about_axis, self.start, self.axis, angle)


def turn_of(turning: Rotate | TurnTo, start: Array, key: str) -> Turn:
    """Return the turn that a task describes.

    Parameters
    ----------
    turning : Rotate or TurnTo
        The turn as given in the task.
    start : ndarray, shape (3, 3)
        Rotation matrix of the tool before the turn.
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
        angle = float(np.deg2rad(rotate.angle_deg))
        return Turn(start, axis, angle, rotate.profile == "smooth")
    smooth = turning.to.profile == "smooth"
    return turn_between(start, turning.to.rotation, f"{key}.to", smooth=smooth)


def turn_between(
    start: Array, target: Rotation, key: str, *, smooth: bool = False
) -> Turn:
    """Return the shortest turn from a rotation matrix to another rotation.

    Raises
    ------
    PathError
        The target is half a turn away, so there are two shortest turns.
    """
    vector = (rotation_of(start).inv() * target).as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle > np.pi - AMBIGUOUS:
        raise half_turn(key)
    axis = vector / angle if angle > tolerances.LENGTH else np.array([1.0, 0.0, 0.0])
    return Turn(start, axis, angle, smooth)


def half_turn(key: str) -> PathError:
    """Return the error for an orientation that is half a turn away from the previous one."""
    return PathError(
        "the orientation is half a turn away from the previous one, so the direction of rotation is ambiguous",
        found="180 degrees",
        allowed="less than 180 degrees",
        where=key,
        hint="Add an orientation in between, or use rotate: {axis: [...], angle_deg: 180}",
    )


def _stay(start: Array, sigma: Array, order: int) -> Array:
    """Return a constant rotation matrix and its derivatives."""
    result = np.zeros((order + 1, sigma.size, 3, 3))
    result[0] = start
    return result


def _with_frame(
    position: Curve, up: Array, tool: Array, sigma: Array, order: int
) -> Array:
    """Return the rotation of a tool that is fixed in a frame along a curve: x along the tangent, y along up x tangent.

    The position must have one more derivative than the orientation.
    """
    tangent = unit(position.derivatives(sigma, order + 1)[1:])
    sideways = unit(tangent @ hat(up).T)
    upwards = product(hat(tangent), sideways, "...ij,...j->...i")
    return np.stack([tangent, sideways, upwards], axis=-1) @ tool


def orientation_along(
    mode: str | Rotate | TurnTo | AlongTangent | None,
    curve: Curve,
    start: Array,
    key: str,
) -> Orientation:
    """Return the orientation of the tool along a segment.

    Parameters
    ----------
    mode : str, Rotate, TurnTo, AlongTangent, or None
        Orientation as given in the task.
    curve : Curve
        Position of the tool along the segment, three columns.
    start : ndarray, shape (3, 3)
        Rotation matrix of the tool at the segment's start.
    key : str
        Key of the orientation, for messages.

    Raises
    ------
    PathError
        The orientation is undefined along this curve.
    """
    if mode is None or mode == "fixed":
        return partial(_stay, start)
    if isinstance(mode, Rotate | TurnTo):
        return turn_of(mode, start, key).over(curve.length)
    stated_up = mode.tangent.up if isinstance(mode, AlongTangent) else None
    up = np.array([0.0, 0.0, 1.0])
    if stated_up is not None:
        up = np.array(stated_up) / np.linalg.norm(stated_up)
    elif isinstance(curve, ArcCurve):
        up = curve.normal
    sigma, speed = smallest(
        lambda sigma: np.linalg.norm(curve.derivatives(sigma, 1)[1], axis=1),
        curve.knots,
    )
    if speed < 1e-3:
        raise PathError(
            "the curve almost stops, so its tangent is not defined",
            found=_place(curve, sigma),
            where=key,
            hint="Use orientation: fixed, or other waypoints",
        )

    def sine(sigma: Array) -> Array:
        """Return the sine of the angle between the tangent and up, (K,)."""
        tangent = unit(curve.derivatives(sigma, 1)[1:])[0]
        return np.linalg.norm(np.cross(up, tangent), axis=1)

    sigma, least = smallest(sine, curve.knots)
    if least < np.sin(np.deg2rad(1.0)):
        raise PathError(
            "the tangent becomes parallel to up, so the tool's rotation about it is not defined",
            found=f"{np.rad2deg(np.arcsin(least)):.2g} degrees between them at {_place(curve, sigma)}",
            allowed="1 degree or more",
            where=key,
            hint=f"Set {key}: {{tangent: {{up: [...]}}}} to a direction that the tangent does not come close to",
        )
    frame = _with_frame(curve, up, np.eye(3), np.zeros(1), 0)[0, 0]
    return partial(_with_frame, curve, up, frame.T @ start)


def _place(curve: Curve, sigma: float) -> str:
    point = curve.derivatives(np.array([sigma]), 0)[0, 0]
    return place("xyz", point)
