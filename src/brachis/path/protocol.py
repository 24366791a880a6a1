"""Samples of a path, and the protocol of its curves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PathSample:
    """A path at K values of the path coordinate s.

    `xi` is the task velocity per unit s: ``J qdot = xi sdot`` and ``J qddot + Jdot qdot = xi_ds sdot**2 + xi sddot``.
    For task spaces of rows, `xi` is the derivative of the target. For poses, with the position p and the rotation
    matrix R of the tool frame in the world frame, it is the body twist [v; w]: the velocity ``v = R^T p'`` (m) and the
    angular velocity w of ``R^T R'`` (rad), both along the axes of the tool frame. `xi_ds` and `xi_dds` are the
    derivatives of these six numbers. For orientations with fewer position rows than a pose, the velocity and the
    angular velocity are along the axes of the world.

    Attributes
    ----------
    target : ndarray, shape (K, c)
        Task coordinates z(s): m for position rows, rad for angles; for an orientation, R row by row.
    xi : ndarray, shape (K, m)
        Task velocity per unit s: dz/ds, or the body twist.
    xi_ds : ndarray, shape (K, m)
        First derivative of `xi` with respect to s.
    xi_dds : ndarray, shape (K, m)
        Second derivative of `xi` with respect to s.
    """

    target: Array
    xi: Array
    xi_ds: Array
    xi_dds: Array


class Curve(Protocol):
    """One piece of a path over a parameter sigma in [0, length].

    Sigma is the arc length of the position rows, m. For a spline, sigma is the cumulative chord length of the
    waypoints. If only an angle moves, or the tool turns on the spot, sigma is the angle, rad.
    """

    @property
    def length(self) -> float:
        """Range of sigma."""
        ...

    @property
    def knots(self) -> Array:
        """Values of sigma between which the curve is analytic, from 0 to `length`."""
        ...

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the curve and its derivatives with respect to sigma up to `order`, shape (order + 1, K, c)."""
        ...


Orientation = Callable[[Array, int], Array]
"""Orientation of the tool along a segment: a function of K values of sigma and an order.

It returns the rotation matrices and their derivatives with respect to sigma, shape (order + 1, K, 3, 3).
"""


@dataclass(frozen=True, eq=False)
class MappedCurve:
    """A curve whose coordinates are a function of another curve's coordinates, over the same parameter.

    Attributes
    ----------
    curve : Curve
        The curve whose coordinates are mapped.
    function : callable
        Function of sigma, shape (K,), and of the curve's coordinates and derivatives, shape (order + 1, K, c).
    """

    curve: Curve
    function: Callable[[Array, Array], Array]

    @property
    def length(self) -> float:
        """Range of sigma."""
        return self.curve.length

    @property
    def knots(self) -> Array:
        """Values of sigma between which the curve is analytic; these are the knots of `curve`."""
        return self.curve.knots

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the curve and its derivatives with respect to sigma, shape (order + 1, K, m)."""
        return self.function(sigma, self.curve.derivatives(sigma, order))
