"""Orientations along a segment: fixed, turning about an axis, or turning with the tangent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.arc import ArcCurve
from brachis.path.helix import HelixCurve
from brachis.path.leibniz import product, unit
from brachis.path.rotations import hat
from brachis.path.sampling import smallest
from brachis.path.site import place
from brachis.path.turns import turn_of
from brachis.task import AlongTangent, Rotate, TurnTo

if TYPE_CHECKING:
    from brachis.path.protocol import Array, Curve, Orientation

_PARALLEL = np.sin(np.deg2rad(1.0))
_STOPS = 1e-3


@dataclass(frozen=True, eq=False)
class Fixed:
    """An orientation that stays.

    Attributes
    ----------
    start : ndarray, shape (3, 3)
        The rotation matrix.
    """

    start: Array

    def matrices(self, sigma: Array, order: int = 3) -> Array:
        """Return the rotation matrix and its derivatives by sigma, shape (order + 1, K, 3, 3)."""
        result = np.zeros((order + 1, sigma.size, 3, 3))
        result[0] = self.start
        return result


@dataclass(frozen=True, eq=False)
class WithTangent:
    """An orientation that turns with a frame along a curve: x along its tangent, y along up x tangent.

    Attributes
    ----------
    position : Curve
        The curve in three position rows; one more derivative of it is needed than of the orientation.
    up : ndarray, shape (3,)
        World direction that is never along the tangent.
    tool : ndarray, shape (3, 3)
        Rotation matrix of the tool in the moving frame.
    """

    position: Curve
    up: Array
    tool: Array

    def matrices(self, sigma: Array, order: int = 3) -> Array:
        """Return the rotation matrix and its derivatives by sigma, shape (order + 1, K, 3, 3)."""
        tangent = unit(self.position.derivatives(sigma, order + 1)[1:])
        sideways = unit(tangent @ hat(self.up).T)
        upwards = product(hat(tangent), sideways, "...ij,...j->...i")
        frame = np.stack([tangent, sideways, upwards], axis=-1)
        result: Array = frame @ self.tool
        return result


def orientation_along(
    mode: str | Rotate | TurnTo | AlongTangent | None, curve: Curve, start: Array, key: str
) -> Orientation:
    """Return the orientation of the tool along a segment.

    Parameters
    ----------
    mode : str, Rotate, TurnTo, AlongTangent, or None
        What the task asks for.
    curve : Curve
        The segment's position, three columns.
    start : ndarray, shape (3, 3)
        Rotation matrix of the tool at the segment's start.
    key : str
        Key of the orientation, for messages.

    Raises
    ------
    PathError
        The orientation is not defined along this curve.
    """
    if mode is None or mode == "fixed":
        return Fixed(start)
    if isinstance(mode, Rotate | TurnTo):
        return turn_of(mode, start, key).over(curve.length)
    given = mode.tangent.up if isinstance(mode, AlongTangent) else None
    return _with_tangent(curve, _up(given, curve), start, key)


def _up(given: tuple[float, float, float] | None, curve: Curve) -> Array:
    if given is not None:
        return np.array(given) / np.linalg.norm(given)
    return curve.normal if isinstance(curve, ArcCurve | HelixCurve) else np.array([0.0, 0.0, 1.0])


def _with_tangent(curve: Curve, up: Array, start: Array, key: str) -> WithTangent:
    sigma, speed = smallest(lambda sigma: np.linalg.norm(curve.derivatives(sigma, 1)[1], axis=1), curve.knots)
    if speed < _STOPS:
        problem = "the curve all but stops, so that it has no tangent"
        hint = "Use orientation: fixed, or other waypoints"
        raise PathError(problem, found=_place(curve, sigma), where=key, hint=hint)

    def sine(sigma: Array) -> Array:
        tangent = unit(curve.derivatives(sigma, 1)[1:])[0]
        size: Array = np.linalg.norm(np.cross(up, tangent), axis=1)
        return size

    sigma, least = smallest(sine, curve.knots)
    if least < _PARALLEL:
        problem = "the tangent becomes parallel to up, so that it does not say how the tool is turned about it"
        raise PathError(
            problem,
            found=f"{np.rad2deg(np.arcsin(least)):.2g} degrees between them at {_place(curve, sigma)}",
            allowed="1 degree or more",
            where=key,
            hint=f"Set {key}: {{tangent: {{up: [...]}}}} to a direction that the tangent does not take",
        )
    frame = WithTangent(curve, up, np.eye(3)).matrices(np.zeros(1), 0)[0, 0]
    return WithTangent(curve, up, frame.T @ start)


def _place(curve: Curve, sigma: float) -> str:
    point = curve.derivatives(np.array([sigma]), 0)[0, 0]
    return place("xyz", point)
